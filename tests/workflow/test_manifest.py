"""Results are outdated exactly if they do not match what they were made from, whatever
Snakemake's records and dates say."""

import os
import re
import shutil

import pytest
import yaml

from gyriflow.settings.terms import SIDES

from .conftest import SMALL_STUDY, Workflow, labelled

pytestmark = pytest.mark.slow

REGIONS = {
    side: {"labels": f"{side}.label.gii", "surface": f"{side}.surf.gii"}
    for side in SIDES
}
STUDY = {
    "brains": [{"id": "a", "week": 21, **labelled(21)}],
    "metrics": {"regions": {"a": REGIONS}},
}
"""A brain with regions of the cortex, which is measured only."""
CONFIGURED = ("--configfile", "study.yaml")
SURFACE_STEPS = {"pial_with_thickness": 1, "measure": 1}
OTHER_EDGE = {"surface": {"edge_length_mm": 1.5}}


@pytest.fixture(scope="module")
def made(checkout_copy, tmp_path_factory):
    """The brain's study, which counts as made."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("manifest") / "study")
    workflow.directory.mkdir()
    for side, files in REGIONS.items():
        for kind, name in files.items():
            (workflow.directory / name).write_text(f"{kind} of {side}")
    workflow.write("study.yaml", STUDY)
    workflow.lay_out(*CONFIGURED)
    workflow.count_as_made("--forceall", *CONFIGURED)
    return workflow


def copied(made: Workflow, target, *, hidden: bool = True) -> Workflow:
    """Return a copy of a study with new dates in no order, as of `cp -r`; only its
    visible files without `hidden`."""
    left_out = shutil.ignore_patterns() if hidden else shutil.ignore_patterns(".*")
    shutil.copytree(made.directory, target, copy_function=shutil.copy, ignore=left_out)
    for number, path in enumerate(sorted(target.rglob("*"), reverse=True)):
        os.utime(path, (2e9 + number, 2e9 + number))
    return Workflow(made.checkout, target)


def change(workflow: Workflow, settings: dict) -> None:
    """Change sections of a study's configuration."""
    file = workflow.directory / "study.yaml"
    file.write_text(yaml.safe_dump(yaml.safe_load(file.read_text()) | settings))


def steps(workflow: Workflow, *rules: str) -> dict[str, int]:
    """Return the jobs that a dry run plans, of some rules."""
    jobs = workflow.jobs(*CONFIGURED)
    return {rule: count for rule, count in jobs.items() if rule in rules}


def exchange(first, second) -> None:
    """Exchange the names of two files."""
    kept = first.with_name("kept")
    first.rename(kept)
    second.rename(first)
    kept.rename(second)


@pytest.mark.parametrize("hidden", [True, False])
def test_a_copy_is_up_to_date_with_or_without_hidden_files(made, tmp_path, hidden):
    workflow = copied(made, tmp_path / "copy", hidden=hidden)
    assert workflow.jobs(*CONFIGURED) == {}


@pytest.mark.parametrize("hidden", [True, False])
def test_settings_changed_after_a_copy_run_again_what_depends_on_them(
    made, tmp_path, hidden
):
    workflow = copied(made, tmp_path / "copy", hidden=hidden)
    change(workflow, OTHER_EDGE)
    assert steps(workflow, *SURFACE_STEPS) == SURFACE_STEPS


def test_settings_and_labels_are_compared_where_snakemake_has_no_records(
    made, tmp_path
):
    shutil.copytree(made.directory, tmp_path / "study")
    workflow = Workflow(made.checkout, tmp_path / "study")
    shutil.rmtree(workflow.directory / ".snakemake")
    assert workflow.jobs(*CONFIGURED) == {}
    change(workflow, OTHER_EDGE)
    assert steps(workflow, *SURFACE_STEPS) == SURFACE_STEPS
    change(workflow, {"surface": {}})
    assert workflow.jobs(*CONFIGURED) == {}
    # another brain under the old name, older than the results
    labels = workflow.directory / "phantom-21.nii.gz"
    labels.write_bytes(labels.read_bytes() + b"other")
    os.utime(labels, (1e9, 1e9))
    assert steps(workflow, *SURFACE_STEPS) == SURFACE_STEPS
    # as in the whole study: its last step runs as well
    assert workflow.jobs(*CONFIGURED)["html_report"] == 1


@pytest.mark.parametrize("how", ["configuration", "files"])
def test_exchanged_files_of_the_two_sides_run_again_what_reads_them(
    made, tmp_path, how
):
    shutil.copytree(made.directory, tmp_path / "study")
    workflow = Workflow(made.checkout, tmp_path / "study")
    left, right = REGIONS.values()
    if how == "files":
        for kind in left:
            exchange(workflow.directory / left[kind], workflow.directory / right[kind])
    else:
        regions = {"a": {"left": right, "right": left}}
        change(workflow, {"metrics": {"regions": regions}})
    assert steps(workflow, "given_regions", "measure") == {"given_regions": 1}


def test_a_result_edited_in_a_copy_is_made_again(made, tmp_path):
    workflow = copied(made, tmp_path / "copy")
    table = workflow.directory / "results" / "brains" / "a" / "metrics" / "metrics.csv"
    table.write_text("edited")
    os.utime(table, (1e9, 1e9))
    assert steps(workflow, *SURFACE_STEPS) == {"measure": 1}
    # nothing is deleted before
    assert table.read_text() == "edited"


@pytest.mark.parametrize("hidden", [True, False])
def test_a_copy_of_a_half_updated_study_goes_on_where_it_stopped(
    made, tmp_path, hidden
):
    shutil.copytree(made.directory, tmp_path / "study")
    workflow = Workflow(made.checkout, tmp_path / "study")
    change(workflow, OTHER_EDGE)
    for surface in workflow.directory.glob("results/brains/a/surface/*"):
        surface.write_text("of the other edge")
    workflow.count_as_made("surface", "--forceall", *CONFIGURED)
    copy = copied(workflow, tmp_path / "copy", hidden=hidden)
    assert steps(copy, *SURFACE_STEPS) == {"measure": 1}


def test_the_dry_run_says_why_each_step_runs_again(made, tmp_path):
    shutil.copytree(made.directory, tmp_path / "study")
    workflow = Workflow(made.checkout, tmp_path / "study")
    change(workflow, OTHER_EDGE)
    said = workflow.run("-n", *CONFIGURED).stdout
    reasons = dict(
        re.findall(r"^rule (\w+):\n(?: +.*\n)*? +reason: (.*)\n", said, re.MULTILINE)
    )
    assert "edge_length_mm" in reasons["pial_with_thickness"]
    assert "another job" in reasons["measure"]


def test_results_of_an_earlier_configuration_are_current_again(finished, tmp_path):
    """Also with simulations: what was made from the same is kept."""
    shutil.copytree(finished.directory, tmp_path / "study", symlinks=True)
    workflow = Workflow(finished.checkout, tmp_path / "study")
    workflow.write("study.yaml", SMALL_STUDY | {"surface": {"edge_length_mm": 1.5}})
    assert workflow.jobs(*CONFIGURED)["simulate"] == 2
    workflow.write("study.yaml", SMALL_STUDY)
    assert workflow.jobs(*CONFIGURED) == {}
