"""The benchmark of time and memory against size, on its coarsest mesh, and the meshes that it makes."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gyriflow.geometry.tetrahedra import boundary_surface, signed_volumes
from gyriflow.geometry.triangles import euler_number, face_components, is_closed

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))
from graded_brain import brain_mesh  # noqa: E402

pytestmark = pytest.mark.slow


def test_the_same_steps_are_done_on_one_rank_and_on_two():
    program = [sys.executable, str(BENCHMARKS / "scaling.py"), "--sizes", "40000", "--steps", "1", "--repeats", "1"]
    done = subprocess.run(program, capture_output=True, text=True, timeout=300, check=False)
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


def test_meshes_of_the_brain_differ_in_resolution_only():
    coarse, fine = brain_mesh(40_000), brain_mesh(90_000)
    assert [len(coarse.tets), len(fine.tets)] == pytest.approx([40_000, 90_000], rel=0.1)
    assert signed_volumes(coarse).sum() == pytest.approx(signed_volumes(fine).sum(), rel=0.01)
    for mesh in (coarse, fine):
        volume = signed_volumes(mesh)
        assert volume.min() > 0
        # one body without handles: the bridge is the only link between the hemispheres
        surface, _ = boundary_surface(mesh)
        assert is_closed(surface)
        assert face_components(surface).max() == 0
        assert euler_number(surface) == 2
        # coarse in the middle of a hemisphere, fine at its top
        centroids = mesh.vertices[mesh.tets].mean(axis=1)
        middle = np.linalg.norm(centroids - [10.0, 0.0, 0.0], axis=1) < 3
        assert np.median(volume[middle]) > 4 * np.median(volume[centroids[:, 2] > 18])
