"""What a run tells on the terminal, and what it leaves in the log: real runs of one phantom's surface."""

import os
import pty
import re
import subprocess
from pathlib import Path

import pytest

from gyriflow.cli.status import STATE
from gyriflow.io.files import read_json

from .conftest import SMALL_STUDY

ONE_BRAIN = SMALL_STUDY | {"brains": SMALL_STUDY["brains"][:1]}


def log_of(said):
    (path,) = re.findall(r"all details: (\S+)", said)
    return Path(path).read_text()


@pytest.mark.slow
def test_a_run_names_its_stage_and_brain_and_all_else_is_in_the_log(workflow):
    name = workflow.write("study.yaml", ONE_BRAIN)
    outcome = workflow.run("--cores", "1", "surface", "--configfile", name)
    assert outcome.returncode == 0, outcome.stderr
    said = outcome.stdout + outcome.stderr
    assert "\x1b" not in said
    assert "\r" not in said
    lines = said.splitlines()
    assert len(lines) < 10
    # after Snakemake's on its profile
    assert re.match(r"gyriflow: \d+ steps to do", lines[1])
    assert "  0 %  pial_from_labels a" in lines
    assert re.fullmatch(r"gyriflow: done in .*", lines[-1])
    details = log_of(said)
    assert "rule pial_from_labels:" in details
    assert "results/brains/a/surface/pial.surf.gii" in details
    state = read_json(workflow.directory / STATE)
    assert state["done"] == state["total"] > 2
    assert state["ended"] is not None
    # nothing is left to do, which is told as briefly
    again = workflow.run("--cores", "1", "surface", "--configfile", name)
    assert "gyriflow: everything is up to date" in again.stderr
    # Snakemake's own messages are a word away
    as_before = workflow.run("--cores", "1", "surface", "--verbose", "--configfile", name)
    assert "Nothing to be done" in as_before.stdout + as_before.stderr


@pytest.mark.slow
def test_a_failure_is_told_by_its_cause_once_and_first(workflow):
    (workflow.directory / "labels.nii.gz").write_bytes(b"not an image")
    brains = [{"id": "x", "week": 21, "labels": "labels.nii.gz", "scheme": "binary"}]
    name = workflow.write("study.yaml", SMALL_STUDY | {"brains": brains, "start": "x"})
    outcome = workflow.run("--cores", "1", "surface", "--configfile", name)
    assert outcome.returncode == 2
    lines = outcome.stderr.splitlines()
    first = next(index for index, line in enumerate(lines) if "labels.nii.gz" in line)
    assert lines[first].startswith("failed  pial_from_labels x: ")
    assert "cannot be read as an image" in lines[first]
    assert lines[first + 1].endswith("log: results/brains/x/logs/pial_from_labels.log")
    assert outcome.stderr.count("cannot be read as an image") == 1
    assert "CalledProcessError" not in outcome.stderr
    assert "Traceback" not in outcome.stderr
    assert "labels.nii.gz" in (workflow.directory / "results/brains/x/logs/pial_from_labels.log").read_text()
    assert not list((workflow.directory / ".snakemake").glob("gyriflow-exit-*"))
    assert [failure["what"] for failure in read_json(workflow.directory / STATE)["failed"]] == ["pial_from_labels x"]


@pytest.mark.slow
def test_a_terminal_gets_a_line_that_is_written_over(workflow):
    name = workflow.write("study.yaml", ONE_BRAIN)
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        workflow.command("--cores", "1", "results/brains/a/surface/pial.surf.gii", "--configfile", name),
        cwd=workflow.directory, env=workflow.environment | {"TERM": "xterm"},
        stdin=theirs, stdout=theirs, stderr=theirs,
    )  # fmt: skip
    os.close(theirs)
    pieces = []
    # the end of a pseudo terminal is an error
    while True:
        try:
            piece = os.read(ours, 4096)
        except OSError:
            break
        if not piece:
            break
        pieces.append(piece)
    os.close(ours)
    said = b"".join(pieces).decode()
    assert process.wait(timeout=300) == 0, said
    assert "\r\x1b[2K" in said
    assert "gyriflow: done in" in said
