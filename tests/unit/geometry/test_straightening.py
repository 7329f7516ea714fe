"""Sides of curved elements become straighter until their Jacobian determinants are
above a bound."""

import numpy as np
import pytest
from shapes import box_mesh

from gyriflow.geometry.jacobians import EDGES
from gyriflow.geometry.straightening import (
    InnerSides,
    may_fold_over,
    straighten_sides,
    straightness,
)
from gyriflow.geometry.tetrahedra import boundary_faces, quadratic

MESH = quadratic(box_mesh((3, 3, 3), (6.0, 5.0, 4.0)))


def inner_side():
    """Return the node in the middle of a side inside the box, and the two ends of that
    side."""
    on_surface = np.unique(boundary_faces(MESH)[0])
    sides = MESH.tets[:, EDGES].reshape(-1, 2)
    middles = MESH.tets[:, 4:].ravel()
    inner = np.flatnonzero(~np.isin(middles, on_surface))[0]
    return middles[inner], sides[inner]


def bowed(share):
    """Return the box with one inner side bowed by a share of its length."""
    middle, (first, second) = inner_side()
    positions = MESH.vertices.copy()
    along = positions[second] - positions[first]
    across = np.cross(along, [0.3, 0.5, 0.8])
    positions[middle] += share * np.linalg.norm(along) * across / np.linalg.norm(across)
    return positions


@pytest.mark.parametrize("seed", range(4))
def test_neither_elements_nor_their_pieces_stay_folded_over_where_all_sides_are_bowed(
    seed,
):
    middles = np.unique(MESH.tets[:, 4:])
    positions = MESH.vertices.copy()
    positions[middles] += 0.4 * np.random.default_rng(seed).normal(
        size=(len(middles), 3)
    )
    assert may_fold_over(positions, MESH.tets).any()
    assert not may_fold_over(straighten_sides(positions, MESH.tets), MESH.tets).any()


@pytest.mark.parametrize(
    ("share", "least", "moves"),
    [(0.15, 0.4, True), (0.15, 0.7, True), (0.05, 0.4, False)],
)
def test_only_the_side_of_elements_below_the_bound_moves(share, least, moves):
    positions = bowed(share)
    assert (straightness(positions, MESH.tets).min() < 0.4) == moves
    moved = InnerSides.of(MESH).straighten(positions, least)
    assert straightness(moved, MESH.tets).min() > least
    is_moved = (moved != positions).any(axis=1)
    middle, _ = inner_side()
    assert is_moved.nonzero()[0].tolist() == [middle] * moves


def test_inner_sides_that_follow_a_bowed_surface_stay():
    # one shear of all nodes: inner sides are bowed as the surface is, and straight ones
    # would make elements fold over
    x, y, z = MESH.vertices.T
    sheared = np.stack([x, y, z + 0.32 * x**2], axis=1)
    assert straightness(sheared, MESH.tets) == pytest.approx(1.0)
    # a limit above 1 is for all elements
    assert (InnerSides.of(MESH).straighten(sheared, 1.5) == sheared).all()


def test_the_surface_stays_and_no_element_gets_worse_than_the_worst():
    rng = np.random.default_rng(3)
    rough = MESH.vertices + 0.06 * rng.standard_normal(MESH.vertices.shape)
    before = straightness(rough, MESH.tets)
    moved = InnerSides.of(MESH).straighten(rough, 0.9)
    after = straightness(moved, MESH.tets)
    assert after.min() >= before.min()
    assert np.median(after) > np.median(before)
    surface = np.unique(boundary_faces(MESH)[0])
    assert (moved[surface] == rough[surface]).all()
