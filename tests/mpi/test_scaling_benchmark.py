"""The benchmark of time and memory against size, on its coarsest mesh, and the meshes that it makes."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

from gyriflow.geometry.tetrahedra import boundary_surface, signed_volumes
from gyriflow.geometry.triangles import euler_number, face_components, is_closed

pytestmark = pytest.mark.slow

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def graded_brain():
    spec = spec_from_file_location("graded_brain", BENCHMARKS / "graded_brain.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def coarsest(graded_brain):
    return graded_brain.brain_mesh(40_000)


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
