"""The plan of a study on disk: a job reads it instead of the configuration."""

import pytest
from configurations import resolved
from planned_figures import planned_figures
from snakemake_interface_executor_plugins.settings import ExecMode

from gyriflow.study.study import write_plan

from .conftest import SHAPES


@pytest.mark.parametrize("mode", [ExecMode.SUBPROCESS, ExecMode.REMOTE])
def test_a_job_reads_the_plan_and_not_the_configuration(tmp_path, mode):
    found = resolved(SHAPES, start="b21", folding={"end_week": 22})
    write_plan(found, tmp_path / "results" / "plan")
    # what the configuration says meanwhile is for the next run
    changed = {"brains": "nonsense"}
    figures, names = planned_figures(tmp_path, changed, mode=mode)
    assert list(names["BRAINS"]) == ["b21", "b22"]
    drawn = {figure.name for figure in figures}
    assert {"quality_page", "weekly_figure", "metrics_figure"} <= drawn


def test_a_job_without_a_plan_ends_with_the_name_of_the_file(tmp_path, capsys):
    with pytest.raises(SystemExit):
        planned_figures(tmp_path, {"brains": []}, mode=ExecMode.SUBPROCESS)
    assert "results/plan" in capsys.readouterr().err


def test_the_wide_table_says_who_was_scanned_beside_the_covariates(workflow):
    brains = [
        {**SHAPES[0], "subject": "x", "covariates": {"sex": "F"}},
        {**SHAPES[1], "subject": "x", "covariates": {"sex": "F"}},
        {"id": "single", "week": 22, "shape": {}},
    ]
    workflow.write("study.yaml", {"brains": brains})
    plan = workflow.plan("metrics_tables", "--configfile", "study.yaml")
    (job,) = [job for job in plan.jobs if job.rule == "metrics_tables"]
    assert job.settings()["covariates"] == {
        "b21": {"person": "x", "sex": "F"},
        "b22": {"person": "x", "sex": "F"},
        "single": {"person": "single"},
    }


@pytest.mark.parametrize(
    ("subjects", "has_growth"),
    # two scans of one fetus; a fetus each, or unknown
    [(["x", "x"], True), (["x", "y", None, None], False)],
)
def test_only_scans_of_one_subject_have_a_figure_of_growth(
    tmp_path, subjects, has_growth
):
    brains = [
        {"id": f"b{week}", "week": week, "subject": subject, "shape": {}}
        for week, subject in enumerate(subjects, start=21)
    ]
    figures, _ = planned_figures(tmp_path, {"brains": brains})
    assert ("growth_figure" in {figure.name for figure in figures}) == has_growth
