"""What a run tells by Snakemake's records, on a terminal and in a file; how far a study
is, and whose results."""

import io
import logging
import os
import re
import signal
from pathlib import Path

import pytest
from configurations import LABELLED, touched
from facts import Facts

from gyriflow.errors import InputError
from gyriflow.io.files import read_json, write_json
from gyriflow.messages import (
    OUT_OF_MEMORY,
    STOPPED,
    Message,
    read_messages,
    write_event,
    write_message,
)
from gyriflow.running import terminal
from gyriflow.running.launch import Session, hold_lock
from gyriflow.running.manifest import Job
from gyriflow.running.provenance import check_results_belong_to, input_contents
from gyriflow.running.status import STATE, status
from gyriflow.running.terminal import RunDisplay
from gyriflow.study import resolve
from gyriflow.study.loading import load
from gyriflow.study.study import write_plan

SIZE = {"event": "size", "elements": 12, "unknowns": 9, "ranks": 1, "memory_mib": 70}
STEP = {"event": "step", "week": 21.5, "end_week": 23.0, "left_s": 75.0}
OWN = Message("error", "a.nii: is no image", exit_code=2)


class Run:
    """A run that Snakemake tells of, and what its display has written."""

    def __init__(self, folder):
        (folder / ".snakemake").mkdir()
        self.now = 0.0
        self.folder = folder
        self.details = folder / ".snakemake" / "log" / "x.log"
        self.display = RunDisplay(io.StringIO(), self.details, lambda: self.now)

    def tell(self, event=None, text="", level=logging.INFO, **said):
        record = logging.LogRecord("snakemake", level, "", 0, text, (), None)
        vars(record).update(said | {"event": event})
        self.display.show(record)

    def plan(self, **stats):
        self.tell("run_info", stats=stats)

    def begin(self, rule, brain="a", number=1):
        log = self.folder / f"{rule}{number}.log"
        named = {"rule_name": rule, "wildcards": {"brain": brain}}
        self.tell("job_info", jobid=number, output=["x"], log=[str(log)], **named)
        self.display.tick()
        return log

    def end(self, number=1, done=1, total=1):
        self.tell("job_finished", job_id=number)
        self.tell("progress", done=done, total=total)

    def fail(self, rule, log, message="", number=1):
        said = {"rule_name": rule, "log": [str(log)], "rule_msg": message}
        self.tell("job_error", jobid=number, **said)

    @property
    def lines(self):
        return self.display.console.file.getvalue().splitlines()

    @property
    def state(self):
        return read_json(self.folder / STATE)


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.setattr(terminal, "SIGNAL_S", 0.0)
    monkeypatch.setattr(terminal, "session", Session())
    return Run(tmp_path)


def test_a_quiet_log_has_a_line_each_few_percent_and_the_end(run):
    run.plan(measure=100, total=100)
    for number in range(100):
        run.begin("measure", f"b{number}", number)
        run.now += 2.0
        run.end(number, number + 1, 100)
    run.tell(text="a warning of Snakemake's", level=logging.WARNING)
    run.display.end()
    assert run.lines[0] == Facts("gyriflow:", 100, ".snakemake/log/x.log")
    assert run.lines[1] == "  0 %  measure b0"
    assert run.lines[11] == Facts("50 %", "2 min", "measure b50")
    assert run.lines[-2] == "a warning of Snakemake's"
    assert run.lines[-1] == Facts("gyriflow:", "5 s")
    assert len(run.lines) == 23
    assert "\x1b" not in "".join(run.lines)
    done = {name: run.state[name] for name in ("done", "total", "running")}
    assert done == {"done": 100, "total": 100, "running": []}


def test_a_job_counts_as_long_as_it_is_predicted_to_take(run, monkeypatch):
    seconds = {"pial": 8.0, "measure": 8.0, "metrics_tables": 2.0}
    monkeypatch.setattr(terminal, "job_seconds", lambda _, rule, __: seconds[rule])
    rules = ("pial", "measure", "metrics_tables", "metrics_tables")
    jobs = [Job(rule, {}, [rule], None, dict) for rule in rules]
    monkeypatch.setattr(terminal, "session", Session(study=object(), jobs=jobs))
    run.plan(pial=1, measure=1, metrics_tables=2, total=4)
    for number, rule in enumerate(rules[:3]):
        run.begin(rule, number=number)
        run.end(number, number + 1, 4)
    assert [line.split("%")[0].strip() for line in run.lines[1:]] == ["0", "40", "80"]


