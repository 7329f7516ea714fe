"""What jobs leave is read, messages and time and memory, and on which modules their
programs depend."""

from pathlib import Path

import pytest

from gyriflow import code_hash as sources
from gyriflow.code_hash import code_hash, modules_behind
from gyriflow.messages import Message, reported_messages, write_message
from gyriflow.step import USAGE_COLUMNS, Usage, read_usage, record_usage


def write_log(name, *used):
    """Have a step in the working directory leave a warning of two lines, and what it
    has used."""
    log = Path("results", f"{name}.log")
    log.parent.mkdir(parents=True, exist_ok=True)
    write_message(log, Message("warning", f"{name}\nmore of it"))
    if used:
        record_usage(log, Usage(*used))
    return log


def test_messages_are_gathered_by_brain_and_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # each with its place and step in the table; others are of no brain or run of it,
    # or of the report before this one
    expected = {
        "study/logs/poses": ("", "", "poses"),
        "study/logs/atlas_file/x/week21.nii.gz": ("", "", "week21.nii.gz"),
        "brains/a/metrics/logs/measure": ("a", "", "measure"),
        "brains/a/logs/pial": ("a", "", "pial"),
        "runs/r/a/metrics/week-22.00/logs/measure": ("a", "r", "measure"),
        "runs/r/a/logs/simulate": ("a", "r", "simulate"),
    }
    others = ("brains/old/logs/pial", "runs/old/a/logs/simulate")
    for name in (*others, "report/logs/html_report", *reversed(expected)):
        write_log(name)
    found = {
        message.first_line: (message.brain, message.run, message.step)
        for message in reported_messages(tmp_path, ["a"], [["r", "a"]])
    }
    assert list(found.items()) == list(expected.items())
    assert reported_messages(tmp_path / "empty", ["a"], []) == []


def test_steps_that_have_ended_are_found_with_their_rules_brains_and_runs(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    expected = {
        "brains/a/logs/pial": ("pial", "", "a", 10.5, 9.75, 200.25),
        "brains/a/logs/targets.self": ("targets", "", "a", 11.0, 10.0, 210.0),
        "runs/two/a/logs/measure.week-22.00": ("measure", "two", "a", 3.0, 2.0, 1.0),
        "runs/two/a/logs/simulate": ("simulate", "two", "a", 100.0, 190.0, 1000.0),
        "study/logs/atlas_file/x/week21.nii.gz": ("atlas_file", "", "", 1.0, 1.0, 1.0),
    }
    for name, (*_, wall_s, cpu_s, memory_mib) in expected.items():
        write_log(name, wall_s, cpu_s, memory_mib)
    # it has failed; of it a full disk left half a line
    write_log("study/logs/run_tables")
    torn = write_log("brains/b/logs/pial", 10.5, 9.75, 200.25).with_suffix(".jsonl")
    torn.write_text(torn.read_text()[:-5])
    names = ("rule", "run", "brain", *USAGE_COLUMNS)
    found = [tuple(job[name] for name in names) for job in read_usage(tmp_path)]
    assert found == list(expected.values())


def forget():
    for remembered in (
        sources._files_of,
        sources._name_and_digest,
        sources.imported_modules,
        sources.modules_behind,
    ):
        remembered.cache_clear()


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A small package of two rooms and a plain module, with a program beside it."""
    root = tmp_path / "src" / "gyriflow"
    several = "from .. import (\n    surface,  # one\n    units as u,\n)\n"
    contents = {
        "__init__.py": "",
        "units.py": "ML = 1",
        "surface/__init__.py": "",
        "surface/repair.py": "from ..units import ML",
        "surface/labels.py": "def read():\n    from .repair import ML",
        "mesh/__init__.py": "import numpy",
        "mesh/quality.py": "import gyriflow.units",
        "mesh/fill.py": f"{several}import gyriflow.unused as o",
        "unused.py": "",
    }
    for name, text in contents.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    monkeypatch.setattr(sources, "PACKAGE", root)
    forget()
    yield root
    forget()


@pytest.mark.parametrize(
    ("module", "names"),
    [
        ("surface.labels", ["surface/__init__", "surface/labels", "surface/repair"]),
        ("mesh.fill", ["mesh/__init__", "mesh/fill", "surface/__init__", "unused"]),
    ],
)
def test_modules_behind_a_program_are_followed_through_others(
    package, tmp_path, module, names
):
    program = tmp_path / "measure.py"
    program.write_text(f"import gyriflow.{module}")
    found = {path.relative_to(package).as_posix() for path in modules_behind(program)}
    assert found == {"__init__.py", "units.py", *(f"{name}.py" for name in names)}


@pytest.mark.parametrize(
    ("file", "is_used"),
    [
        ("mesh/quality.py", True),
        ("mesh/quality.c", True),
        ("unused.py", False),
        ("unused.c", False),
    ],
)
def test_a_change_of_a_module_changes_the_hash(package, tmp_path, file, is_used):
    program = tmp_path / "judge.py"
    program.write_text("from gyriflow.mesh import quality")
    before = code_hash(program)
    with (package / file).open("a") as opened:
        opened.write("\n// another line")
    forget()
    assert (code_hash(program) != before) == is_used
