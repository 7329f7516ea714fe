"""Values smoothed or continued along a surface or inside a solid mesh, not across a sulcus or fissure."""

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg

from .tetrahedra import volumes_between
from .triangles import Floats, TriangleMesh, face_areas

STEPS = 8
"""Implicit steps: their product has the Gaussian's variance, and nearly its shape."""


def cell_sizes(vertices: Floats, cells: NDArray[np.integer]) -> Floats:
    """Return the (m,) areas in mm² of (m, 3) triangles, or signed volumes in mm³ of (m, 4) tetrahedra."""
    if cells.shape[1] == 3:
        return face_areas(TriangleMesh(vertices, cells.astype(np.int64)))
    return volumes_between(vertices, cells)


def vertex_sizes(vertices: Floats, cells: NDArray[np.integer]) -> Floats:
    """Return the (n,) areas or volumes that belong to the vertices: equal parts of the cells around."""
    share = np.repeat(cell_sizes(vertices, cells) / cells.shape[1], cells.shape[1])
    return np.bincount(cells.ravel(), share, minlength=len(vertices)).astype(np.float64)


def diffuse(
    vertices: Floats, cells: NDArray[np.integer], values: Floats, sigma_mm: float, *, steps: int = STEPS
) -> Floats:
    """Return (n,) or (n, k) values smoothed as by a Gaussian of standard deviation `sigma_mm` along the mesh.

    Linear finite elements with lumped mass, implicit steps of the heat equation over the time σ²/2. The integral of
    the values over the mesh stays as it is. 0 returns them as they are. `vertices` are (n, 3) in mm, `cells` (m, 3)
    triangles or (m, 4) tetrahedra, none inverted. Fewer implicit `steps` make tails longer than a Gaussian's.
    """
    if sigma_mm == 0:
        return values.copy()
    mass = vertex_sizes(vertices, cells)
    mass = np.where(mass > 0, mass, 1.0)
    matrix = sparse.csr_matrix(sparse.diags(mass) + sigma_mm**2 / 2 / steps * stiffness_matrix(vertices, cells))
    smooth = []
    for column in values.reshape(len(values), -1).T.astype(float):
        for _ in range(steps):
            column = _solved(matrix, mass * column, column)
        smooth.append(column)
    return np.stack(smooth, axis=1).reshape(values.shape)


def continue_harmonically(
    vertices: Floats, cells: NDArray[np.integer], known: NDArray[np.integer], values: Floats
) -> Floats:
    """Return (n, k) values that are harmonic along a mesh and as given, (m, k), at the `known` vertices."""
    unknown = np.setdiff1d(np.unique(cells), known)
    continued = np.zeros((len(vertices), values.shape[1]))
    continued[known] = values
    rows = stiffness_matrix(vertices, cells)[unknown]
    matrix, right = rows[:, unknown], -(rows[:, known] @ values)
    for column in range(values.shape[1]):
        continued[unknown, column] = _solved(matrix, right[:, column])
    return continued


def _solved(matrix: sparse.csr_matrix, right: Floats, start: Floats | None = None) -> Floats:
    """Solve a positive definite system by conjugate gradients, preconditioned by its diagonal."""
    inverse = 1.0 / matrix.diagonal()
    nearly = LinearOperator(matrix.shape, matvec=lambda x: inverse * x.ravel(), dtype=float)
    solution, failed = cg(matrix, right, x0=start, M=nearly, rtol=1e-8, maxiter=10000)
    if failed:
        raise ValueError("diffusion along the mesh does not converge: it has degenerate cells")
    return np.asarray(solution)


def stiffness_matrix(vertices: Floats, cells: NDArray[np.integer]) -> sparse.csr_matrix:
    """Return the (n, n) stiffness matrix of linear finite elements, positive semidefinite."""
    cotangents = igl.cotmatrix(np.ascontiguousarray(vertices), np.ascontiguousarray(cells, dtype=np.int64))
    return sparse.csr_matrix(-cotangents)
