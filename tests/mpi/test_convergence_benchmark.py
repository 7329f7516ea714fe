"""The benchmark of convergence on a brain, on meshes too coarse to say anything of it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from gyriflow.io.files import read_table

pytestmark = pytest.mark.slow

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "convergence.py"


def test_runs_of_both_orders_are_compared_with_the_finest_and_kept(tmp_path):
    figure = tmp_path / "figure.png"
    command = [sys.executable, str(BENCHMARK), "--folder", str(tmp_path), "--nodes", "0.8", "1.0", "--end-week", "21.3"]
    command += ["--parts", "resolution", "--figure", str(figure)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads(done.stdout.splitlines()[-1])
    names = ["quadratic-0.8", "linear-0.8", "quadratic-1", "linear-1"]
    assert [run["run"] for run in result["runs"]] == names
    assert result["finest"] == "quadratic-1"
    against = {row["run"]: row for row in result["against_finest"]}
    assert set(against) == {"quadratic-0.8", "linear-0.8"}
    # two days of growth: places differ by far less than they have moved, and surfaces by less than places
    for row in against.values():
        assert 0 < row["surface_distance_mm"] < row["displacement_rms_mm"]
        assert row["displacement_share"] < 0.2
        assert 0.9 < row["r_mean_curvature"] <= 1
    weeks = read_table(tmp_path / "weeks.csv")
    assert list(weeks["run"]) == names
    assert weeks["volume"].to_numpy() == pytest.approx(weeks["own_volume"].to_numpy(), rel=0.02)
    assert figure.stat().st_size > 0
    again = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    # nothing is folded a second time
    assert json.loads(again.stdout.splitlines()[-1]) == result


def test_without_budget_nothing_is_folded_after_the_coarsest(tmp_path):
    command = [sys.executable, str(BENCHMARK), "--folder", str(tmp_path), "--nodes", "0.8", "1.0", "--orders", "2"]
    command += ["--parts", "resolution", "--end-week", "21.15", "--budget-min", "0.01"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line["run"] for line in lines[:2]] == ["quadratic-0.8", "quadratic-1"]
    assert "skipped_since_s" in lines[1]
    assert [run["run"] for run in lines[-1]["runs"]] == ["quadratic-0.8"]
