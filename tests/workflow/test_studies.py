"""A study from start to tables, with a run that diverges among its runs."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.geometry.triangles import area, signed_volume
from gyriflow.io.surfaces import read_surface

from .conftest import COARSE

ELLIPSOID = {"semi_axes_mm": [20, 26, 18]}
STUDY = {
    "brains": [
        {"id": "a", "week": 21, "shape": ELLIPSOID},
        {"id": "b", "week": 22, "shape": ELLIPSOID | {"semi_axes_mm": [21, 27, 19]}},
    ],
    "start": "first",
    "surface": {"edge_length_mm": 3.0},
    "mesh": COARSE | {"max_surface_distance_mm": 0.6},
    "metrics": {"spangy_modes": 60, "curvature_radius_mm": 7.0},
    "folding": {"end_week": 22, "step_s": 86400, "ranks": 1, "thickness_mm": 3.0, "contact": {"kind": "planes"}},
    "studies": {
        "rate": {
            "base": "reference",
            "vary": {"growth_rate_per_s": [1.0e-7, 1.0e-5]},
            "fixed": {"solver.max_newton": 3, "solver.max_halvings": 0},
            "compare_week": 22,
        }
    },
}  # fmt: skip


@pytest.mark.fault(55)
@pytest.mark.slow
def test_a_run_that_diverges_is_reported_and_sinks_nothing(workflow):
    name = workflow.write("study.yaml", STUDY)
    outcome = workflow.run("studies", "--cores", "2", "--configfile", name)
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    tables = workflow.directory / "results" / "study" / "rate"
    members = pd.read_csv(tables / "members.csv").set_index("run")
    assert members["outcome"].to_dict() == {"rate-1e-07": "finished", "rate-1e-05": "diverged"}
    assert "fails even with" in members.loc["rate-1e-05", "cause"]
    assert members.loc["rate-1e-05", "reached_week"] < 22
    comparison = pd.read_csv(tables / "comparison.csv")
    assert set(comparison["run"]) == {"rate-1e-07"}
    assert set(pd.read_csv(tables / "nearest.csv")["run"]) == {"rate-1e-07"}
    # nothing is left to do, and only what a change concerns runs again
    assert workflow.jobs("studies", "--configfile", name) == {}
    other = STUDY | {"studies": {"rate": STUDY["studies"]["rate"] | {"vary": {"growth_rate_per_s": [1e-7, 1.5e-7]}}}}
    jobs = workflow.jobs("studies", "--configfile", workflow.write("other.yaml", other))
    assert (jobs["simulate_member"], jobs["study_tables"]) == (1, 1)
    assert "tetrahedralise" not in jobs


@pytest.mark.slow
def test_what_the_paper_reports_stands_beside_the_same_of_the_shipped_atlas(workflow):
    study = {
        "atlas": {"name": "spina-bifida", "series": "operated", "weeks": [27, 28]},
        "start": "first",
        "surface": {"edge_length_mm": 2.0},
        "mesh": COARSE | {"min_radius_ratio": 0.001},
        "metrics": {"spangy_modes": 60, "curvature_radius_mm": 6.0},
        "folding": {"end_week": 28, "step_s": 302400, "ranks": 1},
        "runs": {"late": {"preset": "fetalfoldsim"}},
        "studies": {"thickness": {"base": "late", "vary": {"thickness_mm": [2.25, 6.0]}, "compare_week": 28}},
    }
    outcome = workflow.run("replication", "--cores", "2", "--configfile", workflow.write("study.yaml", study))
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    folder = workflow.directory / "results" / "study"
    table = pd.read_csv(folder / "replication.csv", keep_default_na=False).set_index("result")
    assert table.loc["largest displacement, 21-22 GW (mm)", "verdict"] == "not run"
    assert tuple(table.loc["all thicknesses come to 28 GW", ["here", "verdict"]]) == ("2 of 2 runs", "as in the paper")
    assert table.loc["ratios of 1 to 20 come to 29 GW", "verdict"] == "not run"
    page = (folder / "replication.html").read_text()
    assert "<p>Study thickness at 28 GW against" in page
    assert "spina bifida aperta, operated" in page
    assert all(name in page for name in ("dHCP", "2 of 2 runs"))


@pytest.mark.slow
def test_a_calibration_scores_its_runs_and_finds_the_rate_that_meets_a_brain(workflow):
    """The brain of the later week is a tenth larger along each axis: its area takes growth, the volume stays behind."""
    search = {
        "base": "reference",
        "parameters": {"growth_rate_per_s": [0.5e-7, 4.0e-7]},
        "score": {"size": 1.0, "surface_distance": 0.1},
        "compare_week": 22,
        "rounds": [3, 1],
    }
    study = {key: value for key, value in STUDY.items() if key != "studies"} | {"runs": {"reference": {}}}
    name = workflow.write("study.yaml", study | {"calibrate": search})
    outcome = workflow.run("calibrate", "--cores", "2", "--configfile", name, timeout_s=900)
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    results = workflow.directory / "results"
    runs = pd.read_csv(results / "study/calibration/runs.csv")
    assert runs["outcome"].tolist() == ["finished"] * 4
    assert runs["round"].tolist() == [0, 0, 0, 1]
    real = read_surface(results / "brains/b/surface/pial.surf.gii")
    for row in runs.to_dict("records"):
        folded = read_surface(results / f"runs/{row['run']}/a/surfaces/week-22.00/pial.surf.gii")
        expected = np.hypot(area(folded) / area(real) - 1, signed_volume(folded) / signed_volume(real) - 1)
        assert row["size"] == pytest.approx(expected, rel=1e-6)
        assert row["score"] == pytest.approx(row["size"] + 0.1 * row["surface_distance"])
    # the more growth, the larger: the least score is not at the lowest rate, and the optimum is near the best run
    (best,) = pd.read_csv(results / "study/calibration/optimum.csv").to_dict("records")
    assert (best["parameter"], best["lowest"], best["highest"]) == ("growth_rate_per_s", 0.5e-7, 4.0e-7)
    assert best["score"] <= runs["score"].min() + 2 * best["score_sd"] + 1e-3
    assert (results / "study/calibration/calibration.png").exists()
