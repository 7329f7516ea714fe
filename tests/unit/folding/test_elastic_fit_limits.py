"""Limits and weights of a body that is drawn to shapes, seen at the single steps that
it takes: nothing is solved."""

import logging
import math
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from shapes import ellipsoid_mesh

from gyriflow.errors import SolverError
from gyriflow.folding.elastic_fit import MODULUS_PA, UNTANGLING_MM, ElasticFit
from gyriflow.folding.stretches import log_stretch, unpacked
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.tetrahedra import (
    boundary_surface,
    grid,
    linear_pieces,
    volumes_between,
)
from gyriflow.geometry.triangles import vertex_areas

BALL = ellipsoid_mesh(8, (20.0, 24.0, 18.0))
SMALL = ellipsoid_mesh(8, (7.0, 8.4, 6.3))
# elements and triangles above are five times as long as those below
UNEVEN = grid(
    [
        np.linspace(-6, 6, 5),
        np.linspace(-5, 5, 5),
        np.array([-10, -9, -8, -7, -6, -5, 0, 5, 10.0]),
    ]
)


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
    body = ElasticFit(BALL)
    body.positions_mm = 0.1 * BALL.vertices
    body.follow(factor * body.positions_mm)
    assert len(steps) == n_steps
    # each takes its part of what is left
    start = body.boundary.vertices
    for left, (goals, _, strain) in zip(range(n_steps, 0, -1), steps, strict=True):
        assert goals == pytest.approx(start * (1 + (factor - 1) / left))
        assert strain[:, :3] == pytest.approx(
            np.full((len(strain), 3), math.log(1 + (factor - 1) / left))
        )


def test_the_stretch_that_a_body_grows_by_is_smoothed_over_its_length(steps):
    # a bar that grows along z in its upper half, in fine layers
    bar = grid([np.linspace(-2, 2, 3), np.linspace(-2, 2, 3), np.linspace(-10, 10, 81)])
    z = bar.vertices[:, 2]
    shape = bar.vertices + np.outer(0.1 * np.maximum(z, 0.0), [0.0, 0.0, 1.0])
    ElasticFit(bar).follow(shape)
    strain = unpacked(steps[0][2])[:, 2, 2]
    heights = np.unique(z)
    profile = np.array([strain[z == height].mean() for height in heights])
    slope = np.diff(profile)
    middles = (heights[1:] + heights[:-1]) / 2
    assert slope.sum() == pytest.approx(math.log(1.1), rel=0.02)
    mean = np.average(middles, weights=slope)
    assert np.sqrt(np.average((middles - mean) ** 2, weights=slope)) == pytest.approx(
        1.5, rel=0.05
    )


@pytest.mark.parametrize(("left_mm", "is_refused"), [(2.9, False), (3.1, True)])
def test_a_shape_is_refused_if_the_body_stays_more_than_three_millimetres_from_it(
    steps, left_mm, is_refused
):
    body = ElasticFit(BALL)
    radial_mm = math.sqrt(3 * np.mean(body.boundary.vertices**2))
    shape = (1 + left_mm / radial_mm) * BALL.vertices
    if not is_refused:
        body.follow(shape)
        return
    with pytest.raises(SolverError, match=r"3\.1 mm.*not solved"):
        body.follow(shape)


def test_bodies_are_aligned_with_their_shapes_by_area_and_by_volume(steps):
    """The lower half moves by half a millimetre: a third of all area, and most of the
    vertices."""
    shape = UNEVEN.vertices + np.where(
        UNEVEN.vertices[:, 2:] < -4.0, [0.5, 0.0, 0.0], 0.0
    )
    surface, used = boundary_surface(UNEVEN)
    body = ElasticFit(UNEVEN)
    body.follow(shape)
    ElasticFit(UNEVEN).draw(shape[used])
    for goals, _, _ in steps:
        assert np.average(
            goals - surface.vertices, axis=0, weights=vertex_areas(surface)
        ) == pytest.approx(0, abs=1e-6)
    fitted = transform_points(shape, body._fit(shape, UNEVEN.vertices))
    sizes = vertex_sizes(UNEVEN.vertices, linear_pieces(UNEVEN))
    assert np.average(fitted - UNEVEN.vertices, axis=0, weights=sizes) == pytest.approx(
        0, abs=1e-6
    )


def test_a_step_is_as_long_as_the_shortest_that_a_contribution_allows():
    problem = ElasticFit(UNEVEN)._problem
    rest = problem.rest()
    allowed = []
    for share in (0.7, 0.3, 1.0):
        allowed.append(SimpleNamespace(max_step=partial(_fraction, share)))
    problem.contributions = allowed
    assert problem.max_step(rest, rest) == 0.3
    problem.contributions = []
    assert problem.max_step(rest, rest) == 1.0


def _fraction(share, u, direction):
    return share


