"""Flat tetrahedra inside a body, opened by moving as few vertices by as little as
possible.

The volume of a tetrahedron is a linear function of the place of one of its vertices, so
the place at which the flattest of the elements around a vertex is largest is found by a
linear program (Amenta, Bern and Eppstein 1999, J. Algorithms 30, 302-322).
"""

import numpy as np
from scipy.optimize import linprog

from .tetrahedra import FACES, volumes_between
from .triangles import Floats, Indices

ROUNDS = 3
"""Rounds over the flat elements: one may open only after another."""
KEPT_RATIO = 0.02
"""Fraction of their volume below which elements do not lose any, or turn over, for one
that is inverted."""
COST_PER_MM = 1e-3
"""Relative volume that a displacement of 1 mm has to gain: a vertex moves no further
than that needs."""


def open_flat_elements(
    positions: Floats,
    tets: Indices,
    start_volumes: Floats,
    longest_mm: Floats,
    least: float,
) -> Floats:
    """Return (n, 3) positions in mm at which elements have the fraction `least` of
    their volume, where possible; `positions` itself if no vertex can be moved.

    `tets` are (m, 4) linear elements, of which a few may be inverted, `start_volumes`
    (m,) in mm³ those of which this is a fraction. A vertex moves by at most
    `longest_mm` (n,) along each axis. No element below this fraction loses volume
    unless a flatter one at the same vertex gains.
    """
    places = positions
    left_mm = longest_mm.copy()
    for _ in range(ROUNDS):
        ratios = volumes_between(places, tets) / start_volumes
        flat = np.flatnonzero(ratios < least)
        flattest_first = flat[np.argsort(ratios[flat])]
        vertices = tets[flattest_first].ravel()
        vertices = vertices[left_mm[vertices] > 0]
        if not len(vertices):
            break
        if places is positions:
            places = positions.copy()
        near = np.flatnonzero(np.isin(tets, vertices).any(axis=1))
        for vertex in dict.fromkeys(vertices.tolist()):
            around = near[(tets[near] == vertex).any(axis=1)]
            move = _best_move(
                places,
                vertex,
                tets[around],
                start_volumes[around],
                left_mm[vertex],
                least,
            )
            places[vertex] += move
            left_mm[vertex] -= np.abs(move).max()
    return places


def _best_move(
    places: Floats,
    vertex: int,
    around: Indices,
    start_volumes: Floats,
    longest_mm: float,
    least: float,
) -> Floats:
    """Return the displacement (3,) in mm of a vertex of the elements around it that
    opens the flattest of them."""
    volumes = volumes_between(places, around)
    corner = (around == vertex).argmax(axis=1)
    opposite = np.take_along_axis(
        around,
        np.array(FACES)[corner],
        axis=1,
    )
    a, b, c = places[opposite.T]
    gradients = -np.cross(b - a, c - a) / 6
    # unknowns: displacement along x, y, z, the smallest ratio, and the largest
    # component of the displacement
    count = len(around)
    stay_open = np.column_stack(
        [
            -gradients,
            start_volumes,
            np.zeros(count),
        ]
    )
    stay_open /= start_volumes[:, None]
    sides = np.vstack([np.eye(3), -np.eye(3)])
    bound_move = np.column_stack(
        [
            sides,
            np.zeros(6),
            -np.ones(6),
        ]
    )
    ratios = volumes / start_volumes
    rows = [stay_open, bound_move]
    limits = [ratios, np.zeros(6)]
    if ratios.min() <= 0:
        # the others are not as flat as the inverted one becomes
        stay_positive = stay_open.copy()
        stay_positive[:, 3] = 0.0
        rows.append(stay_positive)
        limits.append(np.maximum(ratios - KEPT_RATIO, 0.0))
    unbounded = (None, None)
    found = linprog(
        [0.0, 0.0, 0.0, -1.0, COST_PER_MM],
        A_ub=np.vstack(rows),
        b_ub=np.concatenate(limits),
        bounds=[
            unbounded,
            unbounded,
            unbounded,
            (None, least),
            (0.0, longest_mm),
        ],
    )
    # without a solution, by round-off, the vertex stays
    has_solution = found.status == 0
    return np.asarray(found.x[:3]) if has_solution else np.zeros(3)
