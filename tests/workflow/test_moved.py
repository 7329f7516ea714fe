"""A finished study elsewhere: moved, copied, its data in another place, and with a
newer version of gyriflow."""

import os
import re
import shutil
import sys

import pytest
from processes import ran
from scan_trees import make_tree
from shapes import phantom, save_labels

from gyriflow.cli.init import write_bids
from gyriflow.cli.recognition import recognise

from .conftest import SMALL_STUDY, Workflow

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def made(checkout_copy, tmp_path_factory):
    """A study that counts as made, in a folder `study` of a project, with one scan
    beside it and one in it."""
    project = tmp_path_factory.mktemp("project")
    workflow = Workflow(checkout_copy, project / "study")
    (project / "scans").mkdir()
    workflow.directory.mkdir()
    save_labels(project / "scans" / "b.nii.gz", *phantom(22.0, 2.0))
    study = SMALL_STUDY | {
        "brains": [
            SMALL_STUDY["brains"][0],
            SMALL_STUDY["brains"][1] | {"labels": "../scans/b.nii.gz"},
        ]
    }
    arguments = ("--configfile", workflow.write("study.yaml", study))
    workflow.lay_out(*arguments)
    workflow.count_as_made("--forceall", *arguments)
    return workflow


def commands(workflow, *command):
    """Return what a command of gyriflow says."""
    outcome = ran(
        sys.executable,
        "-m",
        "gyriflow.cli",
        *command,
        cwd=workflow.directory,
        env=workflow.environment,
    )
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    return outcome.stdout


def copied(made, target):
    """Return a copy of a study as of `cp -r`, with new dates in no order."""
    shutil.copytree(made.directory.parent, target, copy_function=shutil.copy)
    for number, path in enumerate(sorted(target.rglob("*"), reverse=True)):
        os.utime(path, (2e9 + number, 2e9 + number))
    return Workflow(made.checkout, target / "study")


def test_a_moved_or_copied_study_is_up_to_date(made, tmp_path):
    workflow = copied(made, tmp_path / "copy")
    before = {path: path.stat().st_mtime_ns for path in workflow.directory.rglob("*")}
    assert "everything is up to date" in commands(workflow, "run", "study.yaml", "-n")
    assert before == {
        path: path.stat().st_mtime_ns for path in workflow.directory.rglob("*")
    }
    outcome = workflow.run("--cores", "1", "--configfile", "study.yaml")
    assert (outcome.returncode, "everything is up to date" in outcome.stderr) == (
        0,
        True,
    ), outcome.stderr
    # from now on it has its own dates
    assert workflow.jobs("--configfile", "study.yaml") == {}
    shutil.move(tmp_path / "copy", tmp_path / "moved")
    moved = Workflow(made.checkout, tmp_path / "moved" / "study")
    assert "everything is up to date" in commands(moved, "check", "study.yaml")


def test_a_moved_data_set_is_up_to_date_for_measuring_and_for_the_bids_app(
    checkout_copy, tmp_path, monkeypatch
):
    workflow = Workflow(checkout_copy, tmp_path / "here")
    make_tree(
        workflow.directory / "data",
        labels=["sub-01/ses-1/anat/sub-01_ses-1_dseg.nii.gz"],
        tables={"participants.tsv": ["participant_id scan_age", "sub-01 24.0"]},
    )
    bids = ("data", "out", "group", "-n")
    measure = ("measure", "data", "-d", "measured", "-n")
    config = workflow.directory / "out" / "work" / "gyriflow.yaml"
    data = workflow.directory / "data"
    write_bids(recognise(data), data, config, config)
    commands(workflow, "init", "data")
    for directory, config, targets in (
        ("out/work", "out/work/gyriflow.yaml", ("all", "export")),
        ("measured", "data/gyriflow.yaml", ("all",)),
    ):
        if directory == "measured":
            monkeypatch.setenv("GYRIFLOW_MEASURE_ONLY", "1")
        inside = Workflow(checkout_copy, workflow.directory / directory)
        arguments = (*targets, "--configfile", str(workflow.directory / config))
        inside.directory.mkdir(exist_ok=True)
        inside.lay_out(*arguments)
        inside.count_as_made("--forceall", *arguments)
    monkeypatch.delenv("GYRIFLOW_MEASURE_ONLY")
    for command in (bids, measure):
        assert "everything is up to date" in commands(workflow, *command)
    shutil.move(workflow.directory, tmp_path / "there")
    moved = Workflow(checkout_copy, tmp_path / "there")
    for command in (bids, measure):
        assert "everything is up to date" in commands(moved, *command)


def test_data_in_another_place_are_the_same_if_their_content_is(made, tmp_path):
    workflow = copied(made, tmp_path / "copy")
    (tmp_path / "disk").mkdir()
    scan = shutil.move(
        tmp_path / "copy" / "scans" / "b.nii.gz",
        tmp_path / "disk" / "other name.nii.gz",
    )
    config = workflow.directory / "study.yaml"
    config.write_text(config.read_text().replace("../scans/b.nii.gz", scan.as_posix()))
    assert "everything is up to date" in commands(workflow, "run", "study.yaml", "-n")
    assert workflow.run("--cores", "1", "--configfile", "study.yaml").returncode == 0
    save_labels(scan, *phantom(22.5, 2.0))
    said = commands(workflow, "run", "study.yaml", "-n")
    assert re.search(
        r"^  changed input other name\.nii\.gz: .*pial_with_thickness",
        said,
        re.MULTILINE,
    )


def test_another_version_runs_only_what_its_code_changes(made, tmp_path):
    newer = shutil.copytree(
        made.checkout, tmp_path / "newer", copy_function=shutil.copy
    )
    workflow = Workflow(newer, made.directory)
    assert "everything is up to date" in commands(workflow, "check", "study.yaml")
    with (newer / "src" / "gyriflow" / "compare" / "placement.py").open("a") as file:
        file.write("\nCHANGED = True\n")
    said = commands(workflow, "check", "study.yaml")
    (line,) = re.findall(r"^  changed code.*(?:\n    .*)*", said, re.MULTILINE)
    assert "validation" in line
    assert "measure" not in said
