"""Quadrics fitted to a surface round each of its vertices, in balls of a given radius."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..geometry.triangles import Floats, Ints, TriangleMesh, edges, unit, vertex_areas, vertex_normals

CHUNK = 1024
"""Vertices worked on at once: the arrays of their neighbours then stay in the processor's cache."""

_POWERS = ((2, 0), (1, 1), (0, 2), (1, 0), (0, 1), (0, 0))
_MONOMIALS = sorted({(a + c, b + d) for a, b in _POWERS for c, d in _POWERS})
_NORMAL_EQUATIONS = np.array([[_MONOMIALS.index((a + c, b + d)) for a, b in _POWERS] for c, d in _POWERS])


@dataclass(frozen=True, eq=False)
class Quadrics:
    """Quadrics z = a x² + b x y + c y² + d x + e y + f over the tangent planes of n vertices.

    Attributes
    ----------
    coefficients : (n, 6) float
        a, b, c in 1/mm, d, e without unit, f in mm; z along the outward normal. 0 where nothing could be fitted.
    fitted : (n,) bool
        False where the neighbours do not determine a quadric.
    one_sided : (n,) bool
        True where the ball holds a vertex of the boundary of an open surface.
    """

    coefficients: Floats
    fitted: NDArray[np.bool_]
    one_sided: NDArray[np.bool_]


def fit_quadrics(mesh: TriangleMesh, radii_mm: Floats) -> Quadrics:
    """Returns the quadrics fitted by weighted least squares to the vertices in a ball round each vertex.

    The ball takes in what is linked to its centre by edges inside it: not the other wall of a sulcus. The weight is
    area × cosine × (1 − d²/radius²): area of the vertex, turned into the tangent plane, so that the sum stands for an
    integral that does not depend on the mesh; nothing changes by a jump at the rim; and what is turned away by more
    than 90° does not count. The tangent plane is that of the weighted mean of the normals.
    """
    links, boundary = _links(mesh)
    normals, areas = vertex_normals(mesh), vertex_areas(mesh)
    found = [
        _fit(mesh.vertices, normals, areas, radii_mm, centres, balls, boundary)
        for centres, balls in _balls(mesh.vertices, radii_mm, links)
    ]
    coefficients, fitted, one_sided = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return Quadrics(coefficients, fitted, one_sided)


def _links(mesh: TriangleMesh) -> tuple[sparse.csr_matrix, NDArray[np.bool_]]:
    """Returns the (n, n) matrix of a vertex's links to itself and its neighbours, and the (n,) mask of the boundary."""
    pairs, uses = edges(mesh)
    size = len(mesh.vertices)
    boundary = np.zeros(size, dtype=bool)
    boundary[pairs[uses == 1]] = True
    both = np.concatenate([pairs, pairs[:, ::-1], np.arange(size)[:, None].repeat(2, axis=1)])
    return sparse.csr_matrix((np.ones(len(both), dtype=bool), both.T), shape=(size, size)), boundary


def _balls(vertices: Floats, radii_mm: Floats, links: sparse.csr_matrix) -> Iterator[tuple[Ints, sparse.csr_matrix]]:
    """Yields indices of (c,) centres and the (c, n) pattern of the vertices in their balls, grown ring by ring."""
    for start in range(0, len(vertices), CHUNK):
        centres = np.arange(start, min(start + CHUNK, len(vertices)))
        ball = links[centres]
        size = 0
        while ball.nnz > size:
            size = ball.nnz
            ball = ball @ links
            counts = np.diff(ball.indptr)
            away = vertices[ball.indices] - np.repeat(vertices[centres], counts, axis=0)
            inside = np.einsum("ij,ij->i", away, away) < np.repeat(radii_mm[centres] ** 2, counts)
            ends = np.concatenate([[0], np.cumsum(inside)])[ball.indptr]
            ball = sparse.csr_matrix(
                (np.ones(ends[-1], dtype=bool), ball.indices[inside], ends), shape=(len(centres), len(vertices))
            )
        yield centres, ball


def _fit(
    vertices: Floats,
    normals: Floats,
    areas: Floats,
    radii_mm: Floats,
    centres: Ints,
    balls: sparse.csr_matrix,
    boundary: NDArray[np.bool_],
) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """Returns coefficients, fitted and one_sided of `Quadrics` for some centres and the patterns of their balls."""
    near, starts, counts = balls.indices, balls.indptr[:-1], np.diff(balls.indptr)
    scale = np.repeat(radii_mm[centres], counts)
    away = (vertices[near] - np.repeat(vertices[centres], counts, axis=0)) / scale[:, None]
    facing = normals[near]
    share = areas[near] * (1.0 - np.einsum("ij,ij->i", away, away))

    upright = normals[centres]
    for _ in range(2):
        weights = share * np.maximum(np.einsum("ij,ij->i", facing, np.repeat(upright, counts, axis=0)), 0.0)
        upright = unit(np.add.reduceat(weights[:, None] * facing, starts))
    across = unit(np.cross(upright, np.eye(3)[np.abs(upright).argmin(axis=1)]))
    frames = np.stack([across, np.cross(upright, across), upright], axis=1)
    x, y, z = np.einsum("ijk,ik->ji", np.repeat(frames, counts, axis=0), away)

    powers = {(0, 0): weights, (1, 0): weights * x, (0, 1): weights * y}
    for a, b in _MONOMIALS:
        if (a, b) not in powers:
            powers[a, b] = powers[a - 1, b] * x if a else powers[a, b - 1] * y
    columns = [*(powers[key] for key in _MONOMIALS), *(powers[key] * z for key in _POWERS)]
    sums = np.stack([np.add.reduceat(column, starts) for column in columns], axis=1)
    sums /= np.maximum(sums[:, [_MONOMIALS.index((0, 0))]], np.finfo(float).tiny)

    matrices, right = sums[:, _NORMAL_EQUATIONS], sums[:, len(_MONOMIALS) :]
    values = np.linalg.eigvalsh(matrices)
    fitted = values[:, 0] > 1e-9 * np.abs(values[:, -1])
    coefficients = np.zeros((len(centres), 6))
    coefficients[fitted] = np.linalg.solve(matrices[fitted], right[fitted, :, None])[..., 0]
    # back from units of the radius
    coefficients *= radii_mm[centres, None] ** np.array([-1, -1, -1, 0, 0, 1])
    return coefficients, fitted, balls @ boundary