def test_a_folding_tells_its_size_weeks_and_warnings(run):
    run.plan(simulate=1)
    log = run.begin("simulate")
    write_event(log, SIZE)
    write_event(log, STEP)
    write_message(log, Message("warning", "coarse"))
    run.now = 25.0
    run.display.tick()
    run.end()
    assert run.lines[2:] == [
        Facts("simulate a:", 12, 1, "70 MiB"),
        Facts("simulate a: coarse"),
        # a quarter of its time has passed
        Facts("25 %", "simulate a:", "GW", 21.5, 23),
    ]
    assert run.state["running"] == [Facts("simulate a:", "GW", 21.5, 23)]


def test_a_failure_begins_with_its_cause_after_the_warnings(run):
    run.plan(pial_from_labels=1, simulate=1)
    log = run.begin("pial_from_labels")
    write_message(log, Message("warning", "thin cortex"))
    write_message(log, OWN)
    run.fail("pial_from_labels", log)
    failed = "Exiting because a job execution failed. Look below"
    run.tell(text=failed, level=logging.ERROR)
    run.display.end()
    assert run.lines[2:] == [
        Facts("pial_from_labels a: thin cortex"),
        Facts("pial_from_labels a: a.nii: is no image"),
        Facts(log),
        Facts("gyriflow:", "5 s", 1, 0, 2),
    ]


CALL = "CalledProcessError in file x:\n'python x.py' "
SLURM = "SLURM-job '12' failed, SLURM status is: '{}'. Reason: x"
"""As snakemake-executor-plugin-slurm 2.8 puts it."""


@pytest.mark.parametrize(
    ("message", "own", "facts", "code"),
    [
        (f"{CALL}died with <Signals.SIGKILL: 9>.", OWN, [OUT_OF_MEMORY], 137),
        (f"{CALL}died with <Signals.SIGSEGV: 11>.", OWN, ["SIGSEGV"], None),
        (f"{CALL}died with <Signals.SIGTERM: 15>.", OWN, [STOPPED], None),
        (CALL + SLURM.format("CANCELLED"), OWN, [12, "CANCELLED"], None),
        (CALL + SLURM.format("FAILED"), OWN, [OWN.text], 2),
        # it began, and left no message
        (f"{CALL}returned 1", None, [OUT_OF_MEMORY], 137),
        ("MissingOutputException: x.csv", None, ["x.csv"], None),
    ],
)
def test_the_cause_of_a_failure_is_shown_and_kept(run, message, own, facts, code):
    log = run.begin("measure")
    log.with_suffix(".jsonl").touch()
    if own:
        write_message(log, own)
    run.fail("measure", log, message)
    failed = run.lines[-2]
    assert failed == Facts("measure a:", *facts)
    assert (OWN.text in failed) == (OWN.text in facts)
    # who reads the messages later finds it, too
    last = read_messages(log)[-1]
    assert failed.endswith(last.text)
    assert (last.level, last.exit_code) == ("error", code)


def test_a_failure_without_a_message_names_the_log_and_shows_nothing_earlier(run):
    write_message(run.folder / "measure1.log", Message("warning", "thin cortex"))
    write_message(run.folder / "measure1.log", OWN)
    log = run.begin("measure")
    run.fail("measure", log, f"{CALL}returned 1")
    run.display.end()
    said = "\n".join(run.lines)
    assert said == Facts("measure a:", run.details)
    assert not re.search("thin|no image|python", said)


