"""What `./run snakemake` does around Snakemake, locks and exit codes, and the commands
of gyriflow."""

import errno
import getpass
import os
import pwd
import signal
import threading
from types import SimpleNamespace

import pytest
from configurations import touched
from facts import Facts
from mpi4py import MPI
from snakemake import cli

from gyriflow.errors import InputError, StorageError
from gyriflow.folding.__main__ import locked as locked_simulation
from gyriflow.folding.compilation import form_compiler
from gyriflow.io import locks
from gyriflow.running import launch
from gyriflow.running.launch import hold_lock, locked, main
from gyriflow.running.planning import Events

from .conftest import SHAPES, launching


def test_files_and_tables_are_beside_the_configuration_that_replaces_the_demo(workflow):
    # the working directory has a cohort of its own
    for name in ("mine", "elsewhere"):
        folder = touched(workflow.directory / name, "labels.nii.gz")
        table = f"participant_id\tweek\tlabels\n{name}\t24\tlabels.nii.gz\n"
        (folder / "participants.tsv").write_text(table)
    table = {"file": "participants.tsv", "columns": {"scheme": "binary"}}
    study = {"participants": table, "start": "all", "folding": {"end_week": 26}}
    name = workflow.write("mine/study.yaml", study)
    plan = workflow.plan("surface", "--configfile", name, "--directory", "elsewhere")
    (job,) = [job for job in plan.jobs if job.rule.startswith("pial")]
    assert job.wildcards["brain"] == "mine"
    assert str(workflow.directory / "mine" / "labels.nii.gz") in job.files


