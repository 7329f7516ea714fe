"""The benchmark of convergence on a brain, on meshes too coarse to say anything of it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "convergence.py"


def test_without_budget_nothing_is_folded_after_the_coarsest(tmp_path):
    command = [sys.executable, str(BENCHMARK), "--folder", str(tmp_path), "--nodes", "1.0", "1.2", "--orders", "2"]
    command += ["--parts", "resolution", "--end-week", "21.15", "--budget-min", "0.01"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line["run"] for line in lines[:2]] == ["quadratic-1", "quadratic-1.2"]
    assert "skipped_since_s" in lines[1]
    assert [run["run"] for run in lines[-1]["runs"]] == ["quadratic-1"]
