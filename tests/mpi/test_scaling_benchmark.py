"""The benchmark of time and memory against size, on its coarsest mesh, and the meshes that it makes."""

import json
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

from gyriflow.geometry.tetrahedra import boundary_surface, signed_volumes
from gyriflow.geometry.triangles import euler_number, face_components, is_closed

pytestmark = pytest.mark.slow

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
KEYS = (
    "sizes unknowns min_radius_ratio elements_through_cortex steps repeats seconds_1 seconds_2 speedup_2_ranks "
    "cost_per_unknown_growth memory_MiB newton_per_step krylov_per_newton us_per_unknown_newton"
)


def run(*arguments):
    program = [sys.executable, str(BENCHMARKS / "scaling.py"), *map(str, arguments)]
    return subprocess.run(program, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture(scope="module")
def graded_brain():
    spec = spec_from_file_location("graded_brain", BENCHMARKS / "graded_brain.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def coarsest(graded_brain):
    return graded_brain.brain_mesh(40_000)


def test_the_same_steps_are_done_on_one_rank_and_on_two():
    done = run("--sizes", 40_000, "--steps", 1, "--repeats", 1)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    result = json.loads(lines[-1])
    assert list(result) == KEYS.split()
    assert result["sizes"] == pytest.approx([40_000], rel=0.1)
    # heading, a row for each number of ranks, result
    assert [line.split()[:3] for line in lines[1:-1]] == [
        [str(result["sizes"][0]), str(result["unknowns"][0]), ranks] for ranks in "12"
    ]
    one, two = result["seconds_1"][0], result["seconds_2"][0]
    assert result["speedup_2_ranks"] == pytest.approx([one / two], abs=0.02)
    assert result["cost_per_unknown_growth"] == {"1": 1.0, "2": 1.0}
    newton, memory = result["newton_per_step"], result["memory_MiB"]
    assert newton["1"] == newton["2"] >= [1]
    # every rank holds the libraries
    assert memory["1"][0] > 100
    assert memory["2"][0] > memory["1"][0] + 100


def test_meshes_of_the_brain_differ_in_resolution_only(graded_brain, coarsest):
    fine = graded_brain.brain_mesh(90_000)
    assert [len(coarsest.tets), len(fine.tets)] == pytest.approx([40_000, 90_000], rel=0.1)
    assert signed_volumes(coarsest).sum() == pytest.approx(signed_volumes(fine).sum(), rel=0.01)
    for mesh in (coarsest, fine):
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


def test_a_mesh_is_the_same_each_time(graded_brain, coarsest):
    again = graded_brain.brain_mesh(40_000)
    np.testing.assert_array_equal(again.vertices, coarsest.vertices)
    np.testing.assert_array_equal(again.tets, coarsest.tets)


def test_a_mesh_too_coarse_for_the_fissure_is_refused(graded_brain):
    with pytest.raises(ValueError, match="at least 40000"):
        graded_brain.brain_mesh(39_999)
    done = run("--sizes", 1000)
    assert done.returncode == 2
    assert "at least 40000 are needed" in done.stderr
