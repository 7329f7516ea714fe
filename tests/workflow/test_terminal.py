"""What a run tells on the terminal, and what it leaves in the log: real runs of one brain's surface."""

import os
import pty
import re
import subprocess
from contextlib import suppress
from pathlib import Path

import pytest

from gyriflow.cli.status import STATE
from gyriflow.io.files import read_json

from .conftest import SMALL_STUDY

ONE_BRAIN = SMALL_STUDY | {"brains": SMALL_STUDY["brains"][:1]}


def on_a_terminal(workflow, *arguments):
    """Returns the exit code of a run on a pseudo terminal, and what it has written."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        workflow.command(*arguments), cwd=workflow.directory, env=workflow.environment | {"TERM": "xterm"},
        stdin=theirs, stdout=theirs, stderr=theirs,
    )  # fmt: skip
    os.close(theirs)
    pieces = []
    # the end of a pseudo terminal is an error
    with suppress(OSError):
        while piece := os.read(ours, 4096):
            pieces.append(piece)
    os.close(ours)
    return process.wait(timeout=300), b"".join(pieces).decode()


@pytest.mark.slow
def test_a_run_shows_a_bar_and_all_else_is_in_the_log(workflow):
    arguments = ("--cores", "1", "surface", "--configfile", workflow.write("study.yaml", ONE_BRAIN))
    code, said = on_a_terminal(workflow, *arguments)
    assert code == 0, said
    assert "pial_from_labels a\r\x1b[2K" in said
    assert "gyriflow: done in" in said
    (log,) = re.findall(r"all details: (\S+)", said)
    assert "rule pial_from_labels:" in Path(log).read_text()
    state = read_json(workflow.directory / STATE)
    assert state["done"] == state["total"] > 2
    assert state["ended"] is not None
    # elsewhere without control codes
    again = workflow.run(*arguments)
    assert "gyriflow: everything is up to date" in again.stderr.splitlines()
    assert not {"\x1b", "\r"} & set(again.stdout + again.stderr)
    # Snakemake's own messages are a word away
    as_before = workflow.run(*arguments, "--verbose")
    assert "Nothing to be done" in as_before.stdout + as_before.stderr
