"""A body of quadratic elements is drawn to shapes: none of its curved elements folds
over, nor on the way."""

import logging
from itertools import pairwise

import numpy as np
import pytest
from shapes import box_mesh, ellipsoid_mesh, waves_on

from gyriflow.folding import elastic_fit
from gyriflow.folding.elastic_fit import ElasticFit
from gyriflow.geometry.alignment import rigid_fit
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.jacobians import EDGES, inverted_on_the_way, lower_bounds
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_surface,
    has_volume,
    linear_pieces,
    quadratic,
    volumes_between,
)

SEMI_AXES = (12.0, 14.0, 11.0)
BODY = quadratic(ellipsoid_mesh(4, SEMI_AXES))
USED = boundary_surface(BODY)[1]


def waves(height_mm):
    """Return the shape of the body, larger and with waves on its surface."""
    return 1.03 * BODY.vertices + waves_on(BODY, SEMI_AXES, height_mm, 8.0)


def mean_misfit(positions, shape):
    """Return the mean distance in mm of vertices of the surface."""
    return np.linalg.norm(positions - shape, axis=1)[USED].mean()


def folded_over(positions, body=BODY):
    """Return the number of elements whose Jacobian may not be positive everywhere."""
    return int((lower_bounds(positions, body.tets) <= 0).sum())


# the highest ones turn the corners of curved elements inside out, though the linear
# pieces of these stay valid
@pytest.mark.parametrize("height_mm", [0.5, 2.5])
def test_waves_leave_no_curved_element_that_folds_over(height_mm):
    shape = waves(height_mm)
    assert folded_over(shape) > 20
    body = ElasticFit(BODY)
    found = body.follow(shape)
    assert folded_over(found) == 0
    followed = mean_misfit(found, shape)
    assert followed < 0.75 * mean_misfit(waves(0.0), shape)
    found = body.draw(shape[USED])
    assert folded_over(found) == 0
    drawn = mean_misfit(found, shape)
    # the higher waves bend elements too much: the body is only moved to the shape as a
    # whole
    assert drawn < (0.6 if height_mm < 1 else 1.01) * followed


@pytest.mark.parametrize(("way", "height_mm"), [("follow", 0.5), ("move_to", 0.1)])
def test_a_body_stays_where_its_curved_elements_cannot_follow_and_says_so(
    monkeypatch, caplog, way, height_mm
):
    monkeypatch.setattr(
        elastic_fit, "may_fold_over", lambda positions, tets: np.full(len(tets), True)
    )
    body = ElasticFit(BODY)
    with caplog.at_level(logging.WARNING):
        found = getattr(body, way)(waves(height_mm))
    np.testing.assert_allclose(found, BODY.vertices, atol=1e-9)
    assert body.way_from(BODY.vertices) == []
    assert "does not follow" in caplog.text


def test_a_body_is_held_only_around_the_elements_that_fold_over(monkeypatch):
    real = elastic_fit.may_fold_over
    free = ElasticFit(BODY).follow(waves(0.5))
    first_corners = BODY.vertices[BODY.tets[:, 0]]
    element = np.argmin(np.linalg.norm(first_corners - [12, 0, 0], axis=1))
    calls = []

    def one_folds_over_at_first(positions, tets):
        is_bad = real(positions, tets)
        is_bad[element] |= not calls
        calls.append(1)
        return is_bad

    monkeypatch.setattr(elastic_fit, "may_fold_over", one_folds_over_at_first)
    held = ElasticFit(BODY).follow(waves(0.5))
    assert folded_over(held) == 0
    at = BODY.vertices[BODY.tets[element]].mean(axis=0)
    distance = np.linalg.norm(BODY.vertices - at, axis=1)
    difference = np.linalg.norm(held - free, axis=1)
    moved = np.linalg.norm(free - BODY.vertices, axis=1)
    # a Gaussian of 2 mm: all of the displacement is taken back there, none far away
    own = BODY.tets[element]
    assert difference[own] == pytest.approx(moved[own], rel=0.2)
    assert difference[distance > 7.0].max() < 0.05


def test_a_straight_move_leaves_no_linear_piece_inverted():
    corners = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10.0]])
    element = quadratic(TetrahedralMesh(corners, np.array([[0, 1, 2, 3]])))
    # its sides bow so far that two pieces turn over, while the element stays valid
    shape = element.vertices.copy()
    shape[4:] = [
        (5.0, 1.5, -1.9),
        (-1.9, 5.5, 2.6),
        (3.1, 2.6, 3.0),
        (7.9, 3.0, 0.8),
        (7.0, -1.5, 6.5),
        (0.1, 6.1, 6.7),
    ]
    pieces = linear_pieces(element)
    assert has_volume(shape, element.tets).all()
    assert (volumes_between(shape, pieces) < 0).sum() == 2
    found = ElasticFit(element).move_to(shape)
    assert has_volume(found, element.tets).all()
    assert (volumes_between(found, pieces) > 0).all()


def bar(order):
    mesh = box_mesh((18, 3, 3) if order == 1 else (12, 2, 2), (36.0, 6.0, 6.0))
    return mesh if order == 1 else quadratic(mesh)


