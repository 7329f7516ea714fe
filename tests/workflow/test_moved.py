"""A finished study in another place is up to date, and its data there, too."""

import os
import re
import shutil

import pytest
from click.testing import CliRunner
from scan_trees import make_tree
from shapes import phantom, save_labels

from gyriflow.cli.commands import main
from gyriflow.cli.init import write_bids
from gyriflow.cli.recognition import recognise

from .conftest import SMALL_STUDY, Workflow, launching

pytestmark = pytest.mark.slow

CURRENT = "everything is up to date"


def commands(workflow, *command):
    """Return what a command of gyriflow says."""
    with launching(workflow.directory):
        done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output
    return done.output


def test_a_moved_study_whose_data_were_moved_too_is_up_to_date(
    checkout_copy, tmp_path, capfd
):
    scan = tmp_path / "b.nii.gz"
    save_labels(scan, *phantom(22.0, 2.0))
    a, b = SMALL_STUDY["brains"]
    study = SMALL_STUDY | {"brains": [a, b | {"labels": "../b.nii.gz"}]}
    (tmp_path / "study").mkdir()
    workflow = Workflow(checkout_copy, tmp_path / "study")
    arguments = ("--configfile", workflow.write("study.yaml", study))
    workflow.lay_out(*arguments)
    workflow.count_as_made("--forceall", *arguments)
    folder = shutil.move(workflow.directory, tmp_path / "moved")
    scan = scan.rename(tmp_path / "other name.nii.gz")
    workflow = Workflow(checkout_copy, folder)
    config = workflow.directory / "study.yaml"
    config.write_text(config.read_text().replace("../b.nii.gz", scan.as_posix()))
    # new dates in no order, as of `cp -r`
    files = sorted(folder.rglob("*"), reverse=True)
    for number, path in enumerate(files):
        os.utime(path, (2e9 + number, 2e9 + number))
    before = {path: path.stat().st_mtime_ns for path in files}
    assert CURRENT in commands(workflow, "run", "study.yaml", "-n")
    assert before == {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    assert workflow.call("--cores", "1", "--configfile", "study.yaml") == 0
    assert CURRENT in capfd.readouterr().err
    # another scan in its place
    save_labels(scan, *phantom(22.5, 2.0))
    said = commands(workflow, "run", "study.yaml", "-n")
    changed = r"^  changed input other name\.nii\.gz: .*pial_with_thickness"
    assert re.search(changed, said, re.MULTILINE)


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
    shutil.move(workflow.directory, tmp_path / "there")
    moved = Workflow(checkout_copy, tmp_path / "there")
    for command in (bids, measure):
        assert CURRENT in commands(moved, *command)
