"""What a run tells by Snakemake's records, on a terminal and in a file; how far a study
is, and whose results."""

import io
import logging
import os
import signal
from pathlib import Path

import pytest
from configurations import LABELLED, touched
from facts import Facts

from gyriflow.errors import InputError
from gyriflow.io.files import read_json, write_json
from gyriflow.messages import OUT_OF_MEMORY, Message, read_messages, write_message
from gyriflow.running import terminal
from gyriflow.running.launch import hold_lock
from gyriflow.running.provenance import check_results_belong_to, input_contents
from gyriflow.running.status import STATE, status
from gyriflow.running.terminal import RunDisplay
from gyriflow.study import resolve
from gyriflow.study.loading import load
from gyriflow.study.study import write_plan

STEP = '{{"event": "step", "week": {week}, "end_week": 23, "left_s": {left}}}\n'


class Run:
    """A run that Snakemake tells of, and what its display has written."""

    def __init__(self, folder, stream):
        self.now = 0.0
        self.folder = folder
        self.display = RunDisplay(
            stream, folder / ".snakemake" / "log" / "x.log", lambda: self.now
        )

    def tell(self, event=None, text="", level=logging.INFO, **said):
        record = logging.LogRecord("snakemake", level, "", 0, text, (), None)
        vars(record).update(said | {"event": event})
        self.display.show(record)

    def begin(self, rule, number=1, **wildcards):
        log = self.folder / f"{rule}{number}.log"
        self.tell(
            "job_info",
            jobid=number,
            rule_name=rule,
            wildcards=wildcards,
            output=["x"],
            log=[str(log)],
        )
        return log

    def end(self, number=1, done=1, total=1):
        self.tell("job_finished", job_id=number)
        self.tell("progress", done=done, total=total)

    def fail(self, rule, message="", log=(), number=1):
        self.tell("job_error", jobid=number, rule_name=rule, log=log, rule_msg=message)

    @property
    def lines(self):
        return self.display.console.file.getvalue().splitlines()

    @property
    def state(self):
        return read_json(self.folder / STATE)


@pytest.fixture
def run(tmp_path):
    (tmp_path / ".snakemake").mkdir()
    return Run(tmp_path, io.StringIO())


def test_a_quiet_log_has_a_line_each_few_percent_and_the_end(run):
    run.tell("run_info", stats={"measure": 100, "total": 100})
    for number in range(100):
        run.begin("measure", number, brain=f"b{number}")
        run.display.tick()
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
    assert (run.state["done"], run.state["total"], run.state["running"]) == (
        100,
        100,
        [],
    )


def test_surfaces_and_metrics_count_more_than_tables(run):
    stats = {"pial_with_thickness": 1, "measure": 1, "metrics_tables": 2}
    run.tell("run_info", stats=stats | {"total": 4})
    for number, rule in enumerate(("pial_with_thickness", "measure")):
        run.begin(rule, number, brain="a")
        run.display.tick()
        run.end(number, number + 1, 4)
    run.begin("metrics_tables", 2)
    run.display.tick()
    assert [line.split("%")[0].strip() for line in run.lines[1:]] == ["0", "40", "80"]


def test_a_folding_tells_its_size_weeks_and_warnings(run):
    run.tell("run_info", stats={"simulate": 1})
    log = run.begin("simulate", run="r", brain="a")
    size = (
        '{"event": "size", "elements": 12, "unknowns": 9, "ranks": 1,'
        ' "memory_mib": 70}\n'
    )
    log.with_suffix(".jsonl").write_text(size + STEP.format(week=21.5, left=75.0))
    write_message(log, Message("warning", "coarse"))
    run.now = 25.0
    run.display.tick()
    run.end()
    assert run.lines[1:] == [
        Facts("simulate r a:", 12, 1, "70 MiB"),
        Facts("simulate r a: coarse"),
        # a quarter of its time has passed
        Facts("25 %", "simulate r a:", "GW", 21.5, 23),
    ]
    assert run.state["running"] == [Facts("simulate r a:", "GW", 21.5, 23)]


