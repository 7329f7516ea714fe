"""A step ends in the exit code of its error, with one message on the terminal and in
its log."""

import logging
import resource
import sys
from types import SimpleNamespace

import pytest
from facts import Facts
from processes import ran

from gyriflow import step as step_module
from gyriflow.errors import MeshError
from gyriflow.step import EXIT_FILE, record_exit_code, recorded_exit_code, step


@pytest.fixture
def exit_file(tmp_path, monkeypatch):
    path = tmp_path / "exit"
    monkeypatch.setenv(EXIT_FILE, str(path))
    return path


def test_the_first_failure_is_the_one_handed_on(exit_file):
    assert recorded_exit_code(exit_file) is None
    record_exit_code(3)
    record_exit_code(5)
    assert recorded_exit_code(exit_file) == 3


def test_without_a_launcher_nothing_is_recorded(tmp_path, monkeypatch):
    monkeypatch.delenv(EXIT_FILE, raising=False)
    monkeypatch.chdir(tmp_path)
    record_exit_code(3)
    assert list(tmp_path.iterdir()) == []


def test_a_known_error_is_one_message_and_its_code(exit_file, tmp_path, capsys):
    log = tmp_path / "log"

    def close_holes():
        logging.getLogger("room").info("a hole was closed")
        raise MeshError(
            "has a hole", path="x.gii", found="12 mm", expected="at most 3 mm"
        )

    with pytest.raises(SystemExit) as end, step(str(log)):
        close_holes()
    assert end.value.code == 3
    assert recorded_exit_code(exit_file) == 3
    message = capsys.readouterr().err
    assert message == Facts("gyriflow: x.gii: has a hole", "12 mm", "at most 3 mm")
    text = log.read_text()
    assert text == Facts("a hole was closed", message.removeprefix("gyriflow: "))
    assert "Traceback" not in text


@pytest.mark.parametrize(
    ("path", "named"),
    [(None, "a.gii, b.gii: has a hole"), ("x.gii", "x.gii: has a hole")],
)
def test_an_error_that_names_no_file_is_given_the_inputs(
    exit_file, tmp_path, capsys, path, named
):
    with pytest.raises(SystemExit), step(str(tmp_path / "log"), "a.gii", "b.gii"):
        raise MeshError("has a hole", path=path)
    assert capsys.readouterr().err == f"gyriflow: {named}\n"
    assert named in (tmp_path / "log").read_text()


def test_an_unknown_error_keeps_its_traceback(exit_file, tmp_path):
    log = tmp_path / "log"
    with pytest.raises(SystemExit) as end, step(str(log)):
        raise ZeroDivisionError
    assert end.value.code == 1
    assert "ZeroDivisionError" in log.read_text()


def test_memory_that_ran_out_is_said_with_the_input(exit_file, tmp_path, capsys):
    with pytest.raises(SystemExit) as end, step(str(tmp_path / "log"), "a.nii"):
        raise MemoryError("Unable to allocate 9.1 GiB")
    assert (end.value.code, recorded_exit_code(exit_file)) == (137, 137)
    assert capsys.readouterr().err == Facts(
        "gyriflow: a.nii:", "Unable to allocate 9.1 GiB"
    )


def test_a_killed_program_is_said_to_have_run_out_of_memory(exit_file, tmp_path):
    log = tmp_path / "log"
    log.write_text("before\n")
    end = ran(sys.executable, "-m", "gyriflow.step", "137", str(log))
    assert end.returncode == 137
    assert end.stderr == Facts("gyriflow:", "memory")
    assert log.read_text() == f"before\n{end.stderr}"
    assert recorded_exit_code(exit_file) == 137


def test_a_step_records_the_processor_time_of_itself_and_its_children_next_to_its_log(
    tmp_path, monkeypatch
):
    counted = {
        resource.RUSAGE_SELF: SimpleNamespace(
            ru_utime=2.0, ru_stime=0.5, ru_maxrss=2**20
        ),
        resource.RUSAGE_CHILDREN: SimpleNamespace(
            ru_utime=10.0, ru_stime=0.25, ru_maxrss=3 * 2**20
        ),
    }
    monkeypatch.setattr(resource, "getrusage", counted.get)
    monkeypatch.setattr(step_module.sys, "platform", "linux")
    (tmp_path / "a" / "logs").mkdir(parents=True)
    with step(str(tmp_path / "a" / "logs" / "one.week-21.00.log")):
        pass
    head, row = (
        (tmp_path / "a" / "benchmarks" / "one.week-21.00.tsv").read_text().splitlines()
    )
    assert head.split("\t") == ["wall_s", "cpu_s", "memory_MiB"]
    assert [float(value) for value in row.split("\t")[1:]] == [12.75, 3072]


def test_a_step_that_fails_records_no_time(exit_file, tmp_path):
    (tmp_path / "logs").mkdir()
    with pytest.raises(SystemExit), step(str(tmp_path / "logs" / "one.log")):
        raise MeshError("has a hole")
    assert not (tmp_path / "benchmarks").exists()
