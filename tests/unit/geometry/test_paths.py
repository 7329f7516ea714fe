"""Paths through shapes by week: noise of close weeks does not bend them, and elements
stay valid on the way."""

import numpy as np
import pytest
from shapes import box_mesh, ellipsoid_mesh, rigid

from gyriflow.geometry.alignment import without_rigid_motion
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.jacobians import (
    AT_CORNERS,
    coefficients,
    inverted_on_the_way,
    may_be_inverted,
)
from gyriflow.geometry.paths import limited_velocities, merged_shapes, path_through
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    grid,
    quadratic,
    volumes_between,
)

BODY = ellipsoid_mesh(8, (20.0, 24.0, 18.0))


def grown(week):
    """Return the body's vertices at a week: they move linearly and unevenly."""
    x, y, _ = BODY.vertices.T
    return BODY.vertices * (1 + 0.04 * (week - 21)) + (week - 21) * np.stack(
        [np.sin(y / 12), 0 * x, np.cos(x / 9)], 1
    )


def without_motion(found, wanted):
    return np.linalg.norm(
        without_rigid_motion(wanted, found, np.ones(len(found))), axis=1
    )


def test_linear_growth_is_linear_between_uneven_weeks_in_any_pose():
    weeks = [21.0, 21.5, 23.5, 24.0]
    poses = [
        rigid(),
        rigid(10, 20, 30),
        rigid(0, -40, 5, shift=(9, 8, 7)),
        rigid(90, 0, 0),
    ]
    shapes = [
        transform_points(grown(week), pose)
        for week, pose in zip(weeks, poses, strict=True)
    ]
    path = path_through(weeks, shapes, BODY)
    for week in (21.25, 22.5, 23.0, 23.75):
        # but for the curvature that alignment of shapes that bend brings
        assert without_motion(path(week), grown(week)).max() < 0.02


def test_velocities_are_those_of_parabolas_and_do_not_overshoot():
    weeks = np.array([21.0, 22.0, 24.0, 24.5])
    at = np.array([0.0, 1.0, 5.0, 5.1])[:, None, None] * [[1.0, 0.0, 0.0]]
    found = limited_velocities(weeks, at)[:, 0, 0]
    # mean speeds 1, 2, 0.2: at 24 the parabola has 0.56, at most three times the
    # smaller
    assert found == pytest.approx([1.0, 4 / 3, 0.56, 0.2])
    jump = np.array([0.0, 0.1, 5.0, 5.5])[:, None, None] * [[1.0, 0.0, 0.0]]
    assert limited_velocities(weeks, jump)[1, 0, 0] == pytest.approx(0.3)


def test_two_scans_at_almost_the_same_time_do_not_bend_the_path():
    rng = np.random.default_rng(3)
    noise = 0.2 / np.sqrt(3) * rng.normal(size=(2, *BODY.vertices.shape))
    weeks = [21.0, 23.0, 23.1, 25.0]
    shapes = [grown(21.0), grown(23.0) + noise[0], grown(23.1) + noise[1], grown(25.0)]
    path = path_through(weeks, shapes, BODY)

    def error(week):
        return np.sqrt((without_motion(path(week), grown(week)) ** 2).mean())

    # the mean of two scans has 0.14 mm
    assert error(23.05) < 0.16
    assert max(error(week) for week in np.linspace(21, 25, 33)) < 0.2


def test_close_weeks_lie_on_a_line_through_their_mean_and_the_start_stays():
    weeks = np.array([21.0, 21.2, 23.0, 24.0, 24.3])
    places = np.array([0.0, 9.0, 2.0, 4.0, 6.0])[:, None, None] * np.ones((1, 1, 3))
    at, found = merged_shapes(weeks, places)
    assert at.tolist() == weeks.tolist()
    # the start stays; the mean of the last two is 5 at 24.15, 3 after the 2 at 23
    last = [5 + (week - 24.15) * 3 / 1.15 for week in (24.0, 24.3)]
    assert found[:, 0, 0] == pytest.approx([0.0, 0.2 * 2 / 2.0, 2.0, *last])
    # a stop next to them goes, others stay
    with_stops = np.array([21.0, 22.0, 23.0, 24.0, 24.1, 24.3])
    at, _ = merged_shapes(with_stops, np.zeros((6, 1, 3)), [22.0, 24.1])
    assert at.tolist() == [21.0, 22.0, 23.0, 24.0, 24.3]
    # a start and one scan are not merged
    assert merged_shapes(weeks[:2], places[:2])[1] == pytest.approx(places[:2])


