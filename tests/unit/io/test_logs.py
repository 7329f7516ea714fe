"""Warnings and errors are read from the logs of all steps."""

import os

from gyriflow.io.logs import gather_messages, read_messages


def write(path, *lines):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")


def test_messages_of_steps_and_of_the_folding_are_told_apart(tmp_path):
    log = tmp_path / "a.log"
    write(
        log,
        "2026-11-22 00:53:59,004 INFO gyriflow.surface: fine",
        "2026-11-22 00:53:59,004 WARNING gyriflow.surface: it is crooked",
        "2026-11-22 00:53:59,004 WARNING gyriflow.surface: it is crooked",
        "2026-11-22 00:53:59,004 WARNING py.warnings: deprecated",
        "warning: few elements",
        "2026-11-22 00:54:00,004 ERROR root: a.nii: no brain",
        "gyriflow: the solver gave up",
    )
    assert read_messages(log) == [
        ("warning", "it is crooked"),
        ("warning", "few elements"),
        ("error", "a.nii: no brain"),
        ("error", "the solver gave up"),
    ]
    assert read_messages(tmp_path / "none.log") == []


def test_messages_are_gathered_by_brain_and_run(tmp_path):
    warned = "2026-11-22 00:53:59,004 WARNING gyriflow.x: {}"
    for place in (
        "brains/a/logs/pial_from_labels",
        "brains/old/logs/pial_from_labels",
        "brains/a/metrics/logs/measure",
        "runs/r/a/logs/simulate",
        "runs/r/a/metrics/week-22.00/logs/measure",
        "runs/old/a/logs/simulate",
        "study/logs/poses",
    ):
        write(tmp_path / "results" / f"{place}.log", warned.format(place))
    table = gather_messages(tmp_path, ["a"], [("r", "a")])
    assert set(table["message"]) == {
        "brains/a/logs/pial_from_labels",
        "brains/a/metrics/logs/measure",
        "runs/r/a/logs/simulate",
        "runs/r/a/metrics/week-22.00/logs/measure",
        "study/logs/poses",
    }
    row = table[table["message"] == "runs/r/a/metrics/week-22.00/logs/measure"].iloc[0]
    assert (row["subject"], row["run"], row["step"], row["level"]) == ("a", "r", "measure", "warning")
    os.utime(tmp_path / "results/brains/a/logs/pial_from_labels.log", (0, 0))
    later = gather_messages(tmp_path, ["a"], [], since_s=1.0)
    assert set(later["message"]) == {"brains/a/metrics/logs/measure", "study/logs/poses"}
