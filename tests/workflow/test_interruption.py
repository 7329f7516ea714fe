"""A folding that is interrupted or killed within the workflow."""

import os
import re
import signal
import subprocess
import time

import pytest
from facts import Facts
from processes import all_end, below, command_of, kill

from gyriflow.io.files import read_json
from gyriflow.step import OUT_OF_MEMORY_MESSAGE

from .conftest import SMALL_STUDY

pytestmark = pytest.mark.slow

STUDY = SMALL_STUDY | {
    "brains": SMALL_STUDY["brains"][:1],
    # so many steps that the folding does not end before the signal arrives
    "folding": {"end_week": 21.25, "thickness_mm": 3.0, "step_s": 3600.0},
    "runs": {"reference": {}},
}
SUMMARY = "results/runs/reference/a/folding/summary.json"
LOG = "results/runs/reference/a/logs/simulate.log"


def launched(workflow, *arguments):
    return subprocess.Popen(
        workflow.command("--cores", "2", *arguments),
        cwd=workflow.directory,
        env=workflow.environment,
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        # which a background shell may have ignored
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )


def wait_until(condition, process):
    deadline = time.monotonic() + 90
    while not condition():
        assert process.poll() is None, process.communicate()[0]
        assert time.monotonic() < deadline, "the job did not begin"
        time.sleep(0.02)


def started(workflow, until):
    """Start the folding and return its process when the log has a line with `until`."""
    process = launched(workflow, SUMMARY, "--configfile", "study.yaml")
    log = workflow.directory / LOG
    wait_until(lambda: log.exists() and until in log.read_text(), process)
    return process


@pytest.mark.extended
def test_a_killed_rank_is_reported_as_memory_and_an_interrupted_folding_resumes(
    workflow,
):
    # an ellipsoid's
    workflow.count_ellipsoid_as_meshed(STUDY, cells=10)
    process = started(workflow, until="step    2")
    *_, rank = (
        pid
        for pid in below(process.pid)
        if command_of(pid)[1:3] == ["-m", "gyriflow.folding"]
    )
    kill([rank])
    printed, _ = process.communicate(timeout=60)
    assert process.returncode == 137, printed
    assert re.search(r"\d+ elements, .* \d+ MiB", printed)
    assert printed == Facts("simulate", "memory")
    assert OUT_OF_MEMORY_MESSAGE.text in (workflow.directory / LOG).read_text()
    assert not (workflow.directory / SUMMARY).exists()

    process = started(workflow, until="step   12")
    started_by_it = below(process.pid)
    os.killpg(process.pid, signal.SIGINT)
    printed, _ = process.communicate(timeout=60)
    assert process.returncode == 130, printed

    assert all_end(started_by_it)
    again = workflow.run("--cores", "2", SUMMARY, "--configfile", "study.yaml")
    assert again.returncode == 0, again.stdout + again.stderr
    assert "checkpoint" in (workflow.directory / LOG).read_text()
    summary = read_json(workflow.directory / SUMMARY)
    assert summary["resumed_after_step"] >= 12
    assert summary["steps"] == 42


FOREIGN = "import pathlib, sys; pathlib.Path('{0}.ran').touch(); sys.exit('{0}')"


def test_nothing_of_the_working_directory_is_run_by_a_study(workflow):
    workflow.count_ellipsoid_as_meshed(
        STUDY | {"folding": STUDY["folding"] | {"end_week": 21.02}}, cells=10
    )
    for name in ("random", "click", "numpy", "nibabel", "mpi4py"):
        (workflow.directory / f"{name}.py").write_text(FOREIGN.format(name))
    (workflow.directory / "Snakefile").write_text(
        "rule all:\n    shell: 'touch snakefile.ran'\n"
    )
    for profile in ("default", "profiles/default"):
        (workflow.directory / profile).mkdir(parents=True)
        (workflow.directory / profile / "config.yaml").write_text("touch: true\n")
    outcome = workflow.run("--cores", "1", SUMMARY, "--configfile", "study.yaml")
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    assert read_json(workflow.directory / SUMMARY)["weeks"][-1] == 21.02
    assert not list(workflow.directory.glob("*.ran"))


STUBBORN = """
rule slow:
    output: "slow.txt"
    shell:
        "mpiexec -n 2 sleep 600 &"
        " (trap '' TERM INT HUP; touch begun; sleep 600); wait"
"""


@pytest.mark.parametrize(
    ("name", "send"),
    [("SIGTERM", os.kill), ("SIGTERM", os.killpg), ("SIGHUP", os.kill)],
)
def test_a_signal_to_the_launcher_stops_its_jobs(workflow, name, send):
    (workflow.directory / "stubborn.smk").write_text(STUBBORN)
    process = launched(workflow, "slow.txt", "--snakefile", "stubborn.smk")
    number = signal.Signals[name]
    begun = workflow.directory / "begun"
    wait_until(lambda: begun.exists() and len(below(process.pid)) >= 5, process)
    jobs, sent = below(process.pid), time.monotonic()
    send(process.pid, number)
    printed, _ = process.communicate(timeout=60)
    assert time.monotonic() - sent < 10
    assert process.returncode == 128 + number, printed
    assert printed == Facts("interrupted", "same command", "resume")
    assert "failed" not in printed
    # if all get the signal at once, what ignores it may have no parent by which the
    # launcher finds it
    assert send is os.killpg or all_end(jobs)
