"""Values smoothed or continued along a surface or inside a solid mesh, not across a sulcus or fissure."""

from collections.abc import Callable
from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .tetrahedra import volumes_between
from .triangles import Floats, TriangleMesh, face_areas

STEPS = 8
"""Implicit steps: their product has the Gaussian's variance, and nearly its shape."""


@dataclass(frozen=True)
class Share:
    """A process' share of a task: number `rank` of `ranks`; `summed` adds the arrays of all processes up."""

    rank: int = 0
    ranks: int = 1
    summed: Callable[[Floats], Floats] = np.asarray

    def of(self, count: int) -> slice:
        """Return which of a number of things are this process'."""
        return slice(count * self.rank // self.ranks, count * (self.rank + 1) // self.ranks)


ALONE = Share()


def cell_sizes(vertices: Floats, cells: NDArray[np.integer]) -> Floats:
    """Return the (m,) areas in mm² of (m, 3) triangles, or signed volumes in mm³ of (m, 4) tetrahedra."""
    if cells.shape[1] == 3:
        return face_areas(TriangleMesh(vertices, cells.astype(np.int64)))
    return volumes_between(vertices, cells)


def vertex_sizes(vertices: Floats, cells: NDArray[np.integer]) -> Floats:
    """Return the (n,) areas or volumes that belong to the vertices: equal parts of the cells around."""
    share = np.repeat(cell_sizes(vertices, cells) / cells.shape[1], cells.shape[1])
    return np.bincount(cells.ravel(), share, minlength=len(vertices)).astype(np.float64)


def diffuse(vertices: Floats, cells: NDArray[np.integer], values: Floats, sigma_mm: float) -> Floats:
    """Return (n,) or (n, k) values smoothed as by a Gaussian of standard deviation `sigma_mm` along the mesh.

    Linear finite elements with lumped mass, implicit steps of the heat equation over the time σ²/2, which keep the
    integral. `vertices` are (n, 3) in mm, `cells` (m, 3) triangles or (m, 4) tetrahedra, none inverted.
    """
    if sigma_mm == 0:
        return values.copy()
    mass = vertex_sizes(vertices, cells)
    mass = np.where(mass > 0, mass, 1.0)
    matrix = sparse.csr_matrix(sparse.diags(mass) + sigma_mm**2 / 2 / STEPS * stiffness_matrix(vertices, cells))
    smooth: Floats = values.reshape(len(values), -1).astype(float)
    for _ in range(STEPS):
        smooth = conjugate_gradients(matrix, mass[:, None] * smooth, smooth, 1e-8)
    return smooth.reshape(values.shape)


def harmonic_continuation(
    vertices: Floats, cells: NDArray[np.integer], known: NDArray[np.integer], tolerance: float = 1e-8
) -> Callable[[Floats], Floats]:
    """Return the function that continues values (m, k) at the `known` vertices to (n, k) harmonically along a mesh.

    The boundary is free elsewhere; `tolerance` is that of `conjugate_gradients`.
    """
    unknown = np.setdiff1d(np.unique(cells), known)
    rows = stiffness_matrix(vertices, cells)[unknown]
    matrix, to_known = rows[:, unknown], rows[:, known]

    def continued(values: Floats) -> Floats:
        everywhere = np.zeros((len(vertices), values.shape[1]))
        everywhere[known], right = values, -(to_known @ values)
        everywhere[unknown] = conjugate_gradients(matrix, right, np.zeros_like(right), tolerance)
        return everywhere

    return continued


def conjugate_gradients(matrix: sparse.csr_matrix, right: Floats, start: Floats, tolerance: float) -> Floats:
    """Solve for all (n, k) columns at once by conjugate gradients with Jacobi's preconditioner.

    The residual of each column falls below a part `tolerance` of its right-hand side; ValueError where it does not, as
    with degenerate cells.
    """
    # in rows, one for each column: products with single vectors take half the time of those with all at once
    right, solution = np.ascontiguousarray(right.T), start.T.copy()
    inverse = 1.0 / matrix.diagonal()

    def product(rows: Floats) -> Floats:
        return np.stack([matrix @ row for row in rows])

    residual = right - product(solution)
    least = tolerance * np.linalg.norm(right, axis=1)
    preconditioned = inverse * residual
    direction = preconditioned.copy()
    slope = np.einsum("ij,ij->i", residual, preconditioned)
    for _ in range(10_000):
        left = np.linalg.norm(residual, axis=1) > least
        if not left.any():
            return np.ascontiguousarray(solution.T)
        steps = product(direction)
        # a column that is solved exactly has no direction any more
        length = (slope / np.where(left, np.einsum("ij,ij->i", direction, steps), np.inf))[:, None]
        solution += np.multiply(length, direction, out=preconditioned)
        residual -= np.multiply(length, steps, out=steps)
        np.multiply(inverse, residual, out=preconditioned)
        before, slope = slope, np.einsum("ij,ij->i", residual, preconditioned)
        direction *= (slope / np.where(left, before, np.inf))[:, None]
        direction += preconditioned
    raise ValueError("diffusion does not converge: the mesh has degenerate cells")


def stiffness_matrix(vertices: Floats, cells: NDArray[np.integer]) -> sparse.csr_matrix:
    """Return the (n, n) stiffness matrix of linear finite elements, positive semidefinite."""
    cotangents = igl.cotmatrix(np.ascontiguousarray(vertices), np.ascontiguousarray(cells, dtype=np.int64))
    return sparse.csr_matrix(-cotangents)
