"""What jobs leave is read, messages and time and memory, and on which modules their
programs depend."""

from pathlib import Path

import pytest

from gyriflow import code_hash as sources
from gyriflow.code_hash import code_hash, modules_behind
from gyriflow.messages import Message, reported_messages, write_message
from gyriflow.step import USAGE_COLUMNS, Usage, read_usage, record_usage


def test_messages_are_gathered_by_brain_and_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for place in (
        "brains/a/logs/pial",
        "brains/old/logs/pial",
        "brains/a/metrics/logs/measure",
        "runs/r/a/logs/simulate",
        "runs/r/a/metrics/week-22.00/logs/measure",
        "runs/old/a/logs/simulate",
        "study/logs/poses",
        "study/logs/atlas_file/x/week21.nii.gz",
        # of the report before this one
        "report/logs/html_report",
    ):
        log = Path("results", f"{place}.log")
        log.parent.mkdir(parents=True, exist_ok=True)
        for _ in range(2):
            write_message(log, Message("warning", f"{place}\nmore of it"))
    found = [
        [message.brain, message.run, message.step, message.level, message.first_line]
        for message in reported_messages(tmp_path, ["a"], [["r", "a"]])
    ]
    assert found == [
        ["", "", "poses", "warning", "study/logs/poses"],
        ["", "", "week21.nii.gz", "warning", "study/logs/atlas_file/x/week21.nii.gz"],
        ["a", "", "measure", "warning", "brains/a/metrics/logs/measure"],
        ["a", "", "pial", "warning", "brains/a/logs/pial"],
        ["a", "r", "measure", "warning", "runs/r/a/metrics/week-22.00/logs/measure"],
        ["a", "r", "simulate", "warning", "runs/r/a/logs/simulate"],
    ]
    assert reported_messages(tmp_path / "empty", ["a"], []) == []


def record(folder, name, *used):
    """Have a step record what it has used, after a warning."""
    log = folder / "results" / f"{name}.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    write_message(log, Message("warning", "a warning"))
    if used:
        record_usage(log, Usage(*used))


def test_steps_that_have_ended_are_found_with_their_rules_brains_and_runs(tmp_path):
    record(tmp_path, "brains/a/logs/pial", 10.5, 9.75, 200.25)
    record(tmp_path, "brains/a/logs/targets.self", 11, 10, 210)
    record(tmp_path, "runs/two/a/logs/simulate", 100, 190, 1000)
    record(tmp_path, "runs/two/a/logs/measure_simulated.week-22.00", 3, 2, 1)
    record(tmp_path, "study/logs/atlas_file/x/week21.nii.gz", 1, 1, 1)
    # it has failed
    record(tmp_path, "study/logs/run_tables")
    names = ("rule", "run", "brain", *USAGE_COLUMNS)
    assert [[job[name] for name in names] for job in read_usage(tmp_path)] == [
        ["pial", "", "a", 10.5, 9.75, 200.25],
        ["targets", "", "a", 11.0, 10.0, 210.0],
        ["measure_simulated", "two", "a", 3.0, 2.0, 1.0],
        ["simulate", "two", "a", 100.0, 190.0, 1000.0],
        ["atlas_file", "", "", 1.0, 1.0, 1.0],
    ]


def test_half_a_line_that_a_full_disk_left_is_no_record(tmp_path):
    record(tmp_path, "brains/a/logs/pial", 10.5, 9.75, 200.25)
    path = tmp_path / "results" / "brains" / "a" / "logs" / "pial.jsonl"
    path.write_text(path.read_text()[:-5])
    assert read_usage(tmp_path) == []


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A small package of two rooms and a plain module, with a program beside it."""
    root = tmp_path / "src" / "gyriflow"
    contents = {
        "__init__.py": "",
        "units.py": "ML = 1",
        "surface/__init__.py": "",
        "surface/repair.py": "from ..units import ML",
        "surface/labels.py": "def read():\n    from .repair import ML",
        "mesh/__init__.py": "import numpy",
        "mesh/quality.py": "import gyriflow.units",
        "mesh/fill.py": (
            "from .. import (\n    surface,  # one\n    units as u,\n)\n"
            "import gyriflow.unused as o"
        ),
        "unused.py": "",
    }
    for name, text in contents.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    monkeypatch.setattr(sources, "PACKAGE", root)
    sources._files_of.cache_clear()
    yield root
    sources._files_of.cache_clear()


def test_modules_behind_a_program_are_followed_through_others(package, tmp_path):
    program = tmp_path / "measure.py"
    program.write_text("from gyriflow.surface.labels import read")
    names = {path.relative_to(package).as_posix() for path in modules_behind(program)}
    assert names == {
        "__init__.py",
        "surface/__init__.py",
        "surface/labels.py",
        "surface/repair.py",
        "units.py",
    }


def test_a_change_of_a_module_changes_the_hash(package, tmp_path):
    program = tmp_path / "judge.py"
    program.write_text("from gyriflow.mesh import quality")
    hashes = {code_hash(program)}
    for name in ("unused.py", "mesh/quality.py", "unused.c", "mesh/quality.c"):
        with (package / name).open("a") as file:
            file.write("\n// another line")
        for remembered in (
            sources._digest,
            sources._files_of,
            sources.imported_modules,
        ):
            remembered.cache_clear()
        hashes.add(code_hash(program))
        assert (
            len(hashes)
            == {
                "unused.py": 1,
                "mesh/quality.py": 2,
                "unused.c": 2,
                "mesh/quality.c": 3,
            }[name]
        )