def test_many_equal_warnings_and_failures_are_three_lines_each_and_a_number(run):
    for number in range(5):
        log = run.begin("pial", f"sub-{number:03}", number)
        text = f"/a/{number}.nii: voxels of {number} mm"
        write_message(log, Message("warning", text))
        write_message(log, Message("error", f"/a/{number}.nii: is empty"))
        run.fail("pial", log, number=number)
    run.display.end()
    assert sum(line.startswith("warning ") for line in run.lines) == 3
    assert sum(line.startswith("failed ") for line in run.lines) == 3
    assert Facts("2 more", "voxels of 0 mm") in run.lines
    assert Facts("2 more", "is empty") in run.lines
    assert run.display.n_failed == 5


def test_a_run_until_a_stage_says_when_it_is_done(run):
    run.plan(measure=3)
    run.begin("measure")
    run.end(done=1, total=3)
    run.display.end()
    assert run.lines[-1] == Facts("gyriflow: done in 5 s", "1 of 3 steps")


def test_what_was_stopped_is_no_failure(run, monkeypatch):
    run.plan(simulate=2)
    log = run.begin("simulate")
    monkeypatch.setattr(terminal, "received_signals", [signal.SIGINT])
    run.fail("simulate", log)
    run.display.end()
    assert run.lines[-1] == Facts("gyriflow:", "5 s", 0, 2)
    assert run.state["interrupted"]
    assert run.display.n_failed == 0


def test_an_error_of_no_job_is_reported(run):
    run.plan(measure=1)
    run.tell("error", text="WorkflowError: no such profile", level=logging.ERROR)
    run.display.end()
    assert run.lines[1:] == ["WorkflowError: no such profile"]


RUNNING = {
    "began": "2026-01-01 10:00:00",
    "ended": None,
    "done": 3,
    "total": 12,
    "left_s": 240.0,
    "running": ["folding, run r, brain a: GW 21.50 of 23"],
    "details": "run.log",
    "interrupted": False,
}


