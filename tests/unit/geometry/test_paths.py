"""Paths through shapes by week: noise of close weeks does not bend them, and elements
stay valid on the way."""

import numpy as np
import pytest
from shapes import box_mesh, ellipsoid_mesh, rigid

from gyriflow.geometry.alignment import align_points
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.jacobians import (
    inverted_on_the_way,
    may_be_inverted,
)
from gyriflow.geometry.paths import path_through
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    grid,
    quadratic,
    volumes_between,
)

BODY = ellipsoid_mesh(4, (20.0, 24.0, 18.0))


def path_of_lengths(weeks, lengths, stops=()):
    """Return the path of a body of these lengths."""
    shapes = [BODY.vertices * length for length in lengths]
    return path_through(weeks, shapes, BODY, stops=stops)


def length(places):
    return places[0, 0] / BODY.vertices[0, 0]


@pytest.mark.parametrize(
    ("lengths", "week", "velocity"),
    [
        # mean velocities 1, 2, 0.2
        ([2.0, 3.0, 7.0, 7.1], 21.0, 1.0),
        # as the parabola through three weeks
        ([2.0, 3.0, 7.0, 7.1], 22.0, 4 / 3),
        ([2.0, 3.0, 7.0, 7.1], 24.0, 0.56),
        ([2.0, 3.0, 7.0, 7.1], 24.5, 0.2),
        # at most three times the smaller mean velocity
        ([2.0, 2.1, 7.0, 7.5], 22.0, 0.3),
    ],
)
def test_velocities_are_those_of_parabolas_and_do_not_overshoot(
    lengths, week, velocity
):
    path = path_of_lengths([21.0, 22.0, 24.0, 24.5], lengths)
    assert length(path.curve.derivative()(week)) == pytest.approx(velocity)


def test_close_weeks_lie_on_a_line_through_their_mean_and_the_start_stays():
    weeks = [21.0, 21.2, 23.0, 24.0, 24.3]
    path = path_of_lengths(weeks, [1.0, 10.0, 3.0, 5.0, 7.0])
    # the start stays; the mean of the last two is 6 at 24.15, 3 after the 3 at 23
    last = [6 + (week - 24.15) * 3 / 1.15 for week in (24.0, 24.3)]
    assert [length(path(week)) for week in weeks] == pytest.approx(
        [1.0, 1 + 0.2 * 2 / 2.0, 3.0, *last]
    )
    # a stop next to them goes, others stay
    with_stops = [21.0, 22.0, 23.0, 24.0, 24.1, 24.3]
    path = path_of_lengths(with_stops, range(1, 7), stops=[22.0, 24.1])
    assert path.weeks.tolist() == [21.0, 22.0, 23.0, 24.0, 24.3]
    # a start and one scan are not merged
    path = path_of_lengths([21.0, 21.2], [1.0, 10.0])
    assert length(path(21.2)) == pytest.approx(10.0)


def twisted_box(angle):
    """Return a box of elements, and its vertices after its inner half was turned about
    its axis, as a whole."""
    mesh = box_mesh((4, 4, 4), (8.0, 8.0, 8.0))
    x, y, z = mesh.vertices.T
    fade = np.clip(1.5 - np.hypot(x, y) / 3, 0, 1) * angle
    c, s = np.cos(fade), np.sin(fade)
    return mesh, np.stack([c * x - s * y, s * x + c * y, z], axis=1)


TET = np.array([[0, 1, 2, 3]])
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    ("after", "is_inverted"),
    [
        # half a turn about z: valid at both ends, flat in the middle
        (CORNERS * [-1, -1, 1], True),
        # less than half a turn, with positive Bernstein coefficients and a negative one
        (transform_points(CORNERS, rigid(0, 0, 60)), False),
        (transform_points(CORNERS, rigid(0, 0, 150)), False),
        (CORNERS * [1, 1, -1], True),
        (CORNERS * 0.1, False),
    ],
)
def test_an_element_inverted_on_a_straight_way_is_found(after, is_inverted):
    assert inverted_on_the_way(CORNERS, after, TET).tolist() == [is_inverted]


