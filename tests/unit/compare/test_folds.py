import numpy as np
import pytest
import trimesh

from gyriflow.compare.shapes import Shape, against_real, cortex_dice
from gyriflow.geometry.triangles import TriangleMesh

BALL = trimesh.creation.icosphere(subdivisions=4, radius=15.0)
SPHERE = TriangleMesh(BALL.vertices, BALL.faces)
X, _, Z = SPHERE.vertices.T


def shape(shape_index: np.ndarray, mean: np.ndarray | float = 1 / 15) -> Shape:
    return Shape(SPHERE, np.broadcast_to(np.asarray(mean, dtype=float), shape_index.shape), shape_index)


def test_size_and_distance_of_curvature():
    half = np.where(Z > 0, 0.1, -0.1)
    ones = np.ones(len(X))
    against = against_real(shape(ones, 2 * half), shape(ones, half))
    assert against["curvature_rms_ratio"] == pytest.approx(2.0)
    assert against["curvature_distance_per_mm"] == pytest.approx(0.1, rel=0.02)


def test_cortices_overlap_as_far_as_their_surfaces_are_the_same():
    # the outer 2 mm of balls of 15 and 16 mm share those from 14 to 15 mm
    shared, *whole = ((far**3 - near**3) for near, far in ((14, 15), (13, 15), (14, 16)))
    larger = TriangleMesh(SPHERE.vertices * 16 / 15, SPHERE.faces)
    assert cortex_dice(SPHERE, larger) == pytest.approx(2 * shared / sum(whole), abs=0.04)
    assert cortex_dice(SPHERE, SPHERE) == 1.0
