"""The lines of a run: on a terminal and in a file, with warnings, weeks, failures and the end."""

import io

import pytest

from gyriflow.cli.terminal import ORDER, RunDisplay, ended_by_slurm, stages, subject
from gyriflow.shipped import SHIPPED
from gyriflow.step import EXIT_FILE, recorded_exit_code

STAGES = {"pial_from_labels": "surface", "simulate": "folding", "html_report": "report"}
STEP = '{{"event": "step", "week": {week}, "end_week": 23, "step": 1, "left_s": {left}}}\n'


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


def shown(display):
    return display.stream.getvalue()


def display_on(stream, clock):
    return RunDisplay(stream, STAGES, {"pial_from_labels": 10.0, "simulate": 100.0}, clock=clock)


@pytest.fixture
def display(clock):
    """The display of a run whose terminal is a file."""
    return display_on(io.StringIO(), clock)


def test_a_stage_and_its_brain_are_named_once_and_the_report_at_the_end(display, clock, tmp_path):
    display.plan({"pial_from_labels": 2, "html_report": 1, "all": 1}, 2)
    report = tmp_path / "results" / "report.html"
    report.parent.mkdir()
    report.touch()
    for number in (1, 2):
        display.job_begins(number, "pial_from_labels", {"brain": "a"}, ["x"], None)
        display.job_ends(number)
        display.progress(number, 4)
    display.job_begins(3, "html_report", {}, [str(report)], None)
    display.job_ends(3)
    clock.now = 130.0
    display.progress(4, 4)
    display.end()
    lines = shown(display).splitlines()
    assert lines[0] == "gyriflow: 4 steps to do"
    assert sum("brain a" in line for line in lines) == 1
    assert lines[-1] == f"gyriflow: done in 2 min; report: {report}"
    assert "\x1b" not in shown(display)
    assert "\r" not in shown(display)


def test_warnings_and_weeks_come_from_what_the_job_writes(display, clock, tmp_path):
    display.plan({"simulate": 1}, 1)
    log, progress = tmp_path / "simulate.log", tmp_path / "simulate.jsonl"
    display.job_begins(1, "simulate", {"run": "r", "brain": "a"}, ["x"], str(log))
    warning = '{"event": "warning", "message": "coarse"}\n'
    log.write_text("warning: coarse\n2026-11-22 00:54:57,955 WARNING trimesh: not ours\n")
    progress.write_text(warning + STEP.format(week=21.5, left=40.0))
    display.tick()
    display.tick()
    with progress.open("a") as file:
        file.write(STEP.format(week=22.0, left=30.0))
    display.tick()
    text = shown(display)
    assert text.count("warning folding, run r, brain a: coarse") == 1
    assert text.count("GW 22.00 of 23, 30 s left of this run") == 1
    assert "GW 21.50" not in text
    assert "not ours" not in text
    assert display.state()["running"] == ["folding, run r, brain a: GW 22.00 of 23"]
    # without a terminal, a week that takes long is told each minute
    clock.now = 61.0
    with progress.open("a") as file:
        file.write(STEP.format(week=22.4, left=15.0))
    display.tick()
    assert "GW 22.40 of 23" in shown(display)


def test_the_share_is_that_of_the_time_and_grows_while_one_job_runs(display, clock, tmp_path):
    """A folding that takes as long as all else, of which nothing is told for a while."""
    display.plan({"pial_from_labels": 10, "simulate": 1, "all": 1}, 1)
    for number in range(10):
        display.job_begins(number, "pial_from_labels", {"brain": f"b{number}"}, ["x"], None)
        clock.now += 10.0
        display.job_ends(number)
        display.progress(number + 1, 12)
    log = tmp_path / "simulate.log"
    display.job_begins(11, "simulate", {"run": "r", "brain": "a"}, ["x"], str(log))
    assert shown(display).splitlines()[-1].startswith(" 50 %  folding      run r, brain a")
    # it says itself that it takes longer than foldings do
    log.with_suffix(".jsonl").write_text(STEP.format(week=21.5, left=800.0))
    clock.now += 61.0
    display.tick()
    assert shown(display).splitlines()[-1].startswith(" 50 %  folding")
    shares = []
    for left in (500.0, 200.0, 0.0):
        with log.with_suffix(".jsonl").open("a") as file:
            file.write(STEP.format(week=22.0, left=left))
        clock.now += 300.0
        display.tick()
        shares.append(int(shown(display).splitlines()[-1].split("%")[0]))
    assert shares == [50, 79, 99]
    # then the log is silent: what runs is named all the same
    clock.now += 301.0
    display.tick()
    assert "running for 21 min" in shown(display).splitlines()[-1]


def test_a_failure_begins_with_its_cause_and_names_its_log(display, tmp_path):
    display.plan({"pial_from_labels": 1, "simulate": 1}, 1)
    log = tmp_path / "log"
    log.write_text("2026-11-22 00:54:58,001 ERROR root: a.nii: is no image\n")
    display.job_begins(1, "pial_from_labels", {"brain": "a"}, ["x"], str(log))
    display.job_fails(1, "pial_from_labels", [str(log)])
    display.end()
    assert shown(display).splitlines()[2:] == [
        "failed  surface, brain a: a.nii: is no image",
        f"        log: {log}",
        "gyriflow: 1 step failed after 5 s, 2 are not done; once the cause is mended, the same command goes on from "
        "here",
    ]
    assert display.state()["failed"] == [{"what": "surface, brain a", "why": "a.nii: is no image", "logs": [str(log)]}]


