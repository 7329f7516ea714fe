"""Smoothing and harmonic continuation of values along a surface or a solid mesh, not
across sulci."""

from collections.abc import Callable

import igl
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg

from .jacobians import EDGES, SLOPES, chunks, cofactors_of, element_maps
from .tetrahedra import volumes_between
from .triangles import Floats, Indices, TriangleMesh, face_areas

SMOOTH_TOL = 1e-3
"""Relative tolerance of smoothing in one step."""
STEPS = 8
"""Number of implicit steps; their product has the Gaussian's variance and almost its
shape."""
MAX_ITERATIONS = 10_000


def _cell_sizes(vertices: Floats, cells: Indices) -> Floats:
    """Return the (m,) areas in mm² of (m, 3) triangles, or signed volumes in mm³ of (m,
    4) tetrahedra."""
    if cells.shape[1] == 4:
        return volumes_between(vertices, cells)
    faces = cells.astype(np.int64)
    return face_areas(TriangleMesh(vertices, faces))


def vertex_sizes(vertices: Floats, cells: Indices) -> Floats:
    """Return the (n,) areas or volumes of the vertices: equal parts of the cells around
    them."""
    n_corners = cells.shape[1]
    shares = _cell_sizes(vertices, cells) / n_corners
    parts = np.repeat(shares, n_corners)
    return np.bincount(
        cells.ravel(),
        parts,
        len(vertices),
    )


def diffuse(
    vertices: Floats,
    cells: Indices,
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
    mass, matrix = _implicit_step(
        vertices,
        cells,
        sigma_mm**2 / 2 / STEPS,
    )
    smooth: Floats = values.reshape(len(values), -1).astype(float)
    for _ in range(STEPS):
        smooth = _solve(
            matrix,
            mass[:, None] * smooth,
            smooth,
            tolerance,
        )
    return smooth.reshape(values.shape)


def _implicit_step(
    vertices: Floats,
    cells: Indices,
    time_mm2: float,
) -> tuple[Floats, sparse.csr_matrix]:
    """Return the (n,) lumped masses M, and the matrix M + t K of an implicit step of
    the heat equation over the time t."""
    mass = vertex_sizes(vertices, cells)
    # vertices without cells have empty rows, and keep their values
    mass[mass <= 0] = 1.0
    stiffness = stiffness_matrix(vertices, cells)
    return mass, sparse.csr_matrix(sparse.diags(mass) + time_mm2 * stiffness)


def integrals_at_vertices(
    vertices: Floats,
    cells: Indices,
    values: Floats,
) -> Floats:
    """Return the (n, k) integrals around the vertices of the (m, k) values of cells:
    equal parts of the cells' own."""
    corners = cells.shape[1]
    shares = _cell_sizes(vertices, cells) / corners
    integrals = []
    for column in values.T:
        parts = np.repeat(column * shares, corners)
        integrals.append(
            np.bincount(
                cells.ravel(),
                parts,
                len(vertices),
            )
        )
    return np.stack(integrals, axis=1)


def smooth_integrals(
    vertices: Floats,
    cells: Indices,
    integrals: Floats,
    length_mm: float,
) -> Floats:
    """Return (n, k) smooth values at the vertices from their integrals around them, by
    one implicit step of diffusion.

    The step has longer tails than a Gaussian of the standard deviation `length_mm`. It
    is solved to the relative tolerance `SMOOTH_TOL`.
    """
    mass, matrix = _implicit_step(vertices, cells, length_mm**2 / 2)
    means = integrals / mass[:, None]
    return _solve(matrix, integrals, means, SMOOTH_TOL)


def harmonic_continuation(
    vertices: Floats,
    cells: Indices,
    fixed: Indices,
    tolerance: float = 1e-8,
) -> Callable[[Floats], Floats]:
    """Return a function that extends (m, k) values at `fixed` vertices to (n, k); the
    other boundary is free."""
    free = np.setdiff1d(np.unique(cells), fixed)
    rows = stiffness_matrix(vertices, cells)[free]
    matrix = rows[:, free]
    to_fixed = rows[:, fixed]

    def extend(values: Floats) -> Floats:
        right = -(to_fixed @ values)
        everywhere = np.zeros((len(vertices), values.shape[1]))
        everywhere[fixed] = values
        everywhere[free] = _solve(
            matrix,
            right,
            np.zeros_like(right),
            tolerance,
        )
        return everywhere

    return extend


def _solve(
    matrix: sparse.csr_matrix,
    right: Floats,
    start: Floats,
    tolerance: float,
) -> Floats:
    """Solve for all (n, k) columns by conjugate gradients with the Jacobi
    preconditioner.

    `tolerance` is relative to the right-hand side. ValueError if it is not reached, as
    with degenerate cells.
    """
    options = {
        "rtol": tolerance,
        "maxiter": MAX_ITERATIONS,
        "M": sparse.diags(1.0 / matrix.diagonal()),
    }
    solutions = []
    for column, guess in zip(
        right.T,
        start.T,
        strict=True,
    ):
        solution, failure = cg(matrix, column, guess, **options)
        if failure:
            raise ValueError(
                "diffusion does not converge: the mesh has degenerate cells"
            )
        solutions.append(solution)
    return np.stack(solutions, axis=1)


def stiffness_matrix(vertices: Floats, cells: Indices) -> sparse.csr_matrix:
    """Return the (n, n) stiffness matrix of linear finite elements, positive
    semidefinite."""
    if cells.shape[1] == 4:
        return _stiffness_of_tetrahedra(vertices, cells)
    cotangents = igl.cotmatrix(
        np.ascontiguousarray(vertices),
        np.ascontiguousarray(cells, dtype=np.int64),
    )
    return sparse.csr_matrix(-cotangents)


def _stiffness_of_tetrahedra(vertices: Floats, tets: Indices) -> sparse.csr_matrix:
    # three times as fast as by igl
    between = np.empty((len(EDGES), len(tets)))
    for chunk in chunks(len(tets)):
        (maps,) = element_maps(
            vertices,
            tets[chunk],
            SLOPES[None],
        )
        cofactors = cofactors_of(maps)
        volumes6 = np.abs((maps[0] * cofactors[0]).sum(axis=0))
        # gradients of the shape functions, times six volumes
        gradients = np.concatenate([-cofactors.sum(axis=0)[None], cofactors])
        for edge, (i, j) in enumerate(EDGES):
            products = (gradients[i] * gradients[j]).sum(axis=0)
            between[edge, chunk] = products / (6 * volumes6)
    # integers of the matrix' own type: others are converted
    nodes = tets.T.astype(np.int32)
    first, second = nodes[np.transpose(EDGES)]
    rows = np.minimum(first, second).ravel()
    columns = np.maximum(first, second).ravel()
    size = (len(vertices), len(vertices))
    above = sparse.coo_matrix((between.ravel(), (rows, columns)), shape=size).tocsr()
    matrix = above + above.T
    sums = np.ravel(matrix.sum(axis=1))
    return sparse.csr_matrix(matrix - sparse.diags(sums))
