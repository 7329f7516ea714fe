"""A body is drawn to shapes that it can have: without inverted elements, and without
folds that cross."""

import math
from dataclasses import replace

import numpy as np
import pytest
from facts import Facts
from shapes import box_mesh, ellipsoid_mesh, joined, rigid, waves_on

from gyriflow.errors import SolverError
from gyriflow.folding import elastic_fit
from gyriflow.folding.elastic_fit import UNTANGLING_MM, ElasticFit
from gyriflow.folding.linear_solver import NotConvergedError
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.matching import faces_that_cross
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_surface,
    volumes_between,
)
from gyriflow.geometry.triangles import TriangleMesh, rms_length

SEMI_AXES = (20.0, 24.0, 18.0)
BODY = ellipsoid_mesh(8, SEMI_AXES)
SMALL = ellipsoid_mesh(8, (7.0, 8.4, 6.3))
COARSE = ellipsoid_mesh(4, SEMI_AXES)
"""For tests in which the steps of the solver are replaced."""
USED = boundary_surface(BODY)[1]


def ratios(positions, body=BODY):
    """Return the volumes of elements over those at the start."""
    before = volumes_between(body.vertices, body.tets)
    return volumes_between(positions, body.tets) / before


def waves(height_mm, length_mm):
    return 1.05 * BODY.vertices + waves_on(BODY, SEMI_AXES, height_mm, length_mm)


def misfits(positions, shape):
    """Return the distances in mm of vertices of the surface."""
    return np.linalg.norm(positions - shape, axis=1)[USED]


def test_a_shape_with_inverted_elements_is_followed_by_one_without():
    shape = waves(1.5, 10.0)
    assert (ratios(shape) < 0).sum() > 50
    found = ElasticFit(BODY).follow(shape)
    assert ratios(found).min() > 0.05
    start = misfits(1.05 * BODY.vertices, shape)
    assert misfits(found, shape).mean() < 0.7 * start.mean()


def test_a_shape_that_a_body_can_have_is_reached_where_it_lies():
    pose = rigid(30, -20, 10, shift=(50.0, 0.0, -9.0))
    shape = transform_points(waves(0.5, 30.0), pose)
    body = ElasticFit(BODY)
    followed = body.follow(shape)
    before = misfits(followed, shape)
    assert np.linalg.norm(followed - shape, axis=1).max() < 0.3
    assert misfits(body.draw(shape[USED]), shape).mean() < 0.7 * before.mean()
    assert body.boundary.vertices == pytest.approx(body.positions_mm[USED])


def test_a_shape_that_no_tissue_can_have_is_followed_by_a_limited_stretch():
    # the core shrinks to a fourth of its length, to a sixtieth of its volume
    in_core = np.linalg.norm(BODY.vertices / [20.0, 24.0, 18.0], axis=1) < 0.55
    assert 10 < in_core.sum() < len(in_core) / 4
    collapsed = np.where(in_core[:, None], 0.25, 1.0) * BODY.vertices
    assert ratios(ElasticFit(BODY).follow(collapsed)).min() > 0.2
    # a vertex inside is lost by 14 mm
    stray = BODY.vertices.copy()
    stray[np.argmin(np.linalg.norm(stray - [6.0, 0.0, 0.0], axis=1)), 1] += 14.0
    found = ElasticFit(BODY).follow(stray)
    assert np.linalg.norm(found - BODY.vertices, axis=1).max() < 0.3


def slit_block():
    """Return a block from z = 0 to 12 with a slit 1 mm wide in the plane x = 0, open
    above z = 4."""
    box = box_mesh((11, 6, 7), (20.0, 10.0, 12.0))
    places = box.vertices + [0.0, 0.0, 6.0]
    x, _, z = places[box.tets].mean(axis=1).T
    inside = (np.abs(x) < 1.0) & (z > 4.0)
    used, numbers = np.unique(box.tets[~inside], return_inverse=True)
    return TetrahedralMesh(places[used], numbers.reshape(-1, 4))


