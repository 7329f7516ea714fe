"""Hull, envelope and caps of shapes whose areas and volumes are known."""

import numpy as np
import pytest
from shapes import hemisphere_with_cut, octasphere, sphere

from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    convex_hull,
    corners,
    is_closed,
    signed_volume,
    submesh,
)
from gyriflow.metrics.gyrification import (
    cap,
    envelope,
    gyrification_index,
    pieces_without_cuts,
    sulcal_depth,
)


def index(mesh: TriangleMesh, around: TriangleMesh) -> float:
    return gyrification_index([mesh], [pieces_without_cuts(around, mesh)])


def dented(depth: float, width: float) -> TriangleMesh:
    """Return a sphere of 25 mm with a round dent of that depth and width (mm) at the
    top."""
    shape = sphere(25.0)
    across = np.linalg.norm(shape.vertices[:, :2], axis=1)
    hollow = depth * np.exp(-((across / (0.5 * width)) ** 2) * 2)
    dent = np.where(shape.vertices[:, 2] > 0, hollow, 0.0)
    return TriangleMesh(shape.vertices * (1 - dent / 25.0)[:, None], shape.faces)


def test_envelope_bridges_a_sulcus_and_follows_a_wide_dent() -> None:
    def depth(mesh: TriangleMesh, around: TriangleMesh) -> float:
        bottom = np.linalg.norm(mesh.vertices, axis=1).argmin()
        return float(nearest_on(mesh.vertices[[bottom]], around)[0][0])

    narrow, wide = dented(8.0, 5.0), dented(8.0, 30.0)
    around = envelope(narrow)
    assert is_closed(around)
    assert depth(narrow, around) > 7.0
    assert depth(wide, envelope(wide)) < 1.0
    assert depth(wide, convex_hull(wide)) > 2.5
    assert index(narrow, around) > index(narrow, convex_hull(narrow)) > 1.003


def test_sulcal_depth_of_a_dent() -> None:
    mesh = dented(8.0, 5.0)
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
    whole = octasphere(25.0)
    half, _ = submesh(whole, corners(whole).mean(axis=1)[:, 0] > 0)
    closed = cap(half)
    assert not is_closed(half)
    assert is_closed(closed)
    assert signed_volume(closed) == pytest.approx(
        0.5 * signed_volume(sphere(25.0)), rel=1e-3
    )
    assert area(closed) - area(half) == pytest.approx(np.pi * 25.0**2, rel=0.01)
    np.testing.assert_array_equal(closed.faces[: len(half.faces)], half.faces)


@pytest.mark.parametrize("pit", [1.0, 6.0, -6.0])
def test_what_spans_a_cut_in_a_pit_or_on_a_neck_is_left_out(pit: float) -> None:
    radius, cut = 25.0, 8.0
    mesh = hemisphere_with_cut(pit, radius, cut)
    # areas over π: half the sphere, the plane round the cut and the walls; the hull
    # goes from the plane's rim to a neck
    pial = 2 * radius**2 + radius**2 - cut**2 + 2 * cut * abs(pit)
    hull = 2 * radius**2 + (radius + cut) * np.hypot(radius - cut, min(pit, 0.0))
    assert index(mesh, convex_hull(mesh)) == pytest.approx(pial / hull, rel=0.003)
