"""Bounds of the Jacobian determinant of ten-node tetrahedra, over the whole element.

With curved sides the determinant is a cubic polynomial in the barycentric coordinates.
It lies between the smallest and the largest of its 20 Bernstein coefficients (Johnen,
Remacle and Geuzaine 2013, J. Comput. Phys. 233, 359-372).
"""

from collections.abc import Iterator
from itertools import product

import numpy as np

from .triangles import Floats, Indices, Mask

# corners of the edges whose midpoints are nodes 4 to 9, in the order of VTK
EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
# the eight parts of an element between its nodes: one at each corner, four around the
# axis from node 4 to node 9
CORNER_PARTS = ((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3))
PARTS = (
    *CORNER_PARTS,
    (4, 6, 7, 9),
    (4, 7, 8, 9),
    (4, 8, 5, 9),
    (4, 5, 6, 9),
)
FIRST, SECOND = np.transpose(EDGES)
NODES = np.vstack([np.eye(4), (np.eye(4)[FIRST] + np.eye(4)[SECOND]) / 2])
"""Barycentric coordinates (10, 4) of the nodes."""
POWERS = np.array(
    [powers for powers in product(range(4), repeat=4) if sum(powers) == 3]
)
"""Exponents (20, 4) of the barycentric coordinates in Bernstein's polynomials of third
degree."""
SLOPES = np.vstack([-np.ones(3), np.eye(3)])
"""Gradients of the barycentric coordinates in the regular element."""
DEPTH = 3
"""Number of subdivisions of an element whose bounds are inconclusive."""
CHUNK = 4096
"""Number of elements that fit into the processor's cache."""


def shape_values(places: Floats) -> Floats:
    """Return the (p, 10) shape functions of the nodes at (p, 4) barycentric
    coordinates."""
    at_corners = places * (2 * places - 1)
    at_middles = 4 * places[:, FIRST] * places[:, SECOND]
    return np.hstack([at_corners, at_middles])


def shape_slopes(places: Floats) -> Floats:
    """Return the (p, 10, 3) gradients of the shape functions in the regular element."""
    values = places[:, :, None]
    at_corners = (4 * values - 1) * SLOPES
    first = values[:, FIRST] * SLOPES[SECOND]
    second = values[:, SECOND] * SLOPES[FIRST]
    return np.hstack([at_corners, 4 * (first + second)])


def _bernstein(places: Floats) -> Floats:
    """Return the (p, 20) Bernstein polynomials of third degree at (p, 4) barycentric
    coordinates."""
    factorials = np.array([1, 1, 2, 6])
    divisors = factorials[POWERS].prod(axis=1)
    factors = 6 / divisors
    powers = places[:, None, :] ** POWERS
    return powers.prod(axis=2) * factors


FROM_VALUES = np.linalg.inv(_bernstein(POWERS / 3))
"""Matrix from a polynomial's values at the 20 lattice points to its coefficients."""
LATTICE_SLOPES = shape_slopes(POWERS / 3)
CORNER_SLOPES = shape_slopes(np.eye(4))
ON_PARTS = np.stack(
    [FROM_VALUES @ _bernstein(POWERS / 3 @ NODES[list(part)]) for part in PARTS]
)
"""The (8, 20, 20) matrices from a polynomial's coefficients on the whole element to
those on its parts."""
AT_CORNERS = np.flatnonzero(POWERS.max(axis=1) == 3)


def determinants(matrices: Floats) -> Floats:
    """Return the determinants of (..., 3, 3) matrices, written out: many times faster
    than factorisations."""
    rows = np.moveaxis(
        matrices,
        (-2, -1),
        (0, 1),
    )
    a, b, c = rows[0]
    d, e, f = rows[1]
    g, h, i = rows[2]
    first = a * (e * i - f * h)
    second = b * (f * g - d * i)
    third = c * (d * h - e * g)
    return np.asarray(first + second + third)


def chunks(count: int) -> Iterator[slice]:
    """Yield slices of a number of elements that fit into the processor's cache."""
    for first in range(0, count, CHUNK):
        yield slice(first, first + CHUNK)


def jacobians(
    vertices: Floats,
    tets: Indices,
    slopes: Floats,
) -> Floats:
    """Return the (m, p) Jacobian determinants of (m, 10) elements, from (p, 10, 3)
    shape function gradients."""
    values = np.empty((len(tets), len(slopes)))
    by_node = slopes.transpose(0, 2, 1)
    by_node = by_node.reshape(-1, 10)
    for chunk in chunks(len(tets)):
        places = np.take(vertices, tets[chunk], axis=0)
        maps = by_node @ places
        maps = maps.reshape(
            len(places),
            -1,
            3,
            3,
        )
        values[chunk] = determinants(maps)
    return values


def coefficients(vertices: Floats, tets: Indices) -> Floats:
    """Return the (m, 20) Bernstein coefficients of (m, 10) elements' determinants;
    their mean is 6 volumes."""
    return jacobians(vertices, tets, LATTICE_SLOPES) @ FROM_VALUES.T


def lower_bounds(vertices: Floats, tets: Indices) -> Floats:
    """Return a lower bound of the Jacobian determinant of each (m, 10) element: if
    positive, it folds nowhere.

    Inconclusive elements are subdivided up to three times, since the bounds of smaller
    parts are tighter.
    """
    return _bounds(coefficients(vertices, tets), DEPTH)


