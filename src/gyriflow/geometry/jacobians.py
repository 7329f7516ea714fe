"""Bounds of the Jacobian determinant of ten-node tetrahedra, over the whole element.

With curved sides the determinant is a cubic polynomial in the barycentric coordinates.
It lies between the smallest and the largest of its 20 Bernstein coefficients (Johnen,
Remacle and Geuzaine 2013, J. Comput. Phys. 233, 359-372).
"""

import math
from collections.abc import Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

from .triangles import Floats

# corners of the edges whose midpoints are nodes 4 to 9, in the order of VTK
EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
# the eight parts of an element between its nodes: one at each corner, four around the
# axis from node 4 to node 9
CORNER_PARTS = ((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3))
PARTS = (*CORNER_PARTS, (4, 6, 7, 9), (4, 7, 8, 9), (4, 8, 5, 9), (4, 5, 6, 9))
NODES = np.array(
    [np.eye(4)[i] for i in range(4)]
    + [(np.eye(4)[a] + np.eye(4)[b]) / 2 for a, b in EDGES]
)
"""Barycentric coordinates (10, 4) of the nodes."""
POWERS = np.array(
    [powers for powers in product(range(4), repeat=4) if sum(powers) == 3]
)
"""Exponents (20, 4) of the barycentric coordinates in Bernstein's polynomials of third
degree."""
SLOPES = np.array(
    [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
)
"""Gradients of the barycentric coordinates in the regular element."""
DEPTH = 3
"""Number of subdivisions of an element whose bounds are inconclusive."""
CHUNK = 4096
"""Number of elements that fit into the processor's cache."""


def shape_values(places: Floats) -> Floats:
    """Return the (p, 10) shape functions of the nodes at (p, 4) barycentric
    coordinates."""
    corner = places * (2 * places - 1)
    middle = np.stack([4 * places[:, a] * places[:, b] for a, b in EDGES], axis=1)
    return np.concatenate([corner, middle], axis=1)


def shape_slopes(places: Floats) -> Floats:
    """Return the (p, 10, 3) gradients of the shape functions in the regular element."""
    corner = (4 * places - 1)[:, :, None] * SLOPES
    middle = np.stack(
        [
            4 * (places[:, a, None] * SLOPES[b] + places[:, b, None] * SLOPES[a])
            for a, b in EDGES
        ],
        axis=1,
    )
    return np.concatenate([corner, middle], axis=1)


def bernstein(places: Floats) -> Floats:
    """Return the (p, 20) Bernstein polynomials of third degree at (p, 4) barycentric
    coordinates."""
    factors = [
        6 / math.prod(math.factorial(int(power)) for power in powers)
        for powers in POWERS
    ]
    return np.asarray((places[:, None, :] ** POWERS).prod(axis=2) * factors)


FROM_VALUES = np.linalg.inv(bernstein(POWERS / 3))
"""Matrix from a polynomial's values at the 20 lattice points to its coefficients."""
LATTICE_SLOPES = shape_slopes(POWERS / 3)
ON_PARTS = np.stack(
    [FROM_VALUES @ bernstein(POWERS / 3 @ NODES[list(part)]) for part in PARTS]
)
"""The (8, 20, 20) matrices from a polynomial's coefficients on the whole element to
those on its parts."""
AT_CORNERS = np.flatnonzero(POWERS.max(axis=1) == 3)


def determinants(matrices: Floats) -> Floats:
    """Return the determinants of (..., 3, 3) matrices, written out: many times faster
    than factorisations."""
    a, b, c = matrices[..., 0, :], matrices[..., 1, :], matrices[..., 2, :]
    return np.asarray(
        a[..., 0] * (b[..., 1] * c[..., 2] - b[..., 2] * c[..., 1])
        + a[..., 1] * (b[..., 2] * c[..., 0] - b[..., 0] * c[..., 2])
        + a[..., 2] * (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0])
    )


def chunks(count: int) -> Iterator[slice]:
    """Yield slices of a number of elements that fit into the processor's cache."""
    for first in range(0, count, CHUNK):
        yield slice(first, first + CHUNK)


