"""The benchmark that kills runs, on a mesh that is small enough to be quick."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from shapes import ellipsoid_mesh

from gyriflow.io.tetmeshes import write_tetrahedral_mesh

pytestmark = pytest.mark.slow

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "interruptions.py"


@pytest.mark.fault(33)
@pytest.mark.promise(3)
def test_a_killed_run_loses_one_step_at_most(tmp_path):
    write_tetrahedral_mesh(tmp_path / "brain.xdmf", ellipsoid_mesh(8, (20.0, 26.0, 18.0)))
    params = {"start_week": 21.0, "end_week": 21.25, "output_weeks": [21.0, 21.25], "fissure_x_mm": 0.0}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(params | {"thickness_mm": 3.0, "step_s": 5400.0}))
    program = [sys.executable, str(BENCHMARK), str(tmp_path / "brain.xdmf"), str(tmp_path / "params.yaml")]
    done = subprocess.run([*program, "--runs", "2"], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads(done.stdout.splitlines()[-1])
    assert result["steps"] == 28
    assert all(0 < step <= 28 for step in result["killed_after_step"])
    assert -1 <= min(result["reported_steps_lost"]) <= result["most_lost"] <= 1
    assert result["max_difference_mm"] < 1e-3
