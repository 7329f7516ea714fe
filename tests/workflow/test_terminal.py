"""What a run tells on the terminal, and what it leaves in the log; in a folder and of a
file of any name."""

import os
import pty
import re
import subprocess
from contextlib import suppress
from pathlib import Path

import pytest
from shapes import phantom, save_labels

from gyriflow.io.files import read_json
from gyriflow.running.status import STATE

from .conftest import Workflow

# what a shell could take apart
FOLDER = "-a b; touch pwned; $(touch pwned) `touch pwned` 'it\"s é {brain}"
FILE = "$(touch pwned) 'x' \"y\"; touch pwned & -é.nii.gz"


def on_a_terminal(workflow, *arguments):
    """Return the exit code of a run on a pseudo terminal, and what it has written."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        workflow.command(*arguments),
        cwd=workflow.directory,
        env=workflow.environment | {"TERM": "xterm"},
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
    )
    os.close(theirs)
    pieces = []
    # the end of a pseudo terminal is an error
    with suppress(OSError):
        while piece := os.read(ours, 4096):
            pieces.append(piece)
    os.close(ours)
    return process.wait(timeout=300), b"".join(pieces).decode()


@pytest.mark.slow
def test_a_run_shows_a_bar_and_all_else_is_in_the_log_whatever_names_there_are(
    checkout_copy, tmp_path
):
    workflow = Workflow(checkout_copy, tmp_path / FOLDER)
    workflow.directory.mkdir()
    save_labels(workflow.directory / "plain.nii.gz", *phantom(21.0, 2.0))
    (workflow.directory / "plain.nii.gz").rename(workflow.directory / FILE)
    brain = {"id": "a", "week": 21, "labels": FILE, "scheme": "spina-bifida-atlas"}
    config = {
        "brains": [brain],
        "start": "a",
        "surface": {"edge_length_mm": 3.0},
        "folding": {"end_week": 22},
    }
    name = workflow.write("study.yaml", config)
    arguments = ("--cores", "1", "surface", "--configfile", name)
    code, said = on_a_terminal(workflow, *arguments)
    assert code == 0, said
    assert "pial_with_thickness a\r\x1b[2K" in said
    folder = re.escape(str(workflow.directory))
    (log,) = set(re.findall(rf"{folder}/\.snakemake/log/[\w.-]+\.log", said))
    assert "rule pial_with_thickness:" in Path(log).read_text()
    state = read_json(workflow.directory / STATE)
    assert state["done"] == state["total"] == 2
    assert state["ended"] is not None
    # elsewhere without control codes
    again = workflow.run(*arguments)
    assert not re.search(r"^gyriflow: .*\d", again.stderr, re.MULTILINE)
    assert not {"\x1b", "\r"} & set(again.stdout + again.stderr)
    pial = workflow.directory / "results/brains/a/surface/pial.surf.gii"
    assert pial.stat().st_size > 0
    assert not list(tmp_path.rglob("pwned*"))
    assert not (checkout_copy / "pwned").exists()
