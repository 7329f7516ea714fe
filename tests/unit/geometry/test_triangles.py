"""Triangle surfaces against shapes whose measures are known."""

import numpy as np
import pytest
import shapes

from gyriflow.geometry.triangles import (
    TriangleMesh,
    convex_hull,
    face_components,
    flipped,
    is_closed,
    merged,
    order_along_curve,
    signed_volume,
    smallest_patch,
    split_sheets,
    submesh,
    transformed,
)


@pytest.fixture(scope="module")
def box():
    return shapes.box((2.0, 3.0, 4.0))


@pytest.fixture(scope="module")
def ball():
    return shapes.sphere(5.0)


def test_open_or_inconsistent_surfaces_are_not_closed(box):
    faces = box.faces.copy()
    assert is_closed(box)
    assert not is_closed(TriangleMesh(box.vertices, faces[1:]))
    faces[0] = faces[0, ::-1]
    assert not is_closed(TriangleMesh(box.vertices, faces))


def test_a_hull_has_no_points_inside_and_looks_outwards(box):
    within = shapes.box((1.0, 1.0, 1.0))
    hull = convex_hull(transformed(merged(within, box), shapes.FAR[0]))
    assert signed_volume(hull) == pytest.approx(24.0)
    assert len(hull.vertices) == 8


@pytest.mark.parametrize("first", [0, 1])
def test_a_hole_is_closed_by_the_smallest_patch_without_edges_that_are_there(first):
    # two corners are raised: the diagonal between the low ones gives the smaller area
    height = np.array([0.0, 6.0, 0.0, 3.0])
    loop = np.array([[0, 0, 0], [9.0, 0, 0], [9, 7, 0], [0, 7, 0]])
    loop[:, 2] = np.roll(height, first)
    outside = [[4.0, 3.0, 20.0]]
    rim = TriangleMesh(np.concatenate([loop, outside]), [[0, 1, 4]])
    patch = smallest_patch(rim, np.arange(4))
    diagonals = {0: {0, 2}, 1: {1, 3}}
    assert all(diagonals[first] <= set(face) for face in patch.tolist())
    # each side of the hole in its order
    assert (0, 1) in [tuple(pair) for face in patch for pair in (face[:2], face[1:])]
    low = sorted(diagonals[first])
    taken = TriangleMesh(rim.vertices, [[*low, 4]])
    patch = smallest_patch(taken, np.arange(4))
    assert all(diagonals[1 - first] <= set(face) for face in patch.tolist())


@pytest.mark.parametrize("is_outward", [True, False])
def test_bodies_that_share_an_edge_are_parted_there_each_closed(is_outward):
    large, small = shapes.box((2.0, 2.0, 6.0)), shapes.box((1.0, 3.0, 6.0))
    # edges along z of both, at the same place
    small = TriangleMesh(small.vertices + [1.5, 2.5, 0.0], small.faces)
    both = merged(large, small)
    points, number = np.unique(both.vertices, axis=0, return_inverse=True)
    joined = TriangleMesh(points, number.ravel()[both.faces])
    assert not is_closed(joined)
    parted = split_sheets(joined if is_outward else flipped(joined))
    assert is_closed(parted)
    assert len(parted.vertices) == 16
    component = face_components(parted)
    sizes = [signed_volume(submesh(parted, component == n)[0]) for n in (0, 1)]
    assert np.abs(sizes) == pytest.approx([24.0, 18.0])
    assert split_sheets(large) is large


def test_points_along_a_curve_are_near_each_other():
    points = np.random.default_rng(1).uniform(-3, 9, (4000, 3))
    order = order_along_curve(points)
    assert sorted(order) == list(range(4000))
    steps = np.linalg.norm(np.diff(points[order], axis=0), axis=1)
    shuffled = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert np.median(steps) < 0.15 * np.median(shuffled)
    assert order_along_curve(np.zeros((3, 3))).tolist() == [0, 1, 2]
    assert len(order_along_curve(np.empty((0, 3)))) == 0
