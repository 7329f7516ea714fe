"""The lines of a run: on a terminal and in a file, with warnings, weeks, failures and the end."""

import io

import pytest

from gyriflow.shipped import SHIPPED
from gyriflow.terminal.display import RunDisplay
from gyriflow.terminal.stages import ORDER, stages, subject

STAGES = {"pial_from_labels": "surface", "simulate": "folding", "html_report": "report"}
LINE = "GW {week:.3f}/23  step    1  newton 6  krylov  69  max|u| 0.1 mm  min J 0.9  5.24 s  left 2:22\n"


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


def test_a_stage_and_its_brain_are_named_once_and_the_report_at_the_end(clock, tmp_path):
    display = display_on(io.StringIO(), clock)
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


def test_warnings_and_weeks_come_from_the_log_of_the_job(clock, tmp_path):
    display = display_on(io.StringIO(), clock)
    display.plan({"simulate": 1}, 1)
    log = tmp_path / "simulate.log"
    display.job_begins(1, "simulate", {"run": "r", "brain": "a"}, ["x"], str(log))
    log.write_text("warning: coarse\n" + LINE.format(week=21.5))
    display.tick()
    display.tick()
    with log.open("a") as file:
        file.write(LINE.format(week=22.0))
    display.tick()
    text = shown(display)
    assert text.count("warning folding, run r, brain a: coarse") == 1
    assert text.count("GW 22.00 of 23") == 1
    assert "GW 21.50" not in text
    assert display.state()["running"] == ["folding, run r, brain a: GW 22.00 of 23"]
    # without a terminal, a week that takes long is told each minute
    clock.now = 61.0
    with log.open("a") as file:
        file.write(LINE.format(week=22.4))
    display.tick()
    assert "GW 22.40 of 23" in shown(display)


def test_a_failure_begins_with_its_cause_and_names_its_log(clock, tmp_path):
    display = display_on(io.StringIO(), clock)
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


def test_what_a_job_said_right_before_it_failed_is_told(clock, tmp_path):
    display = display_on(io.StringIO(), clock)
    display.plan({"simulate": 1}, 1)
    log = tmp_path / "log"
    display.job_begins(1, "simulate", {"run": "r", "brain": "a"}, ["x"], str(log))
    log.write_text("12 elements, 9 unknowns, 1 ranks, about 70 MiB\nwarning: too coarse\ngyriflow: memory ran out\n")
    display.job_fails(1, "simulate", [str(log)])
    lines = shown(display).splitlines()
    assert lines[-4] == "warning folding, run r, brain a: too coarse"
    assert "about 70 MiB" in lines[-3]
    assert lines[-2] == "failed  folding, run r, brain a: memory ran out"


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


def test_rules_have_the_stage_of_their_file_and_figures_their_own():
    found = stages(SHIPPED / "workflow" / "rules")
    assert found["pial_from_labels"] == "surface"
    # a checkpoint is a rule, too
    assert found["simulate"] == found["simulate_member"] == "folding"
    assert found["overlay_figure"] == found["weekly_figure"] == "figures"
    assert found["measure"] == "metrics"
    assert found["refused_quality_figure"] == "figures"
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


def test_what_was_stopped_is_no_failure(clock, tmp_path):
    display = display_on(io.StringIO(), clock)
    display.plan({"simulate": 1, "pial_from_labels": 1}, 1)
    display.progress(1, 2)
    display.job_begins(1, "simulate", {"run": "r", "brain": "a"}, ["x"], None)
    display.interrupted = True
    display.job_fails(1, "simulate", [])
    display.end()
    assert "failed" not in shown(display)
    assert shown(display).splitlines()[-1] == "gyriflow: stopped after 5 s, 1 of 2 steps are done"
    assert display.state()["interrupted"]
