"""What jobs leave is read, messages, causes and time and memory, and on which modules
their programs depend."""

import os

import numpy as np
import pytest
from facts import Facts

from gyriflow import code_hash as sources
from gyriflow.code_hash import code_hash, modules_behind
from gyriflow.running.jobs import (
    OUT_OF_MEMORY,
    cause,
    gather_messages,
    read_messages,
    read_usage,
)
from gyriflow.step import USAGE_COLUMNS

HEAD = "\t".join(USAGE_COLUMNS)
PATTERNS = {
    "pial_from_labels": (
        r"results/brains/(?P<brain>a|b)/benchmarks/pial_from_labels\.tsv$"
    ),
    "simulate": r"results/runs/(?P<run>one|two)/(?P<brain>a)/benchmarks/simulate\.tsv$",
    "run_tables": r"results/study/benchmarks/run_tables\.tsv$",
}


def write_lines(path, *lines):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")


def test_messages_of_steps_and_of_the_folding_are_told_apart(tmp_path):
    log = tmp_path / "a.log"
    write_lines(
        log,
        "2026-11-22 00:53:59,004 INFO gyriflow.anatomy: fine",
        "2026-11-22 00:53:59,004 WARNING gyriflow.anatomy: it is crooked",
        "2026-11-22 00:53:59,004 WARNING gyriflow.anatomy: it is crooked",
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
        write_lines(tmp_path / "results" / f"{place}.log", warned.format(place))
    table = gather_messages(tmp_path, ["a"], [("r", "a")])
    assert set(table["message"]) == {
        "brains/a/logs/pial_from_labels",
        "brains/a/metrics/logs/measure",
        "runs/r/a/logs/simulate",
        "runs/r/a/metrics/week-22.00/logs/measure",
        "study/logs/poses",
    }
    row = table[table["message"] == "runs/r/a/metrics/week-22.00/logs/measure"].iloc[0]
    assert (row["subject"], row["run"], row["step"], row["level"]) == (
        "a",
        "r",
        "measure",
        "warning",
    )
    os.utime(tmp_path / "results/brains/a/logs/pial_from_labels.log", (0, 0))
    later = gather_messages(tmp_path, ["a"], [], since_s=1.0)
    assert set(later["message"]) == {
        "brains/a/metrics/logs/measure",
        "study/logs/poses",
    }


@pytest.mark.parametrize(
    ("log", "expected"),
    [
        (
            (
                "2026-11-22 00:54:57,955 INFO gyriflow.io: read\n"
                "2026-11-22 00:54:58,001 ERROR root: a.nii: is no image;\n"
                "  found text\n"
                "2026-11-22 00:54:59,000 INFO gyriflow.io: end\n"
            ),
            "a.nii: is no image;\n  found text",
        ),
        (
            (
                "GW 21.071/23  step 1\n2026-11-22 00:54:58,001 INFO root: a\n"
                "gyriflow: no step left. Use smaller steps\n"
            ),
            "no step left. Use smaller steps",
        ),
        (
            (
                "2026-11-22 00:54:58,001 ERROR root: unexpected error\n"
                "Traceback (most recent call last):\n"
                '  File "a.py", line 1, in <module>\n    1 / 0\n'
                "ZeroDivisionError: division by zero\n"
            ),
            Facts("ZeroDivisionError: division by zero"),
        ),
        (
            (
                "ValueError: no such week\n"
                "snakemake_interface_common.exceptions.WorkflowError:"
                " At least one job did not complete successfully.\n"
                "WorkflowError:\nAt least one job did not complete successfully.\n"
            ),
            Facts("ValueError: no such week"),
        ),
        ("mpiexec: one\n\ntwo\n", "mpiexec: one\ntwo"),
        ("2026-11-22 00:54:57,955 INFO gyriflow.io: read\n", OUT_OF_MEMORY),
        ("", ""),
    ],
)
def test_the_cause_is_gyriflows_own_message_or_else_the_exception_or_the_end(
    log, expected
):
    assert cause(log) == expected
    assert not any(word in cause(log) for word in ("Traceback", "WorkflowError"))


def write(folder, name, *lines, head=HEAD):
    write_lines(folder / "results" / name, head, *lines)


def line(seconds, memory, cpu):
    return f"{seconds}\t{cpu}\t{memory}"


def test_jobs_of_the_rules_are_found_with_their_runs_and_no_others(tmp_path):
    write(
        tmp_path, "brains/a/benchmarks/pial_from_labels.tsv", line(10.5, 200.25, 9.75)
    )
    write(tmp_path, "brains/b/benchmarks/pial_from_labels.tsv", line(11, 210, 10))
    write(
        tmp_path,
        "runs/two/a/benchmarks/simulate.tsv",
        line("100.00", "1000.00", "190.00"),
    )
    # of an earlier configuration
    write(tmp_path, "brains/c/benchmarks/pial_from_labels.tsv", line(1, 1, 1))
    write(tmp_path, "runs/three/a/benchmarks/simulate.tsv", line(1, 1, 1))
    jobs = read_usage(tmp_path, PATTERNS)
    assert jobs.fillna("").to_numpy().tolist() == [
        ["pial_from_labels", "", "a", 10.5, 9.75, 200.25],
        ["pial_from_labels", "", "b", 11.0, 10.0, 210.0],
        ["simulate", "two", "a", 100.0, 190.0, 1000.0],
    ]


def test_what_could_not_be_measured_is_nan(tmp_path):
    # a full disk may leave a part
    write(tmp_path, "brains/a/benchmarks/pial_from_labels.tsv", "0.3")
    write(tmp_path, "brains/b/benchmarks/pial_from_labels.tsv", "x")
    write(tmp_path, "runs/one/a/benchmarks/simulate.tsv", head="")
    write(tmp_path, "runs/two/a/benchmarks/simulate.tsv", "5.0", head="wall_s\tcpu")
    write(tmp_path, "study/benchmarks/run_tables.tsv")
    jobs = read_usage(tmp_path, PATTERNS)
    assert len(jobs) == 5
    np.testing.assert_array_equal(jobs["wall_s"], [0.3, np.nan, np.nan, 5.0, np.nan])
    assert jobs[["cpu_s", "memory_MiB"]].isna().all(axis=None)


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