def test_each_shape_is_aligned_with_the_one_before_by_volume():
    """A box that is bent to and fro: elements on the right are five times as long, and
    move on."""
    ticks = [-8, -7, -6, -5, 0, 5, 10.0], np.linspace(-6, 6, 5), np.linspace(-5, 5, 5)
    mesh = grid([np.array(axis) for axis in ticks])
    sizes = vertex_sizes(mesh.vertices, mesh.tets)
    x = mesh.vertices[:, :1]
    bends = [0 * x, np.where(x < -4.5, 1.0, 0.0), 0.01 * x**2]
    shapes = []
    for number, bend in enumerate(bends):
        pose = rigid(0, 10 * number, 20, shift=(number, 0.0, 5.0))
        shapes.append(transform_points(mesh.vertices + bend * [0, 0, 1.0], pose))
    path = path_through([21.0, 22.0, 23.0], shapes, mesh)
    for week in (21.0, 22.0):
        before, after = path(week), path(week + 1.0)
        # nothing is left of a motion from shape to shape
        aligned = align_points(after, before, sizes)
        assert aligned == pytest.approx(after, abs=1e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_inversion_on_the_way_agrees_with_many_points_of_it(order):
    mesh, after = twisted_box(2.2)
    if order == 2:
        mesh = quadratic(mesh)
        after = quadratic(TetrahedralMesh(after, mesh.corners)).vertices
    before, tets = mesh.vertices, mesh.tets
    found = inverted_on_the_way(before, after, tets)
    parts = np.linspace(0, 1, 101)
    ways = [volumes_between(before + t * (after - before), tets) for t in parts]
    least = np.min(ways, axis=0)
    assert 0 < (least <= 0).sum() < len(least)
    assert found[least <= 0].all()
    # bounds of quadratic elements may be below 0 where their volume is not
    tolerance = 1e-9 if order == 1 else 0.2
    assert (least <= tolerance * ways[0])[found].all()
    # such elements are among those that a mean of both shapes may invert
    suspects = may_be_inverted(np.stack([before, after]), tets)
    assert suspects[found].all()
    assert suspects.sum() < len(suspects)


def test_a_way_may_keep_a_share_of_the_volume():
    mesh, after = twisted_box(2.2)
    found, larger = (
        inverted_on_the_way(mesh.vertices, after, mesh.tets, least)
        for least in (0.0, 0.5)
    )
    assert larger[found].all()
    assert larger.sum() > found.sum()


def test_an_element_that_is_halved_and_turned_a_little_cannot_be_inverted():
    mesh, _ = twisted_box(0.0)
    small = transform_points(mesh.vertices * [1.0, 0.5, 1.0], rigid(0, 0, 20))
    assert not may_be_inverted(np.stack([mesh.vertices, small]), mesh.tets).any()


def test_a_path_is_smooth_but_straight_near_an_element_that_would_be_inverted():
    # on the left a layer comes close to the next, fast, before that one moves on; the
    # right end moves late
    mesh = box_mesh((8, 8, 8), (32.0, 32.0, 32.0))
    x = mesh.vertices[:, 0]
    shapes = np.repeat(mesh.vertices[None], 3, axis=0)
    for place, moves in (
        (-8.0, [3.8, 5.3]),
        (-4.0, [0.0, 1.5]),
        (12.0, [0.0, 2.0]),
        (16.0, [0.0, 2.0]),
    ):
        shapes[1:, np.isclose(x, place), 0] += np.array(moves)[:, None]
    path = path_through([21.0, 22.0, 23.0], shapes, mesh)
    assert [len(faults) for faults in path.inverted] == [0, 0]

    # the path if no element were inverted has the velocities of a parabola at 22 GW
    # where these are not too large, and the mean velocity at 23 GW
    places = np.stack([path(week) for week in (21.0, 22.0, 23.0)])
    first, second = np.diff(places, axis=0)
    velocity = (first + second) / 2
    slower = np.linalg.norm([first, second], axis=2).min(axis=0)
    length = np.linalg.norm(velocity, axis=1)
    velocity *= np.minimum(1.0, 3 * slower / np.maximum(length, 1e-12))[:, None]
    straight = 0.5 * (places[1] + places[2])
    smooth = straight + (velocity - second) / 8
    assert inverted_on_the_way(places[1], smooth, mesh.tets).sum() > 0

    bends = np.linalg.norm(smooth - straight, axis=1)
    from_straight, from_smooth = (
        np.linalg.norm(path(22.5) - shape, axis=1) for shape in (straight, smooth)
    )
    left, right = np.isclose(x, -8.0), np.isclose(x, 12.0)
    assert bends[left].min() > 0.1
    assert bends[right].min() > 0.05
    assert (from_straight < 0.5 * bends)[left].all()
    assert from_smooth[right].max() < 0.05 * bends[right].min()