def test_a_step_that_is_not_solved_goes_as_far_as_it_comes_and_is_refused_by_place(
    monkeypatch,
):
    unsolvable = {"max_newton": 1, "newton_tolerance": 1e-12, "min_progress": 1.0}
    settings = replace(elastic_fit.SETTINGS, **unsolvable)
    monkeypatch.setattr(elastic_fit, "SETTINGS", settings)
    shape = waves(0.5, 20.0)
    body = ElasticFit(BODY)
    body.positions_mm = 1.05 * BODY.vertices
    before = misfits(body.positions_mm, shape)
    found = body.draw(shape[USED])
    assert misfits(found, shape).mean() < 0.3 * before.mean()
    assert (volumes_between(found, BODY.tets) > 0).all()
    monkeypatch.setattr(elastic_fit, "MAX_LEFT_MM", 0.3)
    with pytest.raises(SolverError, check=Facts("det F", "element", "mm")):
        ElasticFit(BODY).follow(BODY.vertices * [1.6, 0.6, 1.0])


def test_what_cannot_be_drawn_is_held_and_the_rest_is_drawn():
    mesh = slit_block()
    surface, used = boundary_surface(mesh)
    goals = mesh.vertices[used].copy()
    # the walls of the slit would move through each other
    depth = np.clip((goals[:, 2] - 4) / 8, 0, 1)
    goals[:, 0] -= 1.5 * np.sign(goals[:, 0]) * depth
    bottom = goals[:, 2] == 0
    goals[bottom, 2] -= 0.5 * np.sin(goals[bottom, 0] / 3)
    body = ElasticFit(mesh)
    found = body.draw(goals)[used]
    assert len(faces_that_cross(TriangleMesh(found, surface.faces))) == 0
    left = np.linalg.norm(found - goals, axis=1)
    before = np.linalg.norm(mesh.vertices[used] - goals, axis=1)
    assert left[bottom].mean() < 0.3 * before[bottom].mean()
    assert left.mean() < 0.6 * before.mean()


def inside_vertex(mesh, place):
    """Return the vertex inside a mesh that is nearest to a place."""
    inside = np.setdiff1d(np.arange(len(mesh.vertices)), boundary_surface(mesh)[1])
    return inside[np.argmin(np.linalg.norm(mesh.vertices[inside] - place, axis=1))]


def flattened(mesh=BODY, share=0.9, place=(8.0, 8.0, 5.0)):
    """Return places at which a vertex inside has gone a share of the way to the
    opposite face of an element."""
    vertex = inside_vertex(mesh, place)
    tet = mesh.tets[(mesh.tets == vertex).any(axis=1)][0]
    places = mesh.vertices.copy()
    places[vertex] += share * (places[tet[tet != vertex]].mean(axis=0) - places[vertex])
    return places


def test_flat_elements_are_elastic_and_open_in_the_next_steps():
    body = ElasticFit(BODY)
    body.positions_mm = flattened()
    for _ in range(3):
        found = body.draw(body.boundary.vertices)
    assert ratios(found).min() > 0.25
    assert found[USED] == pytest.approx(BODY.vertices[USED], abs=0.05)
    # nothing moves where the elements are as those around them
    even = BODY.vertices * [1.2, 1.0, 0.9]
    body.positions_mm = even
    assert body.draw(even[USED]) == pytest.approx(even, abs=1e-6)


def test_a_step_that_flat_elements_prevent_is_made_without_their_stress(monkeypatch):
    body = ElasticFit(BODY)
    solver, stretches = body._solver, []
    solve, set_step = solver.solve, body._problem.set_step

    def set_and_note(mu, G_inverse, V, part):
        stretches.append(V)
        set_step(mu, G_inverse, V, part)

    def fail_with_stress():
        if stretches[-1] is None:
            return solve()
        solver.iterates = []
        raise NotConvergedError("no descent direction")

    monkeypatch.setattr(body._problem, "set_step", set_and_note)
    monkeypatch.setattr(solver, "solve", fail_with_stress)
    shape = 1.05 * BODY.vertices
    shape[:, 2] += 0.5 * np.sin(BODY.vertices[:, 0] / 5)
    before = misfits(BODY.vertices, shape).mean()
    assert misfits(body.draw(shape[USED]), shape).mean() < 0.3 * before