def _bounds(values: Floats, depth: int) -> Floats:
    """Return the (k,) lower bounds from (k, 20) coefficients, with up to `depth`
    subdivisions."""
    bounds = values.min(axis=1)
    at_corners = values[:, AT_CORNERS]
    # a corner is a place of the element: with a value ≤ 0 there the bound is right
    undecided = (bounds <= 0) & (at_corners.min(axis=1) > 0)
    if depth > 0 and undecided.any():
        # s: part, i: coefficient on the part, j: on the whole element, k: element
        on_parts = np.einsum("sij,kj->ksi", ON_PARTS, values[undecided])
        all_parts = on_parts.reshape(-1, len(POWERS))
        part_bounds = _bounds(all_parts, depth - 1)
        part_bounds = part_bounds.reshape(-1, len(PARTS))
        bounds[undecided] = part_bounds.min(axis=1)
    return bounds


def inverted_on_the_way(
    before: Floats,
    after: Floats,
    tets: Indices,
    least: float = 0.0,
) -> Mask:
    """Return whether each (m, 4) or (m, 10) element is inverted anywhere on the
    straight way of its vertices.

    The volume of a linear element is a cubic of the way, decided by its Bernstein
    coefficients, else its roots; it must stay above the fraction `least` of that
    before. Quadratic ones are checked by `lower_bounds` at quarters of the way, and
    for inversion only: their bound depends on how bent their sides are.
    """
    inverted = np.zeros(len(tets), dtype=bool)
    if tets.shape[1] == len(NODES):
        for part in (0.25, 0.5, 0.75, 1.0):
            places = before + part * (after - before)
            inverted |= lower_bounds(places, tets) <= 0
        return inverted
    for chunk in chunks(len(tets)):
        (first,) = element_maps(
            before,
            tets[chunk],
            SLOPES[None],
        )
        (last,) = element_maps(
            after,
            tets[chunk],
            SLOPES[None],
        )
        first_cofactors = cofactors_of(first)
        last_cofactors = cofactors_of(last)
        # each row of a matrix times its cofactors is the determinant
        sums = [
            (first * first_cofactors).sum(axis=(0, 1)),
            (last * first_cofactors).sum(axis=(0, 1)),
            (first * last_cofactors).sum(axis=(0, 1)),
            (last * last_cofactors).sum(axis=(0, 1)),
        ]
        values = np.stack(sums, axis=1) / 3
        values -= least * np.maximum(
            values[:, :1],
            0.0,
        )
        undecided = np.flatnonzero(values.min(axis=1) <= 0)
        for element in undecided:
            inverted[chunk.start + element] = _has_root(*values[element])
    return inverted


def may_be_inverted(shapes: Floats, tets: Indices) -> Mask:
    """Return whether each (m, 4) or (m, 10) element may be inverted anywhere in a shape
    between (k, n, 3) shapes, a mean of these with any weights.

    It is not where the deformation gradients F from its mean map to those at its
    corners, in all of the shapes, have |F − 1| < 1. This also holds for all means of
    these maps, and then det F > 0.
    """
    # the map of a linear element is the same everywhere
    slopes = CORNER_SLOPES if tets.shape[1] == len(NODES) else SLOPES[None]
    may_be = np.empty(len(tets), dtype=bool)
    for chunk in chunks(len(tets)):
        by_shape = [element_maps(shape, tets[chunk], slopes) for shape in shapes]
        maps = np.concatenate(by_shape)
        mean = maps.mean(axis=0)
        cofactors = cofactors_of(mean)
        volumes = (mean * cofactors).sum(axis=(0, 1)) / 3
        largest = np.zeros(len(volumes))
        for corner_map in maps:
            # a: axis of the regular element, i, j: axes in space, e: element
            change = np.einsum("aie,aje->ije", corner_map - mean, cofactors)
            squares = (change**2).sum(axis=(0, 1))
            largest = np.maximum(largest, squares)
        may_be[chunk] = (volumes <= 0) | (largest >= volumes**2)
    return may_be


def element_maps(
    places: Floats,
    tets: Indices,
    slopes: Floats,
) -> Floats:
    """Return the (p, 3, 3, m) maps from the regular element to (m, 4) or (m, 10)
    elements at points, from the gradients (p, n, 3) of the shape functions there.

    Rows are axes of the regular element, columns those of space. The elements come
    last, since products by component are many times faster than those of small
    matrices.
    """
    nodes = np.take(places, tets.T, axis=0)
    if len(nodes) == len(NODES):
        maps = np.tensordot(
            slopes.transpose(0, 2, 1),
            nodes,
            axes=1,
        )
    else:
        maps = (nodes[1:] - nodes[0])[None]
        if len(slopes) > 1:
            maps = np.tile(
                maps,
                (len(slopes), 1, 1, 1),
            )
    return np.ascontiguousarray(maps.swapaxes(2, 3))


def cofactors_of(maps: Floats) -> Floats:
    """Return the cofactors of (3, 3, m) matrices: cross products of two rows each."""
    found = np.empty_like(maps)
    for row, axis in product(range(3), repeat=2):
        second = maps[(row + 1) % 3]
        third = maps[(row + 2) % 3]
        j = (axis + 1) % 3
        k = (axis + 2) % 3
        found[row, axis] = second[j] * third[k] - second[k] * third[j]
    return found


def _has_root(
    a: float,
    b: float,
    c: float,
    d: float,
) -> bool:
    """Return whether the cubic with these Bernstein coefficients on [0, 1] is anywhere
    zero or negative there."""
    if min(a, d) <= 0:
        return True
    cubic = d - 3 * c + 3 * b - a
    square = 3 * (c - 2 * b + a)
    linear = 3 * (b - a)
    roots = np.roots([cubic, square, linear, a])
    real = roots.real[np.abs(roots.imag) < 1e-9]
    is_inside = (real >= 0) & (real <= 1)
    return bool(is_inside.any())
