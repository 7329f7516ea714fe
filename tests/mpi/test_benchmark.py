"""The benchmark of a step, on a mesh that is small enough to be quick."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from shapes import ellipsoid_mesh

from gyriflow.io.tetmeshes import write_tetrahedral_mesh

pytestmark = pytest.mark.slow

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "folding_step.py"
KEYS = (
    "tets dofs ranks blas_threads seconds_per_step paper_seconds_per_step ratio newton_per_step "
    "paper_newton_per_step krylov_per_newton max_difference_mm peak_memory_MiB"
)


def run(*arguments):
    program = [sys.executable, str(BENCHMARK), *map(str, arguments)]
    return subprocess.run(program, capture_output=True, text=True, timeout=300, check=False)


def test_both_set_ups_do_the_same_steps(tmp_path):
    mesh = ellipsoid_mesh(6, (20.0, 26.0, 18.0))
    write_tetrahedral_mesh(tmp_path / "brain.xdmf", mesh)
    # a thick cortex, for which the two degrees of quadrature matter little on so coarse a mesh
    (tmp_path / "params.yaml").write_text("thickness_mm: 10.0\n")
    done = run(tmp_path / "brain.xdmf", "--steps", 2, "--paper-steps", 1, "--params", tmp_path / "params.yaml")
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads(done.stdout.splitlines()[-1])
    assert list(result) == KEYS.split()
    assert (result["tets"], result["dofs"]) == (len(mesh.tets), mesh.vertices.size)
    assert (result["ranks"], result["blas_threads"]) == (2, 1)
    # two steps move the surface by some 0.2 mm
    assert result["max_difference_mm"] < 3e-3
    assert result["newton_per_step"] <= result["paper_newton_per_step"]


def test_a_benchmark_without_steps_is_refused(tmp_path):
    done = run(tmp_path / "brain.xdmf", "--steps", 0)
    assert done.returncode == 2
    assert "at least 1 is needed" in done.stderr