@pytest.fixture
def study(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_json(tmp_path / STATE, RUNNING)
    return touched(tmp_path, "results/brains/a/surface/pial.surf.gii")


def text(folder):
    return "\n".join(status(folder))


def test_a_run_is_live_while_it_holds_its_lock_and_was_interrupted_else(study):
    with hold_lock(study):
        live = text(study)
    assert live == Facts("2026-01-01 10:00:00", 3, 12, "4 min", *RUNNING["running"])
    killed = text(study)
    assert killed == Facts("2026-01-01 10:00:00", 3, 12)
    assert killed != Facts(*RUNNING["running"])
    ended = {"ended": "2026-01-01 10:05:00", "interrupted": True}
    write_json(study / STATE, RUNNING | ended)
    assert text(study) == Facts("2026-01-01 10:05:00", 3, 12)
    assert text(study) != Facts("2026-01-01 10:00:00")


def test_failed_steps_are_listed_with_their_logs_but_not_interrupted_ones(study):
    for brain, text, code in (("a", "x: is empty", 2), ("b", STOPPED, 130)):
        log = Path("results", "brains", brain, "logs", "pial.log")
        log.parent.mkdir(parents=True)
        write_message(log, Message("warning", "thin"))
        write_message(log, Message("error", text, exit_code=code))
    # of an earlier run
    old = Path("results", "brains", "b", "logs", "measure.log")
    write_message(old, Message("error", "of old"))
    os.utime(old.with_suffix(".jsonl"), (0, 0))
    lines = [line for line in "\n".join(status(study)).splitlines() if "  " in line]
    assert lines[:2] == [
        Facts("failed:", "pial a", "x: is empty"),
        Facts(study / "results" / "brains" / "a" / "logs" / "pial.log"),
    ]
    assert not [line for line in lines if STOPPED in line or "of old" in line]


def test_stages_of_brains_and_runs_are_known_by_their_files(tmp_path):
    shape = {"id": "a", "week": 21, "shape": {"semi_axes_mm": [20, 20, 20]}}
    raw = {"brains": [shape], "start": "a", "folding": {"end_week": 22}}
    # a run of the plan is listed before it starts
    write_plan(resolve(load(raw | {"runs": {"x": {}}})), tmp_path / "results" / "plan")
    results = touched(
        tmp_path / "results",
        "brains/a/surface/pial.surf.gii",
        "brains/a/metrics/metrics.csv",
        "brains/b/mesh/brain.xdmf",
        *(f"runs/r/a/surfaces/week-{week}/pial.surf.gii" for week in (21, 22, 23)),
        *(f"runs/r/a/metrics/week-{week}/metrics.csv" for week in (21, 22)),
        "runs/r/a/figures/x.png",
        "runs/r/b/logs/x",
    )
    log = results / "runs/r/b/logs/simulate.log"
    write_event(log, SIZE)
    write_event(log, STEP)
    summary = {"weeks": [21.0, 22.0, 23.0]}
    write_json(results / "runs/r/a/folding/summary.json", summary)
    assert [line.split() for line in text(tmp_path).splitlines() if line] == [
        ["nothing", "is", "running"],
        ["brain", "surface", "mesh", "metrics"],
        ["a", "done", "-", "done"],
        ["b", "-", "done", "-"],
        ["run", "brain", "folding", "surfaces", "metrics", "figures"],
        ["x", "a", "-", "-", "-", "-"],
        ["r", "a", "done,", "GW", "23.00", "3", "2", "1"],
        ["r", "b", "GW", "21.50", "of", "23", "-", "-", "-"],
    ]


@pytest.mark.parametrize("content", ["", "run,brain\nx,a"])
def test_a_damaged_plan_is_left_out(tmp_path, content):
    (tmp_path / "results" / "plan").mkdir(parents=True)
    (tmp_path / "results" / "plan" / "simulations.csv").write_text(content)
    assert text(tmp_path) == "nothing is running"


def test_a_folder_without_a_study_is_named(tmp_path):
    with pytest.raises(InputError, check=Facts(f"{tmp_path}:", "gyriflow.yaml")):
        text(tmp_path)


def configured(*ids, **changes):
    brains = [{"id": name, "week": 21, **LABELLED, **changes} for name in ids]
    return load({"brains": brains, "start": ids[0], "folding": {"end_week": 30}})


@pytest.fixture
def made(tmp_path):
    """A folder with results of a study of brains a and b."""
    configuration = [tmp_path / "one.yaml"]
    check_results_belong_to(tmp_path, configuration, configured("a", "b"), record=True)
    (tmp_path / "results" / "brains" / "a").mkdir(parents=True)
    return tmp_path


# a brain of the same name may be another one
@pytest.mark.parametrize("other", [configured("c"), configured("a", week=25)])
def test_another_study_is_refused_with_what_to_do(made, other):
    one, two = made / "one.yaml", made / "two.yaml"
    facts = Facts(made / "results", "a", one, other.start, two, "--directory")
    with pytest.raises(InputError, check=facts):
        check_results_belong_to(made, [two], other, record=True)


@pytest.mark.parametrize(
    ("file", "ids"),
    [("one.yaml", ["c"]), ("two.yaml", ["b", "c"])],
    ids=["the same file, changed", "a copy of it, changed"],
)
def test_a_study_that_was_changed_goes_on(made, file, ids):
    check_results_belong_to(made, [made / file], configured(*ids), record=True)
    # whose they are now
    check_results_belong_to(made, [made / file], configured(*ids), record=False)


def test_renamed_data_with_a_renamed_configuration_are_the_same_study(tmp_path):
    old, new = tmp_path / "old.nii.gz", tmp_path / "new.nii.gz"
    old.write_text("one")
    config = configured("old", labels=str(old))
    check_results_belong_to(tmp_path, [tmp_path / "old.yaml"], config, record=True)
    input_contents(tmp_path, config, {}, record=True)
    (tmp_path / "results" / "brains" / "old").mkdir(parents=True)
    old.rename(new)
    config = configured("new", labels=str(new))
    check_results_belong_to(tmp_path, [tmp_path / "new.yaml"], config, record=False)
    new.write_text("another")
    with pytest.raises(InputError, check=Facts("old", "new")):
        check_results_belong_to(tmp_path, [tmp_path / "new.yaml"], config, record=False)


def test_deleted_results_belong_to_no_study(made):
    (made / "results" / "brains" / "a").rmdir()
    check_results_belong_to(made, [made / "two.yaml"], configured("c"), record=True)
