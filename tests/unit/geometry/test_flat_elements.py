"""Flat elements are opened by small moves of a few vertices."""

import numpy as np
import pytest
from shapes import ellipsoid_mesh

from gyriflow.geometry.flat_elements import open_flat_elements
from gyriflow.geometry.tetrahedra import boundary_surface, volumes_between

BODY = ellipsoid_mesh(5, (20.0, 24.0, 18.0))
VOLUMES = volumes_between(BODY.vertices, BODY.tets)
USED = boundary_surface(BODY)[1]
INNER = np.setdiff1d(np.arange(len(BODY.vertices)), USED)
LONGEST_MM = np.where(np.isin(np.arange(len(BODY.vertices)), USED), 0.0, np.inf)


def ratios(places):
    return volumes_between(places, BODY.tets) / VOLUMES


def flattened(share):
    """Return places at which one vertex inside has gone a share of the way to the
    opposite face, and the vertex."""
    vertex = INNER[np.argmin(np.linalg.norm(BODY.vertices[INNER] - [8, 8, 5], axis=1))]
    tet = BODY.tets[(BODY.tets == vertex).any(axis=1)][0]
    opposite = BODY.vertices[tet[tet != vertex]].mean(axis=0)
    places = BODY.vertices.copy()
    places[vertex] += share * (opposite - places[vertex])
    return places, vertex


def test_a_flat_element_is_opened_to_what_is_asked_by_a_small_move():
    places, vertex = flattened(0.9)
    assert 0 < ratios(places).min() < 0.15
    found = open_flat_elements(places, BODY.tets, VOLUMES, LONGEST_MM, 0.2)
    assert ratios(found).min() == pytest.approx(0.2, abs=1e-6)
    assert (found != places).any(axis=1).sum() == 1
    # less than the vertex would have to go back
    back = np.linalg.norm(places[vertex] - BODY.vertices[vertex])
    assert 0 < np.linalg.norm(found - places) < 0.5 * back


def test_nothing_moves_where_nothing_is_flat():
    places, _ = flattened(0.5)
    assert ratios(places).min() > 0.2
    assert open_flat_elements(places, BODY.tets, VOLUMES, LONGEST_MM, 0.2) is places


def test_vertices_move_no_further_than_they_may():
    places, vertex = flattened(0.9)
    longest_mm = np.full(len(places), 0.01)
    found = open_flat_elements(places, BODY.tets, VOLUMES, longest_mm, 0.2)
    moves = np.abs(found - places).max(axis=1)
    assert 0.005 < moves.max() <= 0.01 + 1e-9
    assert ratios(places).min() < ratios(found).min() < 0.2
    fixed = np.where(np.arange(len(places)) == vertex, 0.0, longest_mm)
    assert np.array_equal(
        open_flat_elements(places, BODY.tets, VOLUMES, fixed, 0.2)[vertex],
        places[vertex],
    )


@pytest.mark.parametrize("seed", range(3))
def test_what_opens_inverted_elements_turns_no_others_over(seed):
    noise = np.random.default_rng(seed).uniform(-3.2, 3.2, BODY.vertices.shape)
    noise[USED] = 0.0
    places = BODY.vertices + noise
    before = ratios(places)
    longest_mm = np.minimum(LONGEST_MM, 0.3)
    assert (before < 0).sum() > 10
    found = open_flat_elements(places, BODY.tets, VOLUMES, longest_mm, 0.2)
    after = ratios(found)
    assert (after < 0).sum() < (before < 0).sum()
    assert (after[before > 0] > 0).all()
