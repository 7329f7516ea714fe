"""Hull, envelope and caps of shapes whose areas and volumes are known."""

import igl
import numpy as np
import pytest
from shapes import hemisphere_with_cut, octasphere, sphere

from gyriflow.errors import MeshError
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    convex_hull,
    is_closed,
    signed_volume,
    submesh,
    vertex_areas,
)
from gyriflow.metrics.gyrification import (
    cap,
    envelope,
    gyrification_index,
    local_gyrification_index,
    pieces_without_cuts,
    sulcal_depth,
)


def index(mesh: TriangleMesh, around: TriangleMesh) -> float:
    return gyrification_index([mesh], [pieces_without_cuts(around, mesh)])


def half_sphere() -> TriangleMesh:
    """Return half a sphere of 25 mm, open in the plane x = 0."""
    whole = octasphere(25.0)
    return submesh(whole, whole.vertices[whole.faces].mean(axis=1)[:, 0] > 0)[0]


def dented(depth: float, width: float, subdivisions: int = 5) -> TriangleMesh:
    """Return a sphere of 25 mm with a round dent of that depth and width (mm) at the
    top."""
    shape = sphere(25.0, subdivisions)
    across = np.linalg.norm(shape.vertices[:, :2], axis=1)
    dent = np.where(
        shape.vertices[:, 2] > 0,
        depth * np.exp(-((across / (0.5 * width)) ** 2) * 2),
        0.0,
    )
    return TriangleMesh(shape.vertices * (1 - dent / 25.0)[:, None], shape.faces)


def test_envelope_bridges_a_sulcus_and_follows_a_wide_dent() -> None:
    def depth(mesh: TriangleMesh, around: TriangleMesh) -> float:
        bottom = mesh.vertices[[np.linalg.norm(mesh.vertices, axis=1).argmin()]]
        return float(
            np.sqrt(
                igl.point_mesh_squared_distance(bottom, around.vertices, around.faces)[
                    0
                ][0]
            )
        )

    narrow, wide = dented(8.0, 5.0), dented(8.0, 30.0)
    around = envelope(narrow)
    assert is_closed(around)
    assert depth(narrow, around) > 7.0
    assert depth(wide, envelope(wide)) < 1.0
    assert depth(wide, convex_hull(wide)) > 2.5
    assert index(narrow, around) > index(narrow, convex_hull(narrow)) > 1.003


@pytest.mark.parametrize("subdivisions", [5, 6])
def test_sulcal_depth_of_a_dent(subdivisions: int) -> None:
    mesh = dented(8.0, 5.0, subdivisions)
    depth = sulcal_depth(mesh, convex_hull(mesh))
    bottom = np.linalg.norm(mesh.vertices, axis=1).argmin()
    assert depth.argmax() == bottom
    # the mouth is bridged by a flat piece, at most 1 mm below the sphere's top
    true = 25.0 - np.linalg.norm(mesh.vertices[bottom])
    assert true - 1.0 < depth[bottom] <= true
    assert depth.min() == 0.0
    away = np.linalg.norm(mesh.vertices - mesh.vertices[bottom], axis=1) > 15.0
    assert depth[away].max() < 0.05


def test_cap_of_half_a_sphere() -> None:
    half = half_sphere()
    closed = cap(half)
    assert not is_closed(half)
    assert is_closed(closed)
    assert signed_volume(closed) == pytest.approx(
        0.5 * signed_volume(sphere(25.0)), rel=1e-3
    )
    assert area(closed) - area(half) == pytest.approx(np.pi * 25.0**2, rel=0.01)
    np.testing.assert_array_equal(closed.faces[: len(half.faces)], half.faces)


@pytest.mark.parametrize("pit", [1.0, 3.0, 6.0, -1.0, -3.0, -6.0])
def test_what_spans_a_cut_in_a_pit_or_on_a_neck_is_left_out(pit: float) -> None:
    radius, cut = 25.0, 8.0
    mesh = hemisphere_with_cut(pit, radius, cut)
    # areas over π: half the sphere, the plane round the cut and the walls; the hull
    # goes from the plane's rim to a neck
    pial = 2 * radius**2 + radius**2 - cut**2 + 2 * cut * abs(pit)
    hull = 2 * radius**2 + (radius + cut) * np.hypot(radius - cut, min(pit, 0.0))
    assert index(mesh, convex_hull(mesh)) == pytest.approx(pial / hull, rel=0.003)


@pytest.mark.parametrize("pit", [3.0, -3.0])
def test_the_envelope_over_a_cut_is_left_out_and_nothing_else(pit: float) -> None:
    around = pieces_without_cuts(
        envelope(mesh := hemisphere_with_cut(pit, 25.0, 8.0)), mesh
    )
    across = np.linalg.norm(around.centres[:, 1:], axis=1)
    is_medial = np.abs(around.centres[:, 0]) < 4.0
    assert around.areas[is_medial & (across < 7.0)].sum() < 0.1 * np.pi * 8.0**2
    ring = is_medial & (across > 10.0) & (across < 20.0)
    assert around.areas[ring].sum() == pytest.approx(
        np.pi * (20.0**2 - 10.0**2), rel=0.05
    )


def test_depth_beside_a_cut_is_that_below_the_hull() -> None:
    mesh = hemisphere_with_cut(4.0)
    depth = sulcal_depth(mesh, convex_hull(mesh))
    is_wall = np.linalg.norm(mesh.vertices[:, 1:], axis=1) < 8.1
    is_wall &= mesh.vertices[:, 0] < 10.0
    assert depth[is_wall] == pytest.approx(np.abs(mesh.vertices[is_wall, 0]), abs=0.05)
    assert depth[~is_wall].max() < 0.05


def test_local_index_is_high_at_a_sulcus_and_one_far_from_it() -> None:
    mesh = dented(8.0, 5.0)
    around = pieces_without_cuts(envelope(mesh), mesh)
    local = local_gyrification_index(mesh, around)
    bottom = np.linalg.norm(mesh.vertices, axis=1).argmin()
    away = np.linalg.norm(mesh.vertices - [0, 0, 25.0], axis=1)
    # a patch of 10 mm round the dent: its area with and without what the dent adds
    inside = away < 10.0
    areas = vertex_areas(mesh)[inside].sum() / (np.pi * 10.0**2)
    assert local[bottom] == pytest.approx(areas, rel=0.05)
    assert local[bottom] > 1.1
    assert np.abs(local[away > 25.0] - 1.0).max() < 0.05


def test_flat_surface_has_no_hull() -> None:
    flat = TriangleMesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]]
    )
    with pytest.raises(MeshError):
        convex_hull(flat)
