"""A study from start to tables, with a run that diverges among its runs."""

import pandas as pd
import pytest
from facts import Facts

from .conftest import COARSE

STUDY = {
    "start": "first",
    "surface": {"edge_length_mm": 3.0},
    "mesh": COARSE | {"max_surface_distance_mm": 0.6},
    "metrics": {"spangy_modes": 60, "curvature_radius_mm": 7.0},
    "folding": {
        "step_s": 86400,
        "ranks": 1,
        "thickness_mm": 3.0,
        "contact": "planes",
    },
}


def ellipsoids(first_week, *semi_axes_mm):
    """Return brains of ellipsoids, of a week and the next, with the end of folding in
    the latter."""
    weeks = (first_week, first_week + 1)
    brains = [
        {"id": name, "week": week, "shape": {"semi_axes_mm": axes}}
        for name, week, axes in zip("ab", weeks, semi_axes_mm, strict=True)
    ]
    return {"brains": brains, "folding": STUDY["folding"] | {"end_week": weeks[1]}}


@pytest.mark.slow
@pytest.mark.extended
def test_a_run_that_diverges_is_reported_and_the_others_are_compared(workflow):
    rates = {
        "base": "reference",
        "vary": {"growth_rate_per_s": [1.0e-7, 1.0e-5]},
        "fixed": {"max_halvings": 0},
        "compare_week": 28,
    }
    brains = ellipsoids(27, [28, 36, 25], [29, 37, 26])
    study = STUDY | brains | {"sweeps": {"rate": rates}}
    name = workflow.write("study.yaml", study)
    outcome = workflow.run(
        "sweeps", "--cores", "2", "--configfile", name, timeout_s=900
    )
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    folder = workflow.directory / "results" / "study"
    members = pd.read_csv(folder / "rate" / "members.csv").set_index("run")
    assert members["outcome"].to_dict() == {
        "rate-1e-07": "finished",
        "rate-1e-05": "diverged",
    }
    assert members.loc["rate-1e-05", "cause"] == Facts("GW", "mm")
    assert members.loc["rate-1e-05", "reached_week"] < 28
    compared = pd.read_csv(folder / "rate" / "comparison.csv")
    assert set(compared["run"]) == {"rate-1e-07"}
    # nothing is left to do, and only what a change concerns runs again
    assert workflow.jobs("sweeps", "--configfile", name) == {}
    study["sweeps"]["rate"] = rates | {"vary": {"growth_rate_per_s": [1e-7, 1.5e-7]}}
    jobs = workflow.jobs("sweeps", "--configfile", workflow.write("other.yaml", study))
    assert (jobs["simulate_member"], jobs["sweep_tables"]) == (1, 1)
    assert "tetrahedralise" not in jobs


@pytest.mark.slow
@pytest.mark.extended
def test_a_calibration_scores_its_runs_and_finds_the_rate_that_meets_a_brain(workflow):
    """The brain of the later week is larger along each axis, so that the best rate is
    not the lowest."""
    search = {
        "base": "reference",
        "parameters": {"growth_rate_per_s": [0.5e-7, 4.0e-7]},
        "score": {"size": 1.0, "surface_distance": 0.1},
        "compare_week": 22,
        "rounds": [3, 1],
    }
    more = {"runs": {"reference": {}}, "calibrate": search}
    study = STUDY | ellipsoids(21, [20, 26, 18], [21, 27, 19]) | more
    name = workflow.write("study.yaml", study)
    outcome = workflow.run(
        "calibrate", "--cores", "2", "--configfile", name, timeout_s=900
    )
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    results = workflow.directory / "results"
    runs = pd.read_csv(results / "study/calibration/runs.csv")
    assert runs["outcome"].tolist() == ["finished"] * 4
    assert runs["round"].tolist() == [0, 0, 0, 1]
    score = runs["size"] + 0.1 * runs["surface_distance"]
    assert runs["score"].tolist() == pytest.approx(score.tolist())
    (best,) = pd.read_csv(results / "study/calibration/optimum.csv").to_dict("records")
    assert best["score"] == runs["score"].min()
    rates = runs.set_index("run")["growth_rate_per_s"]
    assert best["value"] == rates[best["run"]] > rates.min()
    assert (results / "study/calibration/calibration.png").exists()
