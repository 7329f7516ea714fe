"""The benchmark of time and memory against size, on its coarsest mesh."""

import json
import sys
from pathlib import Path

import pytest
from processes import ran

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
pytestmark = pytest.mark.slow


def test_the_same_steps_are_done_on_one_rank_and_on_two():
    done = ran(sys.executable, BENCHMARKS / "scaling.py", "--sizes", "40000", "--steps", "1", "--repeats", "1")
    assert done.returncode == 0, done.stdout + done.stderr
    *lines, last = map(json.loads, done.stdout.splitlines())
    one, two = last["rows"]
    assert lines == [one, two]
    assert (one["ranks"], two["ranks"]) == (1, 2)
    assert one["tets"] == two["tets"] == pytest.approx(40_000, rel=0.1)
    assert one["newton_per_step"] == two["newton_per_step"] >= 1
    assert last["speedup"]["2"] == [pytest.approx(one["seconds"] / two["seconds"], abs=0.02)]
    assert last["cost_per_unknown_growth"] == {"1": 1.0, "2": 1.0}
    # every rank holds the libraries
    assert two["memory_MiB"] > one["memory_MiB"] + 100 > 200