def twisted(mesh, turn):
    """Return a bar whose ends are turned about its axis, by an angle in radians against
    each other."""
    x, y, z = mesh.vertices.T
    c, s = np.cos(turn * x / 36), np.sin(turn * x / 36)
    return np.stack([x, c * y - s * z, s * y + c * z], axis=1)


def inverted_along(mesh, shapes):
    """Return the number of elements inverted between each two shapes that follow each
    other, each aligned before."""
    numbers = []
    for before, after in pairwise(shapes):
        sizes = vertex_sizes(before, linear_pieces(mesh))
        aligned = transform_points(after, rigid_fit(after, before, sizes))
        numbers.append(inverted_on_the_way(before, aligned, mesh.tets).sum())
    return numbers


@pytest.mark.parametrize("order", [1, 2])
def test_stops_lie_where_the_straight_way_to_a_shape_inverts_elements(order):
    mesh = bar(order)
    body = ElasticFit(mesh)
    body.follow(twisted(mesh, 0.6 * np.pi))
    assert body.way_from(mesh.vertices) == []
    # places near both ends turn by more than half a turn
    for turn in (1.2, 1.8, 2.4):
        body.follow(twisted(mesh, turn * np.pi))
    wanted = body.positions_mm
    assert inverted_along(mesh, [mesh.vertices, wanted])[0] > 20
    way = body.way_from(mesh.vertices)
    assert [part for part, _ in way] == pytest.approx([0.5], abs=0.1)
    stops = [shape for _, shape in way]
    shapes = [mesh.vertices, *stops, body.positions_mm]
    assert inverted_along(mesh, shapes) == [0, 0]
    # the shape itself has no fault, so it stays
    assert np.abs(body.positions_mm - wanted).max() < 1e-9


def test_states_whose_curved_elements_fold_over_are_no_stops(caplog):
    mesh = bar(2)
    body = ElasticFit(mesh)
    for turn in (0.8, 1.6, 2.4):
        body.follow(twisted(mesh, turn * np.pi))
    a, b, middle = mesh.tets[40, [0, 1, 4]]
    for shape in body._passed:
        shape[middle] += 0.3 * (shape[b] - shape[a])
    assert all(folded_over(shape, mesh) for shape in body._passed)
    with caplog.at_level(logging.WARNING):
        assert body.way_from(mesh.vertices) == []
    # nothing is left to pass: it is said, and the shape stays valid
    assert "inverted" in caplog.text
    assert folded_over(body.positions_mm, mesh) == 0


@pytest.mark.parametrize("breaks_another", [False, True])
def test_flat_elements_between_straight_sides_are_opened(monkeypatch, breaks_another):
    # a corner inside is moved towards the face opposite to it, with the middles of its
    # sides
    mesh = quadratic(ellipsoid_mesh(6, SEMI_AXES))
    inner = np.setdiff1d(mesh.corners, boundary_surface(mesh)[1])
    from_middle = np.linalg.norm(mesh.vertices[inner], axis=1)
    centre, other = inner[[from_middle.argmin(), from_middle.argmax()]]
    around = mesh.tets[(mesh.corners == centre).any(axis=1)]
    opposite = np.setdiff1d(around[0, :4], centre)
    places = mesh.vertices.copy()
    face = places[opposite].mean(axis=0)
    places[centre] = face + 0.05 * (places[centre] - face)
    places[around[:, 4:]] = places[around[:, EDGES]].mean(axis=2)
    body = ElasticFit(mesh)
    pieces = linear_pieces(mesh)

    def least_ratio(positions):
        whole = volumes_between(mesh.vertices, pieces)
        return (volumes_between(positions, pieces) / whole).min()

    assert least_ratio(places) == pytest.approx(0.05)
    if breaks_another:
        find_opened = body._opened

        def opened_elsewhere_broken(positions):
            opened = find_opened(positions).copy()
            opened[other] += [3.0, 0.0, 0.0]
            return opened

        monkeypatch.setattr(body, "_opened", opened_elsewhere_broken)
    valid = body._valid(places, mesh.vertices)
    assert least_ratio(valid) > 0.15
    assert folded_over(valid, mesh) == 0
    assert valid[other] == pytest.approx(places[other])


@pytest.mark.parametrize("brings_faults", [False, True])
def test_faults_that_straight_sides_bring_onto_the_way_are_warned_of(
    monkeypatch, caplog, brings_faults
):
    body = ElasticFit(BODY)
    bent = waves(6.0)

    def straighten(places, start):
        return bent if brings_faults else places

    monkeypatch.setattr(body, "_valid", straighten)
    assert body.way_from(BODY.vertices) == []
    warned = [record for record in caplog.records if "straight sides" in record.message]
    assert len(warned) == brings_faults


def test_a_shape_is_as_far_as_the_valid_one_near_it(monkeypatch):
    # the smoothed shape is valid only far away, so the body follows
    shape = waves(0.1)
    body = ElasticFit(BODY)
    followed = []
    follow = body.follow
    monkeypatch.setattr(body, "_valid_near", lambda places: 1.2 * BODY.vertices)
    monkeypatch.setattr(body, "follow", lambda goal: followed.append(1) or follow(goal))
    found = body.move_to(shape)
    assert followed
    assert mean_misfit(found, shape) < 0.5