def test_springs_are_as_strong_as_their_area():
    body = ElasticFit(UNEVEN)
    surface, used = boundary_surface(UNEVEN)
    areas, lengths = vertex_areas(surface), np.linspace(0.5, 2.0, len(used))
    gaps = 0.1 * np.random.default_rng(0).normal(size=surface.vertices.shape)
    body._springs.draw_to(surface.vertices - gaps, areas, lengths)
    energy = body._springs.energy(np.zeros((body._domain.n_owned, 3)))
    joules = 0.5 * MODULUS_PA * (areas / lengths * (gaps**2).sum(axis=1)).sum() * 1e-9
    assert energy == pytest.approx(joules)


def test_a_spring_draws_over_a_millimetre_or_twice_the_mean(steps):
    body = ElasticFit(BALL)
    start = body.boundary.vertices
    outward = start / np.linalg.norm(start, axis=1)[:, None]
    for usual_mm, largest_mm in ((0.1, 1.0), (2.0, 4.0)):
        steps.clear()
        # waves without a motion, and single vertices far off
        pull_mm = usual_mm * np.sign(np.sin(start[:, 1] / 2))
        pull_mm[::200] = 30.0
        body.draw(start + pull_mm[:, None] * outward)
        lengths = np.linalg.norm(steps[0][0] - start, axis=1)
        bound = max(largest_mm, 2.2 * math.sqrt(np.mean(pull_mm**2)))
        assert lengths.max() < bound
        assert np.median(lengths) == pytest.approx(usual_mm, rel=0.6)


def inside_vertex(mesh, place):
    """Return the vertex inside a mesh that is nearest to a place."""
    inside = np.setdiff1d(np.arange(len(mesh.vertices)), boundary_surface(mesh)[1])
    return inside[np.argmin(np.linalg.norm(mesh.vertices[inside] - place, axis=1))]


def flattened(mesh, share, place=(8.0, 8.0, 5.0)):
    """Return places at which a vertex inside has gone a share of the way to the
    opposite face of an element."""
    vertex = inside_vertex(mesh, place)
    tet = mesh.tets[(mesh.tets == vertex).any(axis=1)][0]
    places = mesh.vertices.copy()
    places[vertex] += share * (places[tet[tet != vertex]].mean(axis=0) - places[vertex])
    return places


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
    volumes = volumes_between(found, SMALL.tets) / volumes_between(
        SMALL.vertices, SMALL.tets
    )
    assert volumes.min() > 0.2
    # a motion of all is kept, and what is far from the fault stays as it is wanted
    distance = np.linalg.norm(
        SMALL.vertices - SMALL.vertices[inside_vertex(SMALL, place)], axis=1
    )
    assert moved[distance > 6.0].max() < 0.001
    others = distance > 0.0
    assert np.linalg.norm(found - SMALL.vertices - shift, axis=1)[others].max() < 0.5


def test_only_elements_that_lose_half_their_volume_stretch_and_by_a_limited_amount():
    body = ElasticFit(BALL)
    for share, largest in ((0.35, 0.0), (0.99, 0.5)):
        body.positions_mm = flattened(BALL, share)
        logs = log_stretch(body._flattening()[:, 0])
        assert np.abs(np.linalg.eigvalsh(logs)).max() == pytest.approx(
            largest, abs=1e-6
        )


def test_elements_without_a_vertex_inside_are_opened_by_small_moves_of_the_boundary():
    body = ElasticFit(UNEVEN)
    used = boundary_surface(UNEVEN)[1]
    tet = UNEVEN.tets[np.isin(UNEVEN.tets, used).all(axis=1)][0]
    places = UNEVEN.vertices.copy()
    places[tet[0]] += 0.99 * (places[tet[1:]].mean(axis=0) - places[tet[0]])
    # along each axis
    moves = np.abs(body._opened(places) - places)
    assert 0.01 < moves[used].max() < 0.1 + 1e-6


def test_a_distance_is_that_of_nearly_all_of_the_boundary():
    body, used = ElasticFit(BALL), boundary_surface(BALL)[1]
    moved, few = BALL.vertices.copy(), used[::30]
    moved[few] *= 1.1
    moved[np.setdiff1d(np.arange(len(moved)), used)[::2]] += 5.0 * np.array(
        [[1.0, 0, 0]]
    )
    moved[np.setdiff1d(np.arange(len(moved)), used)[1::2]] -= 5.0 * np.array(
        [[1.0, 0, 0]]
    )
    assert 1.0 < body._distance(BALL.vertices, moved) < 3.0


def test_a_body_that_is_not_solved_and_is_close_enough_is_kept_without_a_word(
    steps, caplog
):
    with caplog.at_level(logging.WARNING):
        found = ElasticFit(BALL).follow(1.02 * BALL.vertices)
    assert found == pytest.approx(BALL.vertices, abs=1e-6)
    assert caplog.messages == []
