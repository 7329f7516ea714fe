"""Smoothing and harmonic continuation of values along a surface or a solid mesh, not
across sulci."""

from collections.abc import Callable

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import cg

from .tetrahedra import volumes_between
from .triangles import Floats, TriangleMesh, face_areas

SMOOTH_TOL = 1e-3
"""Relative tolerance of smoothing in one step."""
STEPS = 8
"""Number of implicit steps; their product has the Gaussian's variance and almost its
shape."""
MAX_ITERATIONS = 10_000


def cell_sizes(vertices: Floats, cells: NDArray[np.integer]) -> Floats:
    """Return the (m,) areas in mm² of (m, 3) triangles, or signed volumes in mm³ of (m,
    4) tetrahedra."""
    if cells.shape[1] == 3:
        return face_areas(TriangleMesh(vertices, cells.astype(np.int64)))
    return volumes_between(vertices, cells)


def vertex_sizes(vertices: Floats, cells: NDArray[np.integer]) -> Floats:
    """Return the (n,) areas or volumes of the vertices: equal parts of the cells around
    them."""
    share = np.repeat(cell_sizes(vertices, cells) / cells.shape[1], cells.shape[1])
    return np.bincount(cells.ravel(), share, minlength=len(vertices)).astype(np.float64)


def diffuse(
    vertices: Floats,
    cells: NDArray[np.integer],
    values: Floats,
    sigma_mm: float,
    tolerance: float = 1e-8,
) -> Floats:
    """Smooth (n,) or (n, k) values along the mesh, as a Gaussian of standard deviation
    `sigma_mm` would.

    Implicit steps of the heat equation over the time σ²/2, with linear finite elements
    and lumped mass, preserve the integral. `vertices` are (n, 3) in mm, `cells` (m, 3)
    triangles or (m, 4) tetrahedra, none inverted.
    """
    if sigma_mm == 0:
        return values.copy()
    mass = vertex_sizes(vertices, cells)
    mass = np.where(mass > 0, mass, 1.0)
    matrix = sparse.csr_matrix(
        sparse.diags(mass) + sigma_mm**2 / 2 / STEPS * stiffness_matrix(vertices, cells)
    )
    smooth: Floats = values.reshape(len(values), -1).astype(float)
    for _ in range(STEPS):
        smooth = conjugate_gradients(matrix, mass[:, None] * smooth, smooth, tolerance)
    return smooth.reshape(values.shape)


def integrals_at_vertices(
    vertices: Floats, cells: NDArray[np.integer], values: Floats
) -> Floats:
    """Return the (n, k) integrals around the vertices of the (m, k) values of cells:
    equal parts of the cells' own."""
    shares = values * (cell_sizes(vertices, cells) / cells.shape[1])[:, None]
    columns = [
        np.bincount(cells.ravel(), np.repeat(column, cells.shape[1]), len(vertices))
        for column in shares.T
    ]
    return np.stack(columns, axis=1)


def smooth_integrals(
    vertices: Floats, cells: NDArray[np.integer], integrals: Floats, length_mm: float
) -> Floats:
    """Return (n, k) smooth values at the vertices from their integrals around them, by
    one implicit step of diffusion.

    The step has longer tails than a Gaussian of the standard deviation `length_mm`. Its
    relative error is `SMOOTH_TOL`.
    """
    sizes = vertex_sizes(vertices, cells)
    sizes = np.where(sizes > 0, sizes, 1.0)
    matrix = sparse.csr_matrix(
        sparse.diags(sizes) + length_mm**2 / 2 * stiffness_matrix(vertices, cells)
    )
    return conjugate_gradients(
        matrix, integrals, integrals / sizes[:, None], SMOOTH_TOL
    )


def harmonic_continuation(
    vertices: Floats,
    cells: NDArray[np.integer],
    fixed: NDArray[np.integer],
    tolerance: float = 1e-8,
) -> Callable[[Floats], Floats]:
    """Return a function that extends (m, k) values at `fixed` vertices to (n, k); the
    other boundary is free."""
    free = np.setdiff1d(np.unique(cells), fixed)
    rows = stiffness_matrix(vertices, cells)[free]
    matrix, to_fixed = rows[:, free], rows[:, fixed]

    def extend(values: Floats) -> Floats:
        everywhere = np.zeros((len(vertices), values.shape[1]))
        everywhere[fixed], right = values, -(to_fixed @ values)
        everywhere[free] = conjugate_gradients(
            matrix, right, np.zeros_like(right), tolerance
        )
        return everywhere

    return extend


def conjugate_gradients(
    matrix: sparse.csr_matrix, right: Floats, start: Floats, tolerance: float
) -> Floats:
    """Solve for all (n, k) columns by conjugate gradients with the Jacobi
    preconditioner.

    `tolerance` is relative to the right-hand side. ValueError if it is not reached, as
    with degenerate cells.
    """
    jacobi = sparse.diags(1.0 / matrix.diagonal())
    columns = [
        cg(matrix, column, guess, rtol=tolerance, maxiter=MAX_ITERATIONS, M=jacobi)
        for column, guess in zip(right.T, start.T, strict=True)
    ]
    if any(code for _, code in columns):
        raise ValueError("diffusion does not converge: the mesh has degenerate cells")
    return np.stack([solution for solution, _ in columns], axis=1)


def stiffness_matrix(vertices: Floats, cells: NDArray[np.integer]) -> sparse.csr_matrix:
    """Return the (n, n) stiffness matrix of linear finite elements, positive
    semidefinite."""
    cotangents = igl.cotmatrix(
        np.ascontiguousarray(vertices), np.ascontiguousarray(cells, dtype=np.int64)
    )
    return sparse.csr_matrix(-cotangents)