def test_a_failure_begins_with_its_cause_after_the_warnings(run):
    run.tell("run_info", stats={"pial_from_labels": 1, "simulate": 1})
    log = run.begin("pial_from_labels", brain="a")
    write_message(log, Message("warning", "thin cortex"))
    write_message(log, Message("error", "a.nii: is no image"))
    run.fail("pial_from_labels", log=[str(log)])
    run.tell(
        text="Exiting because a job execution failed. Look below", level=logging.ERROR
    )
    run.display.end()
    assert run.lines[1:] == [
        Facts("pial_from_labels a: thin cortex"),
        Facts("pial_from_labels a: a.nii: is no image"),
        Facts(log),
        Facts("gyriflow:", "5 s", 1, 0, 2),
    ]


@pytest.mark.parametrize(
    ("message", "facts", "code"),
    [
        ("died with <Signals.SIGKILL: 9>.", [OUT_OF_MEMORY], 137),
        ("died with <Signals.SIGSEGV: 11>.", ["SIGSEGV"], None),
        ("died with <Signals.SIGTERM: 15>.", [], None),
        # as snakemake-executor-plugin-slurm 2.8 puts it
        (
            "SLURM-job '12' failed, SLURM status is: 'CANCELLED'. Reason: x",
            [12, "CANCELLED"],
            None,
        ),
        (
            "SLURM-job '12' failed, SLURM status is: 'FAILED'. Reason: x",
            ["a.nii: is no image"],
            2,
        ),
    ],
)
def test_what_has_ended_a_program_from_outside_is_reported(run, message, facts, code):
    log = run.begin("measure", brain="a")
    write_message(log, Message("error", "a.nii: is no image", exit_code=2))
    run.fail(
        "measure", f"CalledProcessError in file x:\n'python x.py' {message}", [str(log)]
    )
    assert run.lines[0] == Facts("measure a:", *facts)
    assert ("a.nii" in run.lines[0]) == ("'FAILED'" in message)
    # who reads the messages later finds it, too
    last = read_messages(log)[-1]
    assert run.lines[0].endswith(last.text)
    assert (last.level, last.exit_code) == ("error", code)


def test_messages_of_an_earlier_try_are_not_shown(run):
    log = run.folder / "measure1.log"
    write_message(log, Message("warning", "thin cortex"))
    write_message(log, Message("error", "a.nii: is no image"))
    run.begin("measure", brain="a")
    run.display.tick()
    run.fail("measure", "CalledProcessError in file x", [str(log)])
    run.display.end()
    assert run.lines[1] == Facts("measure a:", run.display.details)
    assert "thin" not in "".join(run.lines)


def test_a_step_that_began_and_left_no_message_was_killed(run):
    log = run.begin("measure", brain="a")
    log.with_suffix(".jsonl").touch()
    run.fail("measure", "CalledProcessError in file x", [str(log)])
    assert run.lines[0] == Facts("measure a:", OUT_OF_MEMORY)
    assert read_messages(log)[0].exit_code == 137


def test_what_snakemake_says_of_a_failed_job_is_its_message(run):
    log = run.begin("measure", brain="a")
    log.with_suffix(".jsonl").touch()
    run.fail("measure", "MissingOutputException: x.csv", [str(log)])
    assert run.lines[0] == Facts("measure a:", "x.csv")
    assert run.lines[0] != Facts("memory")


def test_a_failed_step_without_a_message_names_its_log_and_not_the_shell_command(
    run,
):
    run.fail(
        "measure",
        "CalledProcessError in file x:\nCommand 'set -e; python x.py' returned 1",
        [str(run.folder / "measure1.log")],
    )
    assert run.lines[0] == Facts("measure", run.display.details)
    assert "python" not in run.lines[0]


def test_a_hundred_equal_warnings_and_failures_are_three_lines_each_and_a_number(
    run,
):
    for number in range(100):
        log = run.begin("pial", number, brain=f"sub-{number:03}")
        text = f"/a/{number}.nii: voxels of {number} mm"
        write_message(log, Message("warning", text))
        if number % 2:
            run.end(number)
        else:
            write_message(log, Message("error", f"/a/{number}.nii: is empty"))
            run.fail("pial", log=[str(log)], number=number)
    run.display.end()
    assert sum(line.startswith("warning ") for line in run.lines) == 3
    assert sum(line.startswith("failed ") for line in run.lines) == 3
    assert Facts("97 more", "voxels of 0 mm") in run.lines
    assert Facts("47 more", "is empty") in run.lines
    assert run.display.n_failed == 50


