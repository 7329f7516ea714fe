"""Straighten the sides of curved tetrahedra that fold over, or are about to."""

import numpy as np
from numpy.typing import NDArray

from .jacobians import EDGES, lower_bounds
from .triangles import Floats

ROUNDS = 6
"""Number of rounds; each moves nodes halfway to the middle of their side, the last one fully."""


def straightened(
    positions: Floats, tets: NDArray[np.integer], least: float = 0.0, fixed: NDArray[np.bool_] | None = None
) -> Floats:
    """Return (n, 3) positions with straighter sides of (m, 10) elements whose Jacobian determinant may be too small.

    The bound of an element's determinant (`lower_bounds`) must be above `least` times that of a straight element with
    the same corners. Nodes in the middle of its sides move towards the straight side, except `fixed` ones (n,).
    Elements may remain below the bound, and neighbours may get there.
    """
    places = positions.copy()
    for rounds_left in reversed(range(ROUNDS)):
        bad = tets[lower_bounds(places, tets) <= least * corner_determinants(places, tets)]
        if not len(bad):
            break
        middles = bad[:, 4:]
        straight = places[bad[:, EDGES]].mean(axis=2)
        target = straight if rounds_left == 0 else (straight + places[middles]) / 2
        is_free = np.ones(middles.shape, dtype=bool) if fixed is None else ~fixed[middles]
        places[middles[is_free]] = target[is_free]
    return places


def corner_determinants(positions: Floats, tets: NDArray[np.integer]) -> Floats:
    """Return the (m,) Jacobian determinants of straight elements with the corners of (m, 10) elements."""
    corners = positions[tets[:, :4]]
    return np.asarray(np.linalg.det(corners[:, 1:] - corners[:, :1]))