def turned(angle):
    """Return a box of elements whose inner half is turned about its axis, as a
    whole."""
    mesh = box_mesh((4, 4, 4), (8.0, 8.0, 8.0))
    x, y, z = (mesh.vertices - mesh.vertices.mean(axis=0)).T
    fade = np.clip(1.5 - np.hypot(x, y) / 3, 0, 1) * angle
    c, s = np.cos(fade), np.sin(fade)
    return mesh, np.stack([c * x - s * y, s * x + c * y, z], axis=1)


def test_an_element_inverted_in_the_middle_of_a_straight_way_is_found():
    tet = np.array([[0, 1, 2, 3]])
    before = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    # half a turn about z: valid at both ends, flat in the middle
    after = before * [-1, -1, 1]
    assert volumes_between(after, tet) > 0
    assert inverted_on_the_way(before, after, tet).tolist() == [True]
    # less than half a turn stays valid: with positive Bernstein coefficients, and with
    # a negative one
    for degrees in (60, 150):
        turned_part = transform_points(before, rigid(0, 0, degrees))
        assert inverted_on_the_way(before, turned_part, tet).tolist() == [False]
    assert inverted_on_the_way(before, before * [1, 1, -1], tet).tolist() == [True]
    assert inverted_on_the_way(before, before * [0.1, 0.1, 0.1], tet).tolist() == [
        False
    ]


def test_elements_inverted_at_the_end_of_an_interval_are_found():
    mesh = box_mesh((4, 2, 2), (16.0, 8.0, 8.0))
    shapes = np.repeat(mesh.vertices[None], 2, axis=0)
    # a layer that has just passed the next one
    shapes[1, np.isclose(mesh.vertices[:, 0], 0.0), 0] += 4.1
    path = path_through([21.0, 22.0], shapes, mesh)
    (found,) = path.inverted
    corners = shapes[1][mesh.tets]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1])
    assert found.tolist() == np.flatnonzero(volumes < 0).tolist()
    assert len(found) > 0


def test_each_shape_is_aligned_with_the_one_before_by_volume():
    """A box that is bent to and fro: elements on the right are five times as long, and
    move on."""
    mesh = grid(
        [
            np.array([-8, -7, -6, -5, 0, 5, 10.0]),
            np.linspace(-6, 6, 5),
            np.linspace(-5, 5, 5),
        ]
    )
    sizes = vertex_sizes(mesh.vertices, mesh.tets)
    x = mesh.vertices[:, :1]
    bends = [np.zeros_like(x), np.where(x < -4.5, 1.0, 0.0), 0.01 * x**2]
    shapes = [
        transform_points(
            mesh.vertices + bend * [0.0, 0.0, 1.0],
            rigid(0, 10 * number, 20, shift=(number, 0.0, 5.0)),
        )
        for number, bend in enumerate(bends)
    ]
    path = path_through([21.0, 22.0, 23.0], shapes, mesh)
    for week in (21.0, 22.0):
        before, after = path(week), path(week + 1.0)
        # nothing is left of a motion from shape to shape
        assert without_rigid_motion(before, after, sizes) == pytest.approx(
            after - before, abs=1e-6
        )