def test_a_user_whom_the_system_does_not_know_has_a_name(monkeypatch):
    for variable in ("LOGNAME", "USER", "LNAME", "USERNAME"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", {}.__getitem__)
    launch._set_user_name()
    assert getpass.getuser() == f"user-{os.getuid()}"
    monkeypatch.setenv("LOGNAME", "ana")
    launch._set_user_name()
    assert getpass.getuser() == "ana"


def test_a_signal_stops_jobs_and_timers_of_the_scheduler_end(tmp_path, monkeypatch):
    scheduler, stopped = threading.Timer(60, print), threading.Event()

    def schedule(_):
        scheduler.start()
        os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(launch, "received_signals", [])
    monkeypatch.setattr(launch, "_stop_jobs", stopped.set)
    monkeypatch.setattr(cli, "main", schedule)
    with launching(tmp_path):
        assert launch._call_snakemake([], Events()) == 128 + signal.SIGTERM
    scheduler.join(20)
    assert not scheduler.is_alive()
    assert stopped.wait(20)


def stale(directory):
    lock = directory / ".snakemake" / "locks" / "0.output.lock"
    lock.parent.mkdir(parents=True)
    lock.write_text("results/brains/a/surface/pial.surf.gii\n")
    return lock


def test_a_stale_lock_is_cleared(tmp_path, capsys):
    lock = stale(tmp_path)
    with locked(tmp_path):
        assert not lock.exists()
        assert hold_lock(tmp_path) is None
        # a command locks the directory, and its run once more
        with locked(tmp_path):
            pass
        assert hold_lock(tmp_path) is None
    assert capsys.readouterr().err == Facts("gyriflow:", "lock")
    with hold_lock(tmp_path):
        pass


def test_a_run_is_locked_before_it_reads_the_rules_that_write_its_plan(
    tmp_path, monkeypatch
):
    seen = []
    monkeypatch.setattr(
        launch, "_plan_and_run", lambda _: seen.append(hold_lock(tmp_path)) or 0
    )
    with launching(tmp_path):
        assert main(["--cores", "1", "--directory", str(tmp_path)]) == 0
        assert main(["-n", "--directory", str(tmp_path)]) == 0
    first, dry = seen
    assert first is None
    # it only looks
    dry.close()


def test_a_second_pass_keeps_the_directory_locked_if_the_first_one_is_killed(
    tmp_path, monkeypatch
):
    def popen(*_, pass_fds, **__):
        handed_on.extend(map(os.dup, pass_fds))
        return SimpleNamespace(wait=lambda: 0)

    handed_on = []
    monkeypatch.setattr(launch.subprocess, "Popen", popen)
    with locked(tmp_path):
        assert launch._finish_without({"a": "cause"}, [], tmp_path) == 0
    assert hold_lock(tmp_path) is None
    for number in handed_on:
        os.close(number)
    hold_lock(tmp_path).close()


def test_a_run_beside_a_live_one_is_refused_with_5_and_leaves_its_lock_but_may_look(
    workflow, monkeypatch
):
    monkeypatch.setattr(launch, "LOCK_WAIT_S", 0.0)
    lock = stale(workflow.directory)
    with hold_lock(workflow.directory):
        with pytest.raises(StorageError) as refused:
            main(["--cores", "1", "surface", "--directory", str(workflow.directory)])
        assert refused.value.exit_code == 5
        assert str(refused.value) == Facts(workflow.directory, "--directory")
        assert lock.exists()
        assert workflow.jobs("surface")


def test_without_locks_of_files_a_run_goes_on_and_leaves_those_of_others(
    tmp_path, monkeypatch, capsys
):
    def no_locks(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(locks.fcntl, "flock", no_locks)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    locks.UNLOCKABLE.clear()
    lock = stale(tmp_path)
    with locked(tmp_path):
        assert lock.exists()
    with locked_simulation(tmp_path / "folding"), form_compiler(MPI.COMM_SELF):
        warned = capsys.readouterr().err
    assert warned == Facts(
        "gyriflow: warning:",
        tmp_path / ".snakemake" / "gyriflow.lock",
        "No locks available",
    )
    assert warned.count("\n") == 1


def test_a_working_directory_that_cannot_be_written_ends_in_5(tmp_path):
    (tmp_path / "file").touch()
    below = str(tmp_path / "file" / "below")
    with pytest.raises(StorageError) as refused:
        main(["--cores", "1", "surface", "--directory", below])
    assert refused.value.exit_code == 5
    assert str(refused.value) == Facts(f"{below}:", "Not a directory")


def test_the_first_line_says_what_runs_without_a_configuration_that_is_named(
    workflow, capsys
):
    (workflow.directory / "config").mkdir()
    name = workflow.write("config/config.yaml", {"brains": SHAPES})
    assert workflow.jobs("surface") == {"shape": 2, "pial": 2}
    said = capsys.readouterr().err.partition("\n")[0]
    assert said == Facts(workflow.directory / name)
    assert said != Facts("demo")


def test_results_that_are_a_link_to_nowhere_are_named(workflow, capfd):
    (workflow.directory / "results").symlink_to("disk/results")
    name = workflow.write("study.yaml", {"brains": SHAPES})
    code = workflow.call("--cores", "1", "surface", "--configfile", name)
    message = capfd.readouterr().err
    assert code == 5
    assert message.splitlines()[-1] == Facts("results is a link to disk/results")
    assert "disk space" not in message


def test_an_unknown_stage_is_refused_with_the_nearest_one(workflow):
    name = workflow.write("study.yaml", {"brains": SHAPES})
    with pytest.raises(InputError, check=Facts("metrcs", "metrics")):
        workflow.plan("metrcs", "--configfile", name)


def test_a_result_of_an_unknown_brain_is_refused_with_the_name_of_a_similar_one(
    workflow, capfd
):
    name = workflow.write("study.yaml", {"brains": SHAPES})
    metrics = "results/brains/b21x/metrics/metrics.csv"
    code = workflow.call("-n", metrics, "--configfile", name)
    assert code == InputError.exit_code
    said = capfd.readouterr().err
    assert said == Facts(metrics, "no brain b21x", "did you mean b21?")
    # which configuration runs is not said where it is named
    assert "--configfile" not in said
