"""Curvature of spheres and tori, whose curvature is known."""

import numpy as np
import pytest
import trimesh

from gyriflow.geometry.triangles import TriangleMesh, flipped, signed_volume, submesh
from gyriflow.metrics.curvature import continued, curvature, near_boundary
from gyriflow.metrics.laplace_beltrami import laplacian


def sphere(radius: float, subdivisions: int = 4) -> TriangleMesh:
    shape = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return TriangleMesh(shape.vertices, shape.faces)


def torus(around: int, across: int, radius: float, tube: float) -> tuple[TriangleMesh, np.ndarray]:
    """Returns a torus and the (n,) angle across the tube, 0 at the outer rim."""
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")

    def index(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (a % around) * across + b % across

    lower = np.stack([index(i, j), index(i + 1, j), index(i + 1, j + 1)], axis=-1).reshape(-1, 3)
    upper = np.stack([index(i, j), index(i + 1, j + 1), index(i, j + 1)], axis=-1).reshape(-1, 3)
    u, v = 2 * np.pi * i.ravel() / around, 2 * np.pi * j.ravel() / across
    ring = radius + tube * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), tube * np.sin(v)], axis=1)
    return TriangleMesh(vertices, np.concatenate([lower, upper])), v


def grid(size: int) -> TriangleMesh:
    """Returns a flat square of size x size vertices, 1 mm apart."""
    x, y = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    corner = (x[:-1, :-1] * size + y[:-1, :-1]).ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + size, corner + size + 1], axis=1),
            np.stack([corner, corner + size + 1, corner + 1], axis=1),
        ]
    )
    return TriangleMesh(np.stack([x.ravel(), y.ravel(), np.zeros(size * size)], axis=1), faces)


def test_sphere_is_a_gyrus_of_curvature_one_over_radius() -> None:
    bend = curvature(sphere(25.0))
    np.testing.assert_allclose(bend.maximum, 1 / 25, rtol=0.02)
    np.testing.assert_allclose(bend.minimum, 1 / 25, rtol=0.02)
    np.testing.assert_allclose(bend.curvedness, 1 / 25, rtol=0.02)
    assert bend.shape_index.min() > 0.99
    assert bend.reliable.all()


def test_sphere_inside_out_is_a_pit() -> None:
    assert curvature(flipped(sphere(25.0))).shape_index.max() < -0.99


def test_torus() -> None:
    mesh, angle = torus(120, 60, 20.0, 8.0)
    assert signed_volume(mesh) > 0
    bend = curvature(mesh)
    along = np.cos(angle) / (20.0 + 8.0 * np.cos(angle))
    np.testing.assert_allclose(bend.maximum, 1 / 8, rtol=0.03)
    np.testing.assert_allclose(bend.minimum, along, atol=0.002)
    np.testing.assert_allclose(bend.gaussian, along / 8, atol=4e-4)
    np.testing.assert_allclose(bend.mean, 0.5 * (along + 1 / 8), rtol=0.05)
    # top and bottom of a torus are ridges: κ2 = 0, so the shape index is one half; inside are saddles, outside caps
    np.testing.assert_allclose(bend.shape_index[np.isclose(angle, np.pi / 2)], 0.5, atol=0.01)
    assert bend.shape_index[np.isclose(angle, np.pi)].max() < 0.5 < bend.shape_index[angle == 0].min()


def test_cut_changes_curvature_only_where_it_is_marked_unreliable() -> None:
    mesh, _ = torus(120, 60, 20.0, 8.0)
    whole = curvature(mesh, rings=3)
    half, kept = submesh(mesh, mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0)
    bend = curvature(half, rings=3)
    assert np.isfinite(bend.minimum).all()
    np.testing.assert_allclose(bend.minimum[bend.reliable], whole.minimum[kept][bend.reliable], atol=1e-12)
    assert np.count_nonzero(~bend.reliable) == 2 * 60 * 3  # two cuts of 60 vertices, three rings deep
    assert np.abs(bend.minimum - whole.minimum[kept])[~bend.reliable].max() > 1e-3


@pytest.mark.parametrize("rings", [0, 1, 2])
def test_rings_of_a_square(rings: int) -> None:
    assert np.count_nonzero(~near_boundary(grid(12), rings)) == (12 - 2 * (rings + 1)) ** 2


def test_continuation_of_a_constant_and_of_a_gradient() -> None:
    mesh = grid(20)
    stiffness, _ = laplacian(mesh)
    known = ~near_boundary(mesh, 2)
    wrong = np.where(known, 3.0, 50.0)
    np.testing.assert_allclose(continued(wrong, known, stiffness), 3.0, rtol=1e-10)
    slope = np.where(known, mesh.vertices[:, 0], 1e3)
    filled = continued(slope, known, stiffness)
    np.testing.assert_array_equal(filled[known], mesh.vertices[known, 0])
    assert filled.min() > 2.99  # nothing beyond the known values at 3 and 16
    assert filled.max() < 16.01
