"""A step ends in the exit code of its error, with one message on the terminal, in its
log and as data."""

import logging
import resource
import runpy
import sys
from types import SimpleNamespace

import pytest
from facts import Facts

from gyriflow import step as step_module
from gyriflow.errors import MeshError
from gyriflow.messages import (
    STOPPED,
    Message,
    read_events,
    read_messages,
    write_message,
)
from gyriflow.step import OUT_OF_MEMORY_MESSAGE, step

HOLE = {"path": "x.gii", "found": "12 mm", "expected": "at most 3 mm"}


@pytest.mark.parametrize(
    ("error", "code", "expected", "file"),
    [
        (
            MeshError("has a hole", **HOLE),
            3,
            Facts("x.gii: has a hole", "12 mm", "at most 3 mm"),
            "x.gii",
        ),
        # one that names no file is given the inputs
        (MeshError("is odd"), 3, "a.gii, b.gii: is odd", "a.gii, b.gii"),
        (
            MemoryError("Unable to allocate 9.1 GiB"),
            137,
            Facts("a.gii, b.gii:", "Unable to allocate 9.1 GiB"),
            "a.gii, b.gii",
        ),
        (ZeroDivisionError("by zero"), 1, Facts("ZeroDivisionError: by zero"), ""),
        (KeyboardInterrupt(), 130, STOPPED, ""),
    ],
)
def test_an_error_is_one_message_and_its_code(
    tmp_path, capsys, error, code, expected, file
):
    def close_holes():
        logging.getLogger("room").info("a hole was closed")
        raise error

    log = tmp_path / "pial.log"
    with pytest.raises(SystemExit) as end, step(str(log), "a.gii", "b.gii"):
        close_holes()
    assert end.value.code == code
    # and no time and memory
    assert len(read_events(log)) == 1
    (message,) = read_messages(log)
    assert expected == message.text
    assert message == Message(
        "error",
        message.text,
        step="pial",
        file=file,
        found=getattr(error, "facts", {}).get("found", ""),
        expected=getattr(error, "facts", {}).get("expected", ""),
        exit_code=code,
    )
    assert capsys.readouterr().err == f"gyriflow: {message.text}\n"
    assert log.read_text() == Facts("a hole was closed", message.text)
    # of an unexpected one
    assert ("Traceback" in log.read_text()) == (code == 1)


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


@pytest.fixture
def end_shell_step(monkeypatch):
    """Return the exit code of the program that ends a shell step."""

    def ended(code, log):
        monkeypatch.delitem(sys.modules, "gyriflow.step", raising=False)
        monkeypatch.setattr(sys, "argv", ["step", str(code), str(log)])
        with pytest.raises(SystemExit) as end:
            runpy.run_module("gyriflow.step", run_name="__main__")
        return end.value.code

    return ended


@pytest.mark.parametrize(
    ("code", "printed", "ended", "expected"),
    [
        (7, "x", 5, Facts("/dev/shm")),
        (9, "EXIT STRING: Killed", 137, OUT_OF_MEMORY_MESSAGE.text),
        (137, "before", 137, OUT_OF_MEMORY_MESSAGE.text),
        (130, "step 3", 130, STOPPED),
        (255, "mpiexec: one\n\ntwo\n", 255, "mpiexec: one\ntwo"),
        (127, "", 127, Facts(127)),
    ],
)
def test_a_program_without_a_message_is_given_one(
    tmp_path, end_shell_step, code, printed, ended, expected
):
    log = tmp_path / "simulate.log"
    log.write_text(printed)
    assert end_shell_step(code, log) == ended
    (message,) = read_messages(log)
    assert expected == message.text
    assert message == Message("error", message.text, "simulate", exit_code=ended)
    assert log.read_text().startswith(printed)


def test_the_message_of_a_program_itself_is_kept(tmp_path, end_shell_step):
    log = tmp_path / "simulate.log"
    log.write_text("gyriflow: no step left\nbad termination\n")
    write_message(log, Message("warning", "coarse"))
    write_message(log, Message("error", "no step left", exit_code=4))
    assert end_shell_step(4, log) == 4
    assert [message.text for message in read_messages(log)] == [
        "coarse",
        "no step left",
    ]


def test_a_step_records_the_processor_time_of_itself_and_its_children_next_to_its_log(
    tmp_path, monkeypatch
):
    own = SimpleNamespace(ru_utime=2.0, ru_stime=0.5, ru_maxrss=2**20)
    below = SimpleNamespace(ru_utime=10.0, ru_stime=0.25, ru_maxrss=3 * 2**20)
    counted = {resource.RUSAGE_SELF: own, resource.RUSAGE_CHILDREN: below}
    monkeypatch.setattr(resource, "getrusage", counted.get)
    monkeypatch.setattr(step_module.sys, "platform", "linux")
    with step(str(tmp_path / "one.log")):
        pass
    (row,) = read_events(tmp_path / "one.log")
    assert row["wall_s"] > 0.0
    del row["wall_s"]
    assert row == {"event": "usage", "cpu_s": 12.75, "memory_MiB": 3072}
