"""A step ends in the exit code of its error, with one message on the terminal, in its
log and as data."""

import logging
import resource
import sys
from types import SimpleNamespace
from unittest.mock import ANY

import pytest
from facts import Facts
from processes import ran

from gyriflow import step as step_module
from gyriflow.errors import MeshError
from gyriflow.messages import (
    STOPPED,
    Message,
    read_events,
    read_messages,
    write_message,
)
from gyriflow.step import OUT_OF_MEMORY_MESSAGE, end_shell_step, step


def test_a_known_error_is_one_message_and_its_code(tmp_path, capsys):
    log = tmp_path / "pial.log"

    def close_holes():
        logging.getLogger("room").info("a hole was closed")
        raise MeshError(
            "has a hole", path="x.gii", found="12 mm", expected="at most 3 mm"
        )

    with pytest.raises(SystemExit) as end, step(str(log)):
        close_holes()
    assert end.value.code == 3
    message = capsys.readouterr().err
    assert message == Facts("gyriflow: x.gii: has a hole", "12 mm", "at most 3 mm")
    text = log.read_text()
    assert text == Facts("a hole was closed", message.removeprefix("gyriflow: "))
    assert "Traceback" not in text
    assert read_messages(log) == [
        Message(
            "error",
            message.removeprefix("gyriflow: ").strip(),
            step="pial",
            file="x.gii",
            found="12 mm",
            expected="at most 3 mm",
            exit_code=3,
        )
    ]


def test_warnings_of_a_step_are_messages_and_replace_those_of_an_earlier_try(tmp_path):
    log = tmp_path / "pial.log"
    for text in ("it is crooked", "it is thin"):
        with step(str(log)):
            logging.getLogger("gyriflow.room").info("fine")
            logging.getLogger("gyriflow.room").warning("%s", text)
            logging.getLogger("library").warning("odd")
            # where Python logs warnings of libraries
            logging.getLogger("py.warnings").warning("deprecated")
    assert read_messages(log) == [Message("warning", "it is thin", step="pial")]
    assert log.read_text() == Facts("fine", "it is thin", "odd", "deprecated")


@pytest.mark.parametrize(
    ("path", "named"),
    [(None, "a.gii, b.gii: has a hole"), ("x.gii", "x.gii: has a hole")],
)
def test_an_error_that_names_no_file_is_given_the_inputs(tmp_path, capsys, path, named):
    log = tmp_path / "log"
    with pytest.raises(SystemExit), step(str(log), "a.gii", "b.gii"):
        raise MeshError("has a hole", path=path)
    assert capsys.readouterr().err == f"gyriflow: {named}\n"
    assert named in log.read_text()
    (message,) = read_messages(log)
    assert (message.text, message.file) == (named, named.partition(":")[0])


def test_an_unknown_error_keeps_its_traceback(tmp_path):
    log = tmp_path / "log"
    with pytest.raises(SystemExit) as end, step(str(log), "a.gii"):
        raise ZeroDivisionError("by zero")
    assert end.value.code == 1
    assert log.read_text() == Facts("Traceback", "ZeroDivisionError: by zero")
    (message,) = read_messages(log)
    assert message.text == Facts("ZeroDivisionError: by zero")
    assert message.text != Facts("Traceback")
    assert message.exit_code == 1


def test_memory_that_ran_out_is_said_with_the_input(tmp_path, capsys):
    with pytest.raises(SystemExit) as end, step(str(tmp_path / "log"), "a.nii"):
        raise MemoryError("Unable to allocate 9.1 GiB")
    assert end.value.code == read_messages(tmp_path / "log")[0].exit_code == 137
    assert capsys.readouterr().err == Facts(
        "gyriflow: a.nii:", "Unable to allocate 9.1 GiB"
    )


def test_a_step_that_is_interrupted_is_not_taken_for_a_killed_one(tmp_path):
    with pytest.raises(SystemExit) as end, step(str(tmp_path / "log"), "a.nii"):
        raise KeyboardInterrupt
    (message,) = read_messages(tmp_path / "log")
    assert end.value.code == message.exit_code == 130
    assert message.text == STOPPED


def test_a_killed_program_is_said_to_have_run_out_of_memory(tmp_path):
    log = tmp_path / "log"
    log.write_text("before\n")
    end = ran(sys.executable, "-m", "gyriflow.step", "137", str(log))
    assert end.returncode == 137
    assert log.read_text() == Facts("before", "gyriflow:", "memory")
    (message,) = read_messages(log)
    assert (message.text, message.exit_code) == (OUT_OF_MEMORY_MESSAGE.text, 137)


@pytest.mark.parametrize(
    ("code", "printed", "ended", "expected"),
    [
        (7, "x", 5, Facts("/dev/shm")),
        (9, "EXIT STRING: Killed", 137, OUT_OF_MEMORY_MESSAGE.text),
        (130, "step 3", 130, STOPPED),
        (255, "mpiexec: one\n\ntwo\n", 255, "mpiexec: one\ntwo"),
        (127, "", 127, Facts(127)),
    ],
)
def test_a_program_without_a_message_is_given_one(
    tmp_path, code, printed, ended, expected
):
    log = tmp_path / "simulate.log"
    log.write_text(printed)
    assert end_shell_step(code, str(log)) == ended
    assert read_messages(log) == [
        Message("error", ANY, step="simulate", exit_code=ended)
    ]
    assert read_messages(log)[0].text == expected


def test_the_message_of_a_program_itself_is_kept(tmp_path):
    log = tmp_path / "simulate.log"
    log.write_text("gyriflow: no step left\nbad termination\n")
    write_message(log, Message("warning", "coarse"))
    write_message(log, Message("error", "no step left", exit_code=4))
    assert end_shell_step(4, str(log)) == 4
    assert [message.text for message in read_messages(log)] == [
        "coarse",
        "no step left",
    ]


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
    (row,) = read_events(tmp_path / "a" / "logs" / "one.week-21.00.log")
    assert list(row) == ["event", "wall_s", "cpu_s", "memory_MiB"]
    assert [row["event"], row["cpu_s"], row["memory_MiB"]] == ["usage", 12.75, 3072]


def test_a_step_that_fails_records_no_time(tmp_path):
    (tmp_path / "logs").mkdir()
    with pytest.raises(SystemExit), step(str(tmp_path / "logs" / "one.log")):
        raise MeshError("has a hole")
    (row,) = read_events(tmp_path / "logs" / "one.log")
    assert row["level"] == "error"