@pytest.mark.parametrize("order", [1, 2])
def test_every_element_that_a_mean_of_shapes_inverts_may_be_inverted(order):
    mesh, after = turned(2.2)
    before = mesh.vertices - mesh.vertices.mean(axis=0)
    bent = before + 0.3 * np.sin(before[:, [1, 2, 0]])
    shapes = [before, bent, after]
    tets = mesh.tets
    if order == 2:
        curved = [quadratic(TetrahedralMesh(shape, tets)) for shape in shapes]
        shapes = [shape.vertices for shape in curved]
        tets = curved[0].tets
    shapes = np.stack(shapes)
    found = may_be_inverted(shapes, tets)
    assert 0 < found.sum() < len(found)
    n_inverted = 0
    for weights in np.random.default_rng(3).dirichlet(np.ones(3), 300):
        mean = np.tensordot(weights, shapes, axes=1)
        if order == 1:
            inverted = volumes_between(mean, tets) <= 0
        else:
            inverted = (coefficients(mean, tets)[:, AT_CORNERS] <= 0).any(axis=1)
        n_inverted += inverted.sum()
        assert found[inverted].all()
    assert n_inverted > 0
    # half of an element's volume may go, and the body may turn a little
    small = transform_points(before * [1.0, 0.5, 1.0], rigid(0, 0, 20))
    assert not may_be_inverted(np.stack([before, small]), mesh.tets).any()


@pytest.mark.parametrize("order", [1, 2])
def test_the_check_agrees_with_many_points_on_the_way(order):
    mesh, after = turned(2.2)
    before = mesh.vertices - mesh.vertices.mean(axis=0)
    if order == 2:
        mesh = quadratic(TetrahedralMesh(before, mesh.tets))
        before = mesh.vertices
        after = quadratic(TetrahedralMesh(after, mesh.corners)).vertices
    found = inverted_on_the_way(before, after, mesh.tets)
    volumes = np.stack(
        [
            volumes_between(before + t * (after - before), mesh.tets)
            for t in np.linspace(0, 1, 101)
        ]
    )
    sampled = volumes.min(axis=0) <= 0
    assert 0 < sampled.sum() < len(sampled)
    assert found[sampled].all()
    # bounds of quadratic elements may be below 0 where their volume is not
    assert (
        volumes.min(axis=0)[found] <= (1e-9 if order == 1 else 0.2) * volumes[0][found]
    ).all()
    assert (
        inverted_on_the_way(before, after, mesh.corners, least=0.5).sum() > found.sum()
        if order == 1
        else True
    )


def test_a_path_is_smooth_but_straight_near_an_element_that_would_be_inverted():
    # on the left a layer comes close to the next, fast, before that one moves on; the
    # right end moves late
    mesh = box_mesh((8, 8, 8), (32.0, 32.0, 32.0))
    shapes = np.repeat(mesh.vertices[None], 3, axis=0)
    left, right = (np.isclose(mesh.vertices[:, 0], place) for place in (-8.0, 12.0))
    assert left.sum() == right.sum() == 9 * 9
    for place, moves in (
        (-8.0, [3.8, 5.3]),
        (-4.0, [0.0, 1.5]),
        (12.0, [0.0, 2.0]),
        (16.0, [0.0, 2.0]),
    ):
        layer = np.isclose(mesh.vertices[:, 0], place)
        shapes[1:, layer, 0] += np.array(moves)[:, None]
    weeks = [21.0, 22.0, 23.0]
    path = path_through(weeks, shapes, mesh)
    assert [len(faults) for faults in path.inverted] == [0, 0]

    # the path if no element were inverted, through the same shapes, each aligned with
    # the one before
    places = np.stack([path(week) for week in weeks])
    velocities = limited_velocities(np.array(weeks), places)
    straight = 0.5 * (places[1] + places[2])
    smooth = straight + (velocities[1] - velocities[2]) / 8
    assert inverted_on_the_way(places[1], smooth, mesh.tets).sum() > 0
    bends = np.linalg.norm(smooth - straight, axis=1)
    assert bends[left].min() > 0.1
    assert bends[right].min() > 0.05
    middle = path(22.5)
    assert (np.linalg.norm(middle - straight, axis=1) < 0.5 * bends)[left].all()
    assert (
        np.linalg.norm(middle - smooth, axis=1)[right].max() < 0.05 * bends[right].min()
    )
