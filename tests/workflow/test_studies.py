"""A study from start to tables, with a run that diverges among its runs."""

import pandas as pd
import pytest

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