def test_what_a_job_said_right_before_it_failed_is_told(display, tmp_path):
    display.plan({"simulate": 1}, 1)
    log = tmp_path / "log"
    display.job_begins(1, "simulate", {"run": "r", "brain": "a"}, ["x"], str(log))
    log.write_text("warning: too coarse\ngyriflow: memory ran out\n")
    size = '{"event": "size", "elements": 12, "unknowns": 9, "ranks": 1, "memory_mib": 70}\n'
    (tmp_path / "log.jsonl").write_text(size)
    display.job_fails(1, "simulate", [str(log)])
    lines = shown(display).splitlines()
    assert "12 elements, 9 unknowns, 1 ranks, about 70 MiB" in lines[-4]
    assert lines[-3] == "warning folding, run r, brain a: too coarse"
    assert lines[-2] == "failed  folding, run r, brain a: memory ran out"


@pytest.mark.fault(38)
@pytest.mark.parametrize(
    ("signal", "said", "code"),
    [("SIGKILL: 9", "it was killed, most probably because memory ran out", 137), ("SIGSEGV: 11", "it crashed", None)],
)
def test_a_program_that_a_signal_has_ended_is_told_as_that(display, tmp_path, monkeypatch, signal, said, code):
    monkeypatch.setenv(EXIT_FILE, str(tmp_path / "code"))
    display.plan({"pial_from_labels": 1}, 1)
    display.job_begins(1, "pial_from_labels", {"brain": "a"}, ["x"], None)
    display.job_fails(
        1, "pial_from_labels", [], f"CalledProcessError in file x:\n'python x.py' died with <Signals.{signal}>."
    )
    assert f"failed  surface, brain a: {said}" in shown(display)
    assert recorded_exit_code(tmp_path / "code") == code


def test_a_stage_without_results_is_not_called_done(display):
    display.plan({"calibrate": 1}, 1)
    display.job_begins(1, "calibrate", {}, [], None)
    display.job_ends(1)
    display.progress(1, 1)
    display.end()
    assert shown(display).splitlines()[-1].endswith("the configuration asks for no results of this stage")


def test_a_terminal_has_a_last_line_that_is_written_over(clock, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    display = display_on(Terminal(), clock)
    display.plan({"pial_from_labels": 10}, 1)
    for number in range(5):
        display.job_begins(number, "pial_from_labels", {"brain": f"b{number}"}, ["x"], None)
        clock.now += 20.0
        display.job_ends(number)
        display.progress(number + 1, 10)
    # five more at 20 s each
    assert display.time_left() == pytest.approx(100.0)
    assert "\r\x1b[K" in shown(display)
    assert " 50 %  2 min left" in shown(display).splitlines()[-1]


def test_rules_have_the_stage_of_their_file():
    found = stages(SHIPPED / "workflow" / "rules")
    assert found["pial_from_labels"] == "surface"
    # a checkpoint is a rule, too
    assert found["simulate"] == found["simulate_member"] == "folding"
    assert found["measure"] == "metrics"
    # those that `check` lists
    assert set(found.values()) <= set(ORDER)


@pytest.mark.parametrize(
    ("wildcards", "expected"),
    [
        ({"brain": "a"}, "brain a"),
        ({"run": "r", "brain": "a", "week": "21.00"}, "run r, brain a"),
        ({"where": "brains/a/metrics"}, "brain a"),
        ({"where": "runs/r/a/metrics/week-22.00"}, "run r, brain a"),
        ({"earlier": "a", "later": "b"}, "brain a to b"),
        ({}, "study"),
    ],
)
def test_a_job_is_named_by_what_it_works_on(wildcards, expected):
    assert subject(wildcards) == expected


def test_a_rule_of_the_registry_of_figures_is_of_the_figures(display):
    display.plan({"overlay_figure": 1}, 1)
    display.job_begins(1, "overlay_figure", {"brain": "a"}, ["x.png"], None)
    assert shown(display).splitlines()[-1].endswith("figures      brain a")


def test_what_was_stopped_is_no_failure(display, tmp_path):
    display.plan({"simulate": 1, "pial_from_labels": 1}, 1)
    display.progress(1, 2)
    display.job_begins(1, "simulate", {"run": "r", "brain": "a"}, ["x"], None)
    display.interrupted = True
    display.job_fails(1, "simulate", [])
    display.end()
    assert "failed" not in shown(display)
    assert shown(display).splitlines()[-1] == "gyriflow: stopped after 5 s, 1 of 2 steps are done"
    assert display.state()["interrupted"]


@pytest.mark.parametrize(
    ("state", "expected"),
    [
        ("CANCELLED", "Slurm job 12: it was cancelled"),
        ("OUT_OF_MEMORY", "Slurm job 12: its memory ran out: more is given by --set-resources measure:mem_mb=MIB"),
        # the log says why
        ("FAILED", ""),
    ],
)
def test_what_slurm_has_done_to_a_job_is_told(state, expected):
    # as snakemake-executor-plugin-slurm 2.8 puts it
    message = f"SLURM-job '12' failed, SLURM status is: '{state}'. Reason: Unknown."
    assert ended_by_slurm(message, "measure") == expected
    lost = "SLURM-job '12' failed due to a node failure, SLURM status is: 'NODE_FAIL'. Failed nodes will be excluded"
    assert ended_by_slurm(lost, "measure") == "Slurm job 12: its node was lost"
    assert ended_by_slurm("", "measure") == ""