def test_elements_that_a_step_leaves_flat_are_opened(monkeypatch):
    monkeypatch.setattr(ElasticFit, "_flattening", lambda self: None)
    body = ElasticFit(BODY)
    body.positions_mm = flattened()
    drawn = body.draw(body.boundary.vertices)
    assert ratios(drawn).min() == pytest.approx(0.2, abs=1e-6)


def test_a_shape_whose_change_around_faults_flattens_elements_is_opened(monkeypatch):
    body = ElasticFit(BODY)
    body.positions_mm = BODY.vertices
    places = flattened()
    # as if the change had made these
    monkeypatch.setattr(
        body, "_untangled", lambda before, after, lengths: (places, np.empty((0, 3)))
    )
    assert ratios(body.move_to(BODY.vertices)).min() == pytest.approx(0.2, abs=1e-6)
    assert body.way_from(BODY.vertices) == []
    body.positions_mm, body._moved_straight = BODY.vertices, False
    assert body.way_from(BODY.vertices) == []
    assert ratios(body.positions_mm).min() == pytest.approx(0.2, abs=1e-6)


@pytest.mark.parametrize(
    ("height_mm", "changed_mm", "is_followed"), [(0.7, 0.17, False), (1.0, 0.42, True)]
)
def test_a_shape_that_would_change_much_around_faults_is_followed(
    monkeypatch, height_mm, changed_mm, is_followed
):
    shape = waves(height_mm, 12.0)
    body = ElasticFit(BODY)
    # smoothing removes all faults
    untangled, faults = body._untangled(BODY.vertices, shape, UNTANGLING_MM)
    assert len(faults) == 0
    change_mm = rms_length((untangled - shape)[USED])
    assert change_mm == pytest.approx(changed_mm, abs=0.02)
    followed = []
    follow = body.follow
    monkeypatch.setattr(body, "follow", lambda goal: followed.append(1) or follow(goal))
    found = body.move_to(shape)
    assert bool(followed) == is_followed
    assert rms_length((found - shape)[USED]) < 0.2
    assert ratios(found).min() > 0.1


@pytest.mark.parametrize("is_refused", [False, True])
def test_a_body_that_stays_behind_when_it_follows_is_moved_to_the_smoothed_shape(
    monkeypatch, is_refused
):
    shape = waves(1.0, 12.0)
    body = ElasticFit(BODY)
    untangled, _ = body._untangled(BODY.vertices, shape, UNTANGLING_MM)
    change_mm = rms_length((untangled - shape)[USED])

    def stay_behind(goal):
        body._passed.append(goal)
        body.positions_mm = BODY.vertices + 5.0
        if is_refused:
            raise SolverError("a shape cannot be reached")

    monkeypatch.setattr(body, "follow", stay_behind)
    monkeypatch.setattr(body, "draw", lambda goals: BODY.vertices)
    found = body.move_to(shape)
    assert rms_length((BODY.vertices - shape)[USED]) > change_mm
    assert rms_length((found - shape)[USED]) == pytest.approx(change_mm, abs=0.03)
    assert body.way_from(BODY.vertices) == []


def two_boxes(shift_mm):
    """Return two boxes, the right one shifted along x from where it is 0.5 mm away from
    the left one."""
    box = box_mesh((4, 4, 4), (6.0, 6.0, 6.0))
    return joined((box, np.zeros(3)), (box, [6.5 + shift_mm, 0.3, 0.2]))


def test_a_body_is_not_moved_to_a_shape_whose_faces_cross():
    shape = two_boxes(-0.8).vertices
    body = ElasticFit(two_boxes(0.0))
    # no element is inverted, only the two walls have passed through each other
    assert (
        len(faces_that_cross(TriangleMesh(shape[body._used], body.boundary.faces))) > 0
    )
    found = body.move_to(shape)
    assert len(faces_that_cross(body.boundary)) == 0
    # the boxes have come nearer to each other than they were
    left, right = np.split(found[:, 0], 2)
    assert 5.7 < right.mean() - left.mean() < 6.3