def test_a_run_until_a_stage_says_when_it_is_done(run):
    run.tell("run_info", stats={"measure": 3})
    run.begin("measure")
    run.end(done=1, total=3)
    run.display.end()
    assert run.lines[-1] == Facts("gyriflow: done in 5 s", "1 of 3 steps")


def test_what_was_stopped_is_no_failure(run, monkeypatch):
    run.tell("run_info", stats={"simulate": 2})
    run.begin("simulate", run="r", brain="a")
    monkeypatch.setattr(terminal, "received_signals", [signal.SIGINT])
    run.fail("simulate")
    run.display.end()
    assert run.lines[-1] == Facts("gyriflow:", "5 s", 0, 2)
    assert run.state["interrupted"]
    assert run.display.n_failed == 0


def test_an_error_of_no_job_is_reported(run):
    run.tell("run_info", stats={"measure": 1})
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
def study(tmp_path):
    for name in (
        "brains/a/surface/pial.surf.gii",
        "brains/b/logs/x",
        "runs/r/a/logs/simulate.log",
    ):
        (tmp_path / "results" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "results" / name).touch()
    write_json(tmp_path / STATE, RUNNING)
    return tmp_path


def text(folder):
    return "\n".join(status(folder))


def test_a_live_run_tells_what_it_is_at_and_the_time_left(study):
    with hold_lock(study):
        said = text(study)
    assert said == Facts("2026-01-01 10:00:00", 3, 12, "4 min", *RUNNING["running"])


def test_a_run_that_was_killed_is_called_interrupted(study):
    said = text(study)
    assert said == Facts("2026-01-01 10:00:00", 3, 12)
    assert said != Facts(*RUNNING["running"])
    write_json(
        study / STATE, RUNNING | {"ended": "2026-01-01 10:05:00", "interrupted": True}
    )
    assert (
        text(study)
        == Facts("2026-01-01 10:05:00", 3, 12)
        != Facts("2026-01-01 10:00:00")
    )


def test_failed_steps_are_listed_with_their_logs_but_not_interrupted_ones(
    study, monkeypatch
):
    monkeypatch.chdir(study)
    for brain, text, code in (("a", "x: is empty", 2), ("b", "it was stopped", 130)):
        log = Path("results", "brains", brain, "logs", "pial.log")
        log.parent.mkdir(parents=True, exist_ok=True)
        write_message(log, Message("warning", "thin"))
        write_message(log, Message("error", text, exit_code=code))
    # of an earlier run
    old = study / "results" / "brains" / "b" / "logs" / "measure.jsonl"
    old.write_text('{"level": "error", "text": "of old"}\n')
    os.utime(old, (0, 0))
    lines = [line for line in "\n".join(status(study)).splitlines() if "  " in line]
    assert lines[:2] == [
        Facts("failed:", "pial a", "x: is empty"),
        Facts(study / "results" / "brains" / "a" / "logs" / "pial.log"),
    ]
    assert not [line for line in lines if "stopped" in line or "of old" in line]


def test_stages_of_brains_and_runs_are_known_by_their_files(study):
    assert ["b", "-", "-", "-"] in [line.split() for line in text(study).splitlines()]
    progress = study / "results/runs/r/a/logs/simulate.jsonl"
    progress.write_text(
        '{"event": "size"}\n'
        '{"event": "step", "week": 21.5, "end_week": 23.0, "left_s": 142.0}\n'
    )
    assert Facts("r", "a", "GW 21.50", 23) in text(study).splitlines()
    write_json(
        study / "results/runs/r/a/folding/summary.json", {"weeks": [21.0, 22.0, 23.0]}
    )
    assert Facts("r", "a", "GW 23.00") in text(study).splitlines()
    assert "report.html" not in text(study)


