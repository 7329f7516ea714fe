"""Messages of steps are data, with the brain and run of their log."""

import os
from pathlib import Path

import pytest

from gyriflow.errors import GyriflowError, SolverError
from gyriflow.messages import (
    Message,
    error_message,
    messages_file,
    read_events,
    read_messages,
    study_messages,
    write_message,
)


@pytest.fixture
def study(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(log, *messages):
    Path(log).parent.mkdir(parents=True, exist_ok=True)
    for message in messages:
        write_message(log, message)


def test_messages_are_distinct_and_apart_from_progress(study):
    path = messages_file("x.log")
    write("x.log", Message("warning", "µ\n\u2028 \udcff"), Message("warning", "two"))
    write("x.log", Message("warning", "two"))
    with path.open("a") as file:
        file.write('{"event": "step", "week": 21.5}\n')
        file.write('{"level": "warning", "text": "three", "of_later_versions": 1}\n')
        file.write('{"level": "warning", "text": "four"}\n')
        # a full disk
        file.write('{"level": "warn')
    texts = [message.text for message in read_messages("x.log")]
    assert texts == ["µ\n\u2028 \udcff", "two", "four"]
    assert read_messages("x.log")[0].first_line == "µ"
    assert {"event": "step", "week": 21.5} in read_events("x.log")
    assert read_messages("none.log") == read_events("none.log") == []


def test_messages_of_a_study_come_in_the_order_of_their_times(study):
    error = Message("error", "holes", exit_code=3)
    times_s = {
        "brains/b/logs/one": 20.0,
        "brains/a/logs/two": 30.0,
        "runs/r/a/logs/x": 9.0,
    }
    for name, time_s in times_s.items():
        log = f"results/{name}.log"
        write(log, error)
        os.utime(messages_file(log), (time_s, time_s))
    later = study_messages(study, 10.0)
    assert [(row.brain, row.step) for row in later] == [("b", "one"), ("a", "two")]
    assert {row.exit_code for row in later} == {3}
    assert [row.run for row in study_messages(study)] == ["r", "", ""]


def test_the_message_of_an_error_has_what_the_error_knows():
    error = SolverError(
        "does not converge", path=Path("a.xdmf"), found=3, expected="2", remedy="Wait."
    )
    assert error_message(error) == Message(
        "error",
        str(error),
        file="a.xdmf",
        found="3",
        expected="2",
        remedy="Wait.",
        exit_code=4,
    )
    assert error_message(GyriflowError("is odd")).file == ""