def test_stops_are_looked_for_in_halves_of_halves_of_halves(monkeypatch):
    # twenty states of growth, as if each way between two of them inverted an element
    body = ElasticFit(COARSE)
    states = [(1 + 0.01 * number) * COARSE.vertices for number in range(21)]
    body._passed = states[1:-1]
    body.positions_mm = states[-1]
    fault = COARSE.vertices[:1]
    monkeypatch.setattr(
        body, "_untangled", lambda before, after, lengths: (after, fault)
    )
    starts = []

    def note_start(before, places):
        starts.append(before)
        return places

    monkeypatch.setattr(body, "_opened_after", note_start)
    way = body.way_from(COARSE.vertices)
    fractions = [fraction for fraction, _ in way]
    assert fractions == pytest.approx(np.arange(1, 8) / 8, abs=0.06)
    # what opens a shape is judged on the way from the last stop
    np.testing.assert_array_equal(starts, [way[-1][1]])


@pytest.fixture
def steps(monkeypatch):
    """Return the steps that bodies take, as goals, lengths of springs and strains; the
    bodies stay where they are."""
    taken = []

    def note(self, goals, lengths, strain):
        taken.append((goals, lengths, strain))
        return "not solved"

    monkeypatch.setattr(ElasticFit, "_step", note)
    return taken


@pytest.mark.parametrize(
    ("factor", "n_steps"), [(1.09, 1), (1.12, 2), (1.28, 3), (1 / 1.12, 2)]
)
def test_a_body_grows_by_a_tenth_in_a_step_at_most(steps, factor, n_steps):
    body = ElasticFit(COARSE)
    body.positions_mm = 0.1 * COARSE.vertices
    body.follow(factor * body.positions_mm)
    assert len(steps) == n_steps
    # each takes its part of what is left
    start = body.boundary.vertices
    for left, (goals, _, strain) in zip(range(n_steps, 0, -1), steps, strict=True):
        assert goals == pytest.approx(start * (1 + (factor - 1) / left))
        assert strain[:, :3] == pytest.approx(
            np.full((len(strain), 3), math.log(1 + (factor - 1) / left))
        )


@pytest.mark.parametrize(("left_mm", "is_refused"), [(2.9, False), (3.1, True)])
def test_a_shape_is_refused_if_the_body_stays_more_than_three_millimetres_from_it(
    steps, left_mm, is_refused, caplog
):
    body = ElasticFit(COARSE)
    radial_mm = math.sqrt(3 * np.mean(body.boundary.vertices**2))
    shape = (1 + left_mm / radial_mm) * COARSE.vertices
    if is_refused:
        with pytest.raises(SolverError, match=r"3\.1 mm.*not solved"):
            body.follow(shape)
    else:
        assert body.follow(shape) == pytest.approx(COARSE.vertices, abs=1e-6)
        assert caplog.messages == []


@pytest.mark.parametrize(
    ("share", "is_changed"), [(0.7, False), (0.85, True), (1.1, True)]
)
def test_a_displacement_is_smoothed_only_around_elements_that_lose_most_of_their_volume(
    share, is_changed
):
    body, shift, place = ElasticFit(SMALL), np.array([0.3, -0.2, 0.1]), [2.8, 2.8, 1.75]
    wanted = flattened(SMALL, share, place) + shift
    found, faults = body._untangled(SMALL.vertices, wanted, UNTANGLING_MM)
    assert len(faults) == 0
    moved = np.linalg.norm(found - wanted, axis=1)
    assert (moved.max() > 0.1) == is_changed
    assert ratios(found, SMALL).min() > 0.2
    # a motion of all is kept, and what is far from the fault stays as it is wanted
    fault = SMALL.vertices[inside_vertex(SMALL, place)]
    distance = np.linalg.norm(SMALL.vertices - fault, axis=1)
    assert moved[distance > 6.0].max() < 0.001
    others = distance > 0.0
    assert np.linalg.norm(found - SMALL.vertices - shift, axis=1)[others].max() < 0.5