def jacobians(vertices: Floats, tets: NDArray[np.integer], slopes: Floats) -> Floats:
    """Return the (m, p) Jacobian determinants of (m, 10) elements, from (p, 10, 3)
    shape function gradients."""
    values = np.empty((len(tets), len(slopes)))
    by_node = slopes.transpose(0, 2, 1).reshape(-1, 10)
    for chunk in chunks(len(tets)):
        maps = np.matmul(by_node, np.take(vertices, tets[chunk], axis=0))
        values[chunk] = determinants(maps.reshape(len(maps), -1, 3, 3))
    return values


def coefficients(vertices: Floats, tets: NDArray[np.integer]) -> Floats:
    """Return the (m, 20) Bernstein coefficients of (m, 10) elements' determinants;
    their mean is 6 volumes."""
    return jacobians(vertices, tets, LATTICE_SLOPES) @ FROM_VALUES.T


def lower_bounds(vertices: Floats, tets: NDArray[np.integer]) -> Floats:
    """Return a lower bound of the Jacobian determinant of each (m, 10) element: if
    positive, it folds nowhere.

    Inconclusive elements are subdivided up to three times, since the bounds of smaller
    parts are tighter.
    """
    whole = coefficients(vertices, tets)
    bounds = whole.min(axis=1)
    undecided = np.flatnonzero((bounds <= 0) & (whole[:, AT_CORNERS].min(axis=1) > 0))
    if len(undecided):
        bounds[undecided] = _subdivided_bounds(whole[undecided], DEPTH)
    return bounds


def _subdivided_bounds(whole: Floats, depth: int) -> Floats:
    parts = np.einsum("sij,kj->ksi", ON_PARTS, whole)
    bounds = parts.min(axis=2)
    undecided = (bounds <= 0) & (parts[:, :, AT_CORNERS].min(axis=2) > 0)
    if depth > 1 and undecided.any():
        bounds[undecided] = _subdivided_bounds(parts[undecided], depth - 1)
    return np.asarray(bounds.min(axis=1))


def inverted_on_the_way(
    before: Floats, after: Floats, tets: NDArray[np.integer], least: float = 0.0
) -> NDArray[np.bool_]:
    """Return whether each (m, 4) or (m, 10) element is inverted anywhere on the
    straight way of its vertices.

    The volume of a linear element is a cubic of the way, decided by its Bernstein
    coefficients, else its roots; it must stay above the fraction `least` of that
    before. Quadratic ones are checked by `lower_bounds` at quarters of the way.
    """
    if tets.shape[1] == len(NODES):
        on_way = (before + part * (after - before) for part in (0.25, 0.5, 0.75, 1.0))
        return np.any([lower_bounds(places, tets) <= 0 for places in on_way], axis=0)
    inverted = np.zeros(len(tets), dtype=bool)
    for chunk in chunks(len(tets)):
        first, last = (
            np.take(x, tets[chunk, 1:], axis=0) - x[tets[chunk, :1]]
            for x in (before, after)
        )
        # rows of one end, with one or two of the other
        mixed = [
            np.where(np.isin(range(3), rows)[:, None], last, first)
            for rows in ((0,), (1,), (2,))
        ]
        opposite = [
            np.where(np.isin(range(3), rows)[:, None], first, last)
            for rows in ((0,), (1,), (2,))
        ]
        ends = [first], mixed, opposite, [last]
        bernstein_values = np.stack(
            [sum(map(determinants, maps)) / len(maps) for maps in ends], axis=1
        )
        bernstein_values -= least * np.maximum(bernstein_values[:, :1], 0.0)
        undecided = np.flatnonzero(bernstein_values.min(axis=1) <= 0)
        inverted[chunk.start + undecided] = [
            _has_root(*values) for values in bernstein_values[undecided]
        ]
    return inverted


def _has_root(a: float, b: float, c: float, d: float) -> bool:
    """Return whether the cubic with these Bernstein coefficients on [0, 1] is anywhere
    zero or negative there."""
    if min(a, d) <= 0:
        return True
    roots = np.roots([d - 3 * c + 3 * b - a, 3 * (c - 2 * b + a), 3 * (b - a), a])
    real = roots.real[np.abs(roots.imag) < 1e-9]
    return bool(((real >= 0) & (real <= 1)).any())
