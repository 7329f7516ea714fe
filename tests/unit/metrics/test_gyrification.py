"""Hull, envelope and caps of shapes whose areas and volumes are known."""

import igl
import numpy as np
import pytest
import trimesh

from gyriflow.errors import MeshError
from gyriflow.geometry.triangles import TriangleMesh, area, is_closed, merged, signed_volume, submesh, transformed
from gyriflow.metrics.gyrification import area_over, capped, convex_hull, envelope, gyrification_index, sulcal_depth


def sphere(radius: float = 25.0) -> TriangleMesh:
    shape = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return TriangleMesh(shape.vertices, shape.faces)


def half_sphere(radius: float = 25.0) -> TriangleMesh:
    """Returns half a sphere, open in the plane x = 0, where the edges of an octahedron lie."""
    shape = trimesh.Trimesh(
        [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0], [0, 0, -1]], [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]
    )
    for _ in range(5):
        shape = shape.subdivide()
    return TriangleMesh(radius * shape.vertices / np.linalg.norm(shape.vertices, axis=1)[:, None], shape.faces)


def dented(depth: float, width: float, subdivisions: int = 5) -> TriangleMesh:
    """Returns a sphere of 25 mm with a round dent of that depth and width (mm) at the top."""
    shape = trimesh.creation.icosphere(subdivisions=subdivisions, radius=25.0)
    across = np.linalg.norm(shape.vertices[:, :2], axis=1)
    dent = np.where(shape.vertices[:, 2] > 0, depth * np.exp(-((across / (0.5 * width)) ** 2) * 2), 0.0)
    return TriangleMesh(shape.vertices * (1 - dent / 25.0)[:, None], shape.faces)


def test_sphere_has_no_folds() -> None:
    mesh = sphere()
    assert gyrification_index(mesh, convex_hull(mesh)) == pytest.approx(1.0, abs=1e-9)
    assert gyrification_index(mesh, envelope(mesh)) == pytest.approx(1.0, abs=0.01)


def test_hull_is_closed_and_outward() -> None:
    hull = convex_hull(dented(10.0, 12.0))
    assert is_closed(hull)
    assert signed_volume(hull) == pytest.approx(4 / 3 * np.pi * 25.0**3, rel=0.02)


def test_envelope_bridges_a_sulcus_and_follows_a_wide_dent() -> None:
    def depth(mesh: TriangleMesh, around: TriangleMesh) -> float:
        bottom = mesh.vertices[[np.linalg.norm(mesh.vertices, axis=1).argmin()]]
        return float(np.sqrt(igl.point_mesh_squared_distance(bottom, around.vertices, around.faces)[0][0]))

    narrow, wide = dented(8.0, 5.0), dented(8.0, 30.0)
    assert depth(narrow, envelope(narrow)) > 7.0
    assert depth(wide, envelope(wide)) < 1.0
    assert depth(wide, convex_hull(wide)) > 2.5
    assert gyrification_index(narrow, envelope(narrow)) > gyrification_index(narrow, convex_hull(narrow)) > 1.003
    assert is_closed(envelope(narrow))


@pytest.mark.parametrize("subdivisions", [5, 6])
def test_sulcal_depth_of_a_dent(subdivisions: int) -> None:
    mesh = dented(8.0, 5.0, subdivisions)
    depth = sulcal_depth(mesh, envelope(mesh))
    bottom = np.linalg.norm(mesh.vertices, axis=1).argmin()
    assert depth.argmax() == bottom
    # the mouth is bridged by a flat piece, at most 1 mm below the sphere's top
    true = 25.0 - np.linalg.norm(mesh.vertices[bottom])
    assert true - 1.0 < depth[bottom] <= true
    assert depth.min() == 0.0
    away = np.linalg.norm(mesh.vertices - mesh.vertices[bottom], axis=1) > 15.0
    assert depth[away].max() < 0.05


def test_sulcal_depth_is_zero_outside_the_envelope() -> None:
    np.testing.assert_array_equal(sulcal_depth(sphere(25.0), sphere(24.0)), 0.0)
    np.testing.assert_allclose(sulcal_depth(sphere(24.0), sphere(25.0)), 1.0, atol=0.05)


def test_cap_of_half_a_sphere() -> None:
    half = half_sphere()
    closed = capped(half)
    assert not is_closed(half)
    assert is_closed(closed)
    assert signed_volume(closed) == pytest.approx(0.5 * signed_volume(sphere()), rel=1e-3)
    assert area(closed) - area(half) == pytest.approx(np.pi * 25.0**2, rel=0.01)
    np.testing.assert_array_equal(closed.faces[: len(half.faces)], half.faces)


def test_two_cuts_are_closed_one_by_one() -> None:
    mesh = sphere()
    slab, _ = submesh(mesh, np.abs(mesh.vertices[mesh.faces].mean(axis=1)[:, 2]) < 12.0)
    closed = capped(slab)
    assert is_closed(closed)
    assert len(closed.vertices) == len(slab.vertices) + 2
    assert signed_volume(closed) == pytest.approx(np.pi * (25.0**2 * 24 - 2 * 12.0**3 / 3), rel=0.03)


def test_closed_surface_needs_no_cap() -> None:
    mesh = sphere()
    assert capped(mesh) is mesh


def test_cut_is_left_out_of_the_index() -> None:
    half = half_sphere()
    hull = convex_hull(half)
    assert area(hull) == pytest.approx(3 * np.pi * 25.0**2, rel=0.01)
    assert area_over(hull, half) == pytest.approx(2 * np.pi * 25.0**2, rel=0.01)
    assert gyrification_index(half, hull) == pytest.approx(1.0, abs=0.02)
    assert gyrification_index(half, envelope(half)) == pytest.approx(1.0, abs=0.03)


def test_two_hemispheres_are_wrapped_as_one() -> None:
    left = transformed(sphere(10.0), [[1, 0, 0, -10.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    right = transformed(sphere(10.0), [[1, 0, 0, 10.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    both = merged(left, right)
    assert gyrification_index(both, convex_hull(both)) == pytest.approx(
        8 * np.pi * 100 / (4 * np.pi * 100 + 2 * np.pi * 10 * 21), rel=0.01
    )


def test_flat_surface_has_no_hull() -> None:
    flat = TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]])
    with pytest.raises(MeshError, match="convex hull"):
        convex_hull(flat)
