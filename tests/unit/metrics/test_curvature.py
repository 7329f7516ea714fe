"""Curvature of spheres, tori, ellipsoids and a folded surface, whose curvature is known."""

import logging
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
import trimesh

from gyriflow.errors import MeshError
from gyriflow.geometry.triangles import TriangleMesh, flipped, mean_edge_length, merged, signed_volume, submesh
from gyriflow.metrics.curvature import continue_smoothly, curvature
from gyriflow.metrics.laplace_beltrami import laplacian


@pytest.fixture(scope="module")
def surfaces():
    """The module of the benchmark with surfaces of known curvature."""
    path = Path(__file__).parents[3] / "benchmarks" / "curved_surfaces.py"
    spec = spec_from_file_location(path.stem, path)
    module = module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


def error(found, expected) -> float:
    """Returns the RMS error of κ1 and κ2 relative to their RMS."""
    expected = np.stack(expected)
    return np.sqrt(np.mean((np.stack([found.maximum, found.minimum]) - expected) ** 2) / np.mean(expected**2))


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
    bend = curvature(mesh, radius_mm=2.2)
    along = np.cos(angle) / (20.0 + 8.0 * np.cos(angle))
    np.testing.assert_allclose(bend.maximum, 1 / 8, rtol=0.03)
    np.testing.assert_allclose(bend.minimum, along, atol=0.002)
    np.testing.assert_allclose(bend.gaussian, along / 8, atol=4e-4)
    np.testing.assert_allclose(bend.mean, 0.5 * (along + 1 / 8), rtol=0.05)
    # top and bottom of a torus are ridges: κ2 = 0, so the shape index is one half; inside are saddles, outside caps
    np.testing.assert_allclose(bend.shape_index[np.isclose(angle, np.pi / 2)], 0.5, atol=0.01)
    assert bend.shape_index[np.isclose(angle, np.pi)].max() < 0.5 < bend.shape_index[angle == 0].min()


def test_exact_curvature_of_the_folded_surface(surfaces) -> None:
    folded = surfaces.Folded(20.0, 1.0, 10.0)
    points = folded.projected(np.random.default_rng(0).standard_normal((50, 3)))

    def level(x):
        directions = x / np.linalg.norm(x, axis=1, keepdims=True)
        return np.linalg.norm(x, axis=1) - 20.0 - np.sin(10.0 * directions).sum(axis=1)

    step, axes = 1e-3, np.eye(3)
    slopes = [(level(points + step * a) - level(points - step * a)) / (2 * step) for a in axes]
    bends = [
        [
            (level(points + step * (a + b)) - level(points + step * (a - b)) - level(points - step * (a - b)))
            + level(points - step * (a + b))
            for b in axes
        ]
        for a in axes
    ]
    differences = surfaces.implicit_curvature(np.stack(slopes, 1), np.transpose(bends, (2, 0, 1)) / (4 * step**2))
    np.testing.assert_allclose(np.stack(folded.curvature(points)), np.stack(differences), atol=2e-4)


@pytest.mark.parametrize(
    ("kind", "sizes", "bound"),
    [("Ellipsoid", ((18, 14, 10),), 0.02), ("Torus", (14, 5), 0.06), ("Folded", (14, 0.7, 7), 0.1)],
)
def test_meshes_of_other_density_give_the_same_curvature(surfaces, kind: str, sizes: tuple, bound: float) -> None:
    surface = getattr(surfaces, kind)(*sizes)
    errors = []
    for edge in (0.8, 1.2):
        mesh = surfaces.meshed(surface, edge)
        errors.append(error(curvature(mesh, radius_mm=3.0), surface.curvature(mesh.vertices)))
    assert max(errors) < bound
    assert errors[1] == pytest.approx(errors[0], abs=0.005)


def test_noise_is_averaged_out(surfaces) -> None:
    surface = surfaces.Folded(14, 0.7, 7)
    mesh = surfaces.meshed(surface, 0.8)
    exact = surface.curvature(mesh.vertices)
    assert error(curvature(surfaces.noisy(mesh, 0.05, seed=1), radius_mm=3.0), exact) < 0.14


def test_walls_of_a_narrow_sulcus_do_not_see_each_other() -> None:
    lower, upper = grid(30), grid(30)
    upper = TriangleMesh(upper.vertices + [0.0, 0.0, 0.5], upper.faces[:, ::-1])
    slope = lower.vertices[:, [0]] ** 2 * [0.0, 0.0, 0.01]
    third = TriangleMesh(lower.vertices + [0.0, 0.0, 1.0] + slope, lower.faces)
    alone = curvature(lower, radius_mm=3.0)
    between = curvature(merged(lower, upper, third), radius_mm=3.0)
    np.testing.assert_allclose(between.maximum[: len(lower.vertices)], alone.maximum, atol=1e-12)
    np.testing.assert_allclose(alone.maximum, 0.0, atol=1e-12)


def test_a_ball_grows_to_two_edges_where_the_mesh_is_coarse(caplog) -> None:
    mesh = sphere(25.0, 3)
    length = mean_edge_length(mesh)
    with caplog.at_level(logging.WARNING):
        bend = curvature(mesh, radius_mm=1.5)
    assert f"{2 * length:.3g} mm is the finest" in caplog.text
    assert bend.radius_mm.mean() == pytest.approx(2 * length, rel=0.02)
    np.testing.assert_allclose(bend.mean, 1 / 25, rtol=0.03)
    caplog.clear()
    assert (curvature(mesh, radius_mm=10.0).radius_mm == 10.0).all()
    assert not caplog.text


def test_loose_faces_have_no_curvature() -> None:
    scattered = np.arange(30.0).reshape(-1, 1, 1) * [50.0, 0.0, 0.0] + [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    with pytest.raises(MeshError, match="90 of 90 vertices"):
        curvature(TriangleMesh(scattered.reshape(-1, 3), np.arange(90).reshape(-1, 3)))


def test_cut_changes_curvature_only_where_it_is_marked_unreliable() -> None:
    mesh, _ = torus(120, 60, 20.0, 8.0)
    whole = curvature(mesh, radius_mm=3.0)
    half, kept = submesh(mesh, mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0)
    bend = curvature(half, radius_mm=3.0)
    assert np.isfinite(bend.minimum).all()
    np.testing.assert_allclose(bend.minimum[bend.reliable], whole.minimum[kept][bend.reliable], atol=1e-12)
    assert np.abs(bend.minimum - whole.minimum[kept])[~bend.reliable].max() > 1e-3
    # all within the radius of the two cuts, and nothing beyond
    from_cut = half.vertices[:, 0]
    assert not bend.reliable[from_cut < 1.5].any()
    assert bend.reliable[from_cut > 3.1].all()


def test_continuation_of_a_constant_and_of_a_gradient() -> None:
    mesh = grid(20)
    stiffness, _ = laplacian(mesh)
    known = ((mesh.vertices[:, :2] >= 3) & (mesh.vertices[:, :2] <= 16)).all(axis=1)
    wrong = np.where(known, 3.0, 50.0)
    np.testing.assert_allclose(continue_smoothly(wrong, known, stiffness), 3.0, rtol=1e-10)
    slope = np.where(known, mesh.vertices[:, 0], 1e3)
    filled = continue_smoothly(slope, known, stiffness)
    np.testing.assert_array_equal(filled[known], mesh.vertices[known, 0])
    assert filled.min() > 2.99  # nothing beyond the known values at 3 and 16
    assert filled.max() < 16.01
