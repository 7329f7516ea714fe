"""Straighten the sides of curved tetrahedra that fold over, or are about to."""

import numpy as np
from numpy.typing import NDArray

from .jacobians import EDGES, lower_bounds
from .tetrahedra import volumes_between
from .triangles import Floats

ROUNDS = 6
"""Number of rounds; each moves nodes halfway to the middle of their side, the last one fully."""


def straightened(
    positions: Floats, tets: NDArray[np.integer], least: float = 0.0, fixed: NDArray[np.bool_] | None = None
) -> Floats:
    """Return (n, 3) positions with straighter sides of (m, 10) elements whose `straightness` is at most `least`.

    Nodes in the middle of their sides move towards the straight side, except `fixed` ones (n,). Elements may remain
    below, and neighbours may get there.
    """
    places = positions.copy()
    for rounds_left in reversed(range(ROUNDS)):
        bent = tets[straightness(places, tets) <= least]
        if not len(bent):
            break
        middles = bent[:, 4:]
        straight = places[bent[:, EDGES]].mean(axis=2)
        target = straight if rounds_left == 0 else (straight + places[middles]) / 2
        is_free = np.ones(middles.shape, dtype=bool) if fixed is None else ~fixed[middles]
        places[middles[is_free]] = target[is_free]
    return places


def straightened_inside(
    positions: Floats, tets: NDArray[np.integer], least: float, is_on_surface: NDArray[np.bool_]
) -> Floats:
    """Return (n, 3) positions with straighter inner sides of (m, 10) elements whose `straightness` is at most `least`.

    Nodes on the surface (n,) stay. Where that bends an element more, since its sides on the surface are bowed as well,
    the inner sides of this element stay, too.
    """
    fixed = is_on_surface.copy()
    before = straightness(positions, tets)
    while True:
        places = straightened(positions, tets, least, fixed)
        after = straightness(places, tets)
        is_worse = (after < before) & (after <= least)
        if not is_worse.any():
            return places
        fixed[tets[is_worse, 4:]] = True


def straightness(positions: Floats, tets: NDArray[np.integer]) -> Floats:
    """Return how straight the sides of (m, 10) elements are: 1 if all are straight, at most 0 if one may fold over.

    It is the lower bound of the Jacobian determinant in an element over the mean.
    """
    means = 6 * np.abs(volumes_between(positions, tets))
    return np.asarray(lower_bounds(positions, tets) / np.maximum(means, np.finfo(float).tiny))
