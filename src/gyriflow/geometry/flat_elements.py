"""Flat tetrahedra inside a body, opened by moving as few vertices by as little as
possible.

The volume of a tetrahedron is a linear function of the place of one of its vertices, so
the place at which the flattest of the elements around a vertex is largest is found by a
linear program (Amenta, Bern and Eppstein 1999, J. Algorithms 30, 302-322).
"""

import numpy as np

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
MAX_EXCHANGES, LIMIT_TOL = 100, 1e-9
"""Largest number of exchanges of constraints in a linear program, and by how much its
solution may be beyond one."""


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
    # a vertex around which nothing has moved stays in the next round
    may_move = np.ones(len(positions), dtype=bool)
    ratios = volumes_between(places, tets) / start_volumes
    for _ in range(ROUNDS):
        flat = np.flatnonzero(ratios < least)
        flattest_first = flat[np.argsort(ratios[flat])]
        vertices = tets[flattest_first].ravel()
        vertices = vertices[(left_mm[vertices] > 0) & may_move[vertices]]
        if not len(vertices):
            break
        if places is positions:
            places = positions.copy()
        is_near = np.zeros(len(positions), dtype=bool)
        is_near[vertices] = True
        near = np.flatnonzero(is_near[tets].any(axis=1))
        before = places.copy()
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
        has_moved = (places != before).any(axis=1)
        touched = near[has_moved[tets[near]].any(axis=1)]
        volumes = volumes_between(places, tets[touched])
        ratios[touched] = volumes / start_volumes[touched]
        may_move = np.zeros(len(positions), dtype=bool)
        may_move[tets[touched]] = True
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
    # the ratio is at most `least`, and the component between 0 and `longest_mm`
    rows.append(np.eye(5)[[3, 4]])
    limits.append(np.array([least, longest_mm]))
    rows.append(-np.eye(5)[[4]])
    limits.append(np.zeros(1))
    A = np.vstack(rows)
    # these are active without any constraint by elements: the vertex stays
    active = np.array(
        [
            count,
            count + 1,
            count + 2,
            len(A) - 3,
            len(A) - 1,
        ]
    )
    found = _least_cost(
        np.array([0.0, 0.0, 0.0, -1.0, COST_PER_MM]),
        A,
        np.concatenate(limits),
        active,
    )
    return np.zeros(3) if found is None else found[:3]


def _least_cost(
    costs: Floats,
    A: Floats,
    limits: Floats,
    active: Indices,
) -> Floats | None:
    """Return the (k,) unknowns x of least cost with A·x ≤ limits; None if round-off
    prevents it.

    The dual simplex method, from k `active` constraints that bound the cost: the one
    that is violated most takes the place of one of these, until none is. For so few
    unknowns general solvers take ten times as long.
    """
    for _ in range(MAX_EXCHANGES):
        inverse = np.linalg.inv(A[active])
        x = inverse @ limits[active]
        excess = A @ x - limits
        entering = int(excess.argmax())
        if excess[entering] <= LIMIT_TOL:
            return np.asarray(x)
        multipliers = np.maximum(-costs @ inverse, 0.0)
        shares = A[entering] @ inverse
        can_leave = shares > LIMIT_TOL
        if not can_leave.any():
            return None
        quotients = multipliers[can_leave] / shares[can_leave]
        active = active.copy()
        active[np.flatnonzero(can_leave)[quotients.argmin()]] = entering
    return None