def test_what_is_done_of_each_brain_and_run_is_counted(tmp_path):
    touched(
        tmp_path / "results" / "brains" / "a",
        "surface/pial.surf.gii",
        "metrics/metrics.csv",
    )
    touched(
        tmp_path / "results" / "brains" / "b",
        "surface/pial.surf.gii",
        "mesh/brain.xdmf",
    )
    run = tmp_path / "results" / "runs" / "r" / "a"
    touched(
        run,
        *(f"surfaces/week-{week}/pial.surf.gii" for week in (21, 22, 23)),
        "figures/x.png",
    )
    touched(run, *(f"metrics/week-{week}/metrics.csv" for week in (21, 22)))
    rows = [line.split() for line in text(tmp_path).splitlines() if line]
    assert rows == [
        ["nothing", "is", "running"],
        ["brain", "surface", "mesh", "metrics"],
        ["a", "done", "-", "done"],
        ["b", "done", "done", "-"],
        ["run", "brain", "folding", "surfaces", "metrics", "figures"],
        ["r", "a", "-", "3", "2", "1"],
    ]


@pytest.mark.parametrize("content", ["", "run,brain", "run,brain\nx,a"])
def test_a_damaged_plan_is_left_out(tmp_path, content):
    (tmp_path / "results" / "plan").mkdir(parents=True)
    (tmp_path / "results" / "plan" / "simulations.csv").write_text(content)
    assert text(tmp_path) == "nothing is running"


def test_the_runs_of_the_plan_are_reported_before_they_start(tmp_path):
    shape = {"id": "a", "week": 21, "shape": {"semi_axes_mm": [20, 20, 20]}}
    raw = {"brains": [shape], "start": "a", "folding": {"end_week": 22}}
    raw["runs"] = {"x": {}, "y": {"ranks": 1}}
    write_plan(resolve(load(raw)), tmp_path / "results" / "plan")
    rows = [line.split() for line in text(tmp_path).splitlines()[-2:]]
    assert rows == [[run, "a", "-", "-", "-", "-"] for run in "xy"]


def test_a_folder_without_a_study_is_named(tmp_path):
    with pytest.raises(InputError, check=Facts(f"{tmp_path}:", "gyriflow.yaml")):
        text(tmp_path)


def configured(*ids, week=21):
    brains = [{"id": name, "week": week, **LABELLED} for name in ids]
    return load({"brains": brains, "start": ids[0], "folding": {"end_week": 30}})


@pytest.fixture
def made(tmp_path):
    """A folder with results of a study of brains a and b."""
    check_results_belong_to(
        tmp_path, [tmp_path / "one.yaml"], configured("a", "b"), record=True
    )
    (tmp_path / "results" / "brains" / "a").mkdir(parents=True)
    return tmp_path


def test_another_study_is_refused_with_what_to_do(made):
    with pytest.raises(
        InputError,
        check=Facts(
            made / "results",
            "a",
            made / "one.yaml",
            "c",
            made / "two.yaml",
            "--directory",
        ),
    ):
        check_results_belong_to(made, [made / "two.yaml"], configured("c"), record=True)
    # a brain of the same name may be another one
    with pytest.raises(InputError, check=Facts(made / "one.yaml", made / "two.yaml")):
        check_results_belong_to(
            made, [made / "two.yaml"], configured("a", week=25), record=False
        )


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
    def renamed(name):
        brain = {"id": name, "week": 21, "labels": f"{name}.nii.gz", "scheme": "binary"}
        return load(
            {"brains": [brain], "start": name, "folding": {"end_week": 30}}, tmp_path
        )

    (tmp_path / "old.nii.gz").write_text("one")
    config = renamed("old")
    check_results_belong_to(tmp_path, [tmp_path / "old.yaml"], config, record=True)
    input_contents(tmp_path, config, {}, record=True)
    (tmp_path / "results" / "brains" / "old").mkdir(parents=True)
    (tmp_path / "old.nii.gz").rename(tmp_path / "new.nii.gz")
    config = renamed("new")
    check_results_belong_to(tmp_path, [tmp_path / "new.yaml"], config, record=False)
    (tmp_path / "new.nii.gz").write_text("another")
    with pytest.raises(InputError, check=Facts("old", "new")):
        check_results_belong_to(tmp_path, [tmp_path / "new.yaml"], config, record=False)


def test_deleted_results_belong_to_no_study(made):
    (made / "results" / "brains" / "a").rmdir()
    check_results_belong_to(made, [made / "two.yaml"], configured("c"), record=True)
