"""Sides of curved elements become straighter until their Jacobian determinants are above a bound."""

import numpy as np
import pytest
from shapes import box_mesh

from gyriflow.geometry.jacobians import EDGES, lower_bounds
from gyriflow.geometry.straightening import corner_determinants, straightened
from gyriflow.geometry.tetrahedra import boundary_faces, quadratic

MESH = quadratic(box_mesh((3, 3, 3), (6.0, 5.0, 4.0)))


def inner_side():
    """Return the node in the middle of a side inside the box, and the two ends of that side."""
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


def bounds(positions):
    return lower_bounds(positions, MESH.tets) / corner_determinants(positions, MESH.tets)


def test_an_element_that_folds_over_becomes_valid():
    positions = bowed(0.4)
    assert bounds(positions).min() < 0
    assert bounds(straightened(positions, MESH.tets)).min() > 0


@pytest.mark.parametrize("least", [0.4, 0.7])
def test_only_the_side_of_elements_below_the_bound_moves(least):
    positions = bowed(0.15)
    assert bounds(positions).min() < 0.4
    moved = straightened(positions, MESH.tets, least)
    assert bounds(moved).min() > least
    is_moved = (moved != positions).any(axis=1)
    assert is_moved.nonzero()[0].tolist() == [inner_side()[0]]


def test_elements_above_the_bound_and_fixed_nodes_stay():
    slightly = bowed(0.05)
    assert bounds(slightly).min() > 0.4
    assert (straightened(slightly, MESH.tets, 0.4) == slightly).all()
    positions = bowed(0.15)
    fixed = np.zeros(len(positions), dtype=bool)
    fixed[inner_side()[0]] = True
    assert (straightened(positions, MESH.tets, 0.4, fixed) == positions).all()
