"""The benchmark of contact on a small body."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from shapes import ellipsoid_mesh

from gyriflow.io.tetmeshes import write_tetrahedral_mesh

pytestmark = pytest.mark.slow

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "contact.py"


def test_runs_are_compared_week_by_week_and_gone_on_with(tmp_path):
    write_tetrahedral_mesh(tmp_path / "brain.xdmf", ellipsoid_mesh(6, (20.0, 26.0, 18.0)))
    (tmp_path / "params.yaml").write_text(yaml.safe_dump({"thickness_mm": 3.0, "step_s": 302400.0}))
    command = [sys.executable, str(SCRIPT), str(tmp_path / "brain.xdmf"), "--end", "22", "--ranks", "1"]
    command += ["--params", str(tmp_path / "params.yaml"), "--out", str(tmp_path / "runs"), "--kinds", "global", "none"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert list(found) == ["global", "none"]
    for result in found.values():
        assert (result["tets"], result["steps"], result["inverted"]) == (1296, 2, 0)
        assert result["first_week_with_crossing"] is None
    first = (tmp_path / "runs" / "global" / "frames.h5").stat().st_mtime_ns
    again = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert json.loads(again.stdout.splitlines()[-1]) == found
    assert (tmp_path / "runs" / "global" / "frames.h5").stat().st_mtime_ns == first
