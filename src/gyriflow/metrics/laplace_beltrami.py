"""Modes of the Laplace-Beltrami operator of a triangle surface, K φ = λ M φ, with a
count that none is missing."""

from dataclasses import dataclass

import igl
import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from ..errors import MeshError, SolverError
from ..geometry.diffusion import stiffness_matrix
from ..geometry.triangles import Floats, TriangleMesh, vertex_areas
from ..settings.terms import MassMatrix

RESIDUAL_TOL = 1e-10
"""Largest residual of a mode, relative to its eigenvalue of the inverted operator."""
MODES_PER_SLICE = 100
"""Eigenvalues to find with each shift; from 60 to 200 it matters little."""
BLOCK = 8
"""Vectors that are multiplied at once; from 4 to 8 it matters little."""
SLIVERS = "Remesh the surface: slivers make its spectrum inexact."
DENSE_VERTICES = 1000
"""Up to this size LAPACK solves the problem as a whole."""


@dataclass(frozen=True, eq=False)
class Modes:
    """The lowest modes of a surface: (k,) ascending eigenvalues λ in mm⁻², the first 0,
    and (n, k) functions in mm⁻¹.

    The functions, as columns, are M-orthonormal: φᵢᵀ M φⱼ = δᵢⱼ.
    """

    eigenvalues: Floats
    functions: Floats


def laplacian(
    mesh: TriangleMesh, mass: MassMatrix = "mean"
) -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
    """Return the (n, n) stiffness K (no unit) and mass M (mm²) of linear finite
    elements.

    With the consistent mass matrix eigenvalues are too large by about (kh)²/12, for
    waves of number k on edges h; with the lumped one too small by as much. Their `mean`
    cancels this (Ainsworth and Wajid 2010, SIAM J. Numer. Anal. 48, 346-371).
    `consistent` is as in LaPy. The boundary of an open surface is free (Neumann).
    MeshError where a vertex has no face.
    """
    unused = len(mesh.vertices) - len(np.unique(mesh.faces))
    if unused:
        raise MeshError(
            "vertices without a face have no Laplacian", found=unused, expected=0
        )
    stiffness = stiffness_matrix(mesh.vertices, mesh.faces)
    matrix = igl.massmatrix(mesh.vertices, mesh.faces, igl.MASSMATRIX_TYPE_FULL)
    if mass == "mean":
        matrix = 0.5 * (matrix + sparse.diags(vertex_areas(mesh)))
    return sparse.csc_matrix(stiffness), sparse.csc_matrix(matrix)


def first_eigenvalue(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix) -> float:
    """Return λ1, the lowest eigenvalue above 0, in mm⁻²; MeshError where the surface is
    not in one piece."""
    shift, size = -_spacing(mass), stiffness.shape[0]
    inverse = LinearOperator(
        (size, size), _factorise(stiffness, mass, shift).solve, dtype=np.float64
    )
    start = np.random.default_rng(1).standard_normal(size)
    values = eigsh(
        stiffness,
        2,
        mass,
        sigma=shift,
        OPinv=inverse,
        v0=start,
        return_eigenvectors=False,
    )
    # the constant is the only mode at 0 of a connected surface; Weyl's spacing gives
    # the scale
    if values.max() < -1e-6 * shift:
        raise MeshError(
            "the surface is not in one piece",
            remedy="Remove all but its largest piece.",
        )
    return float(values.max())


def lowest_modes(
    stiffness: sparse.csc_matrix,
    mass: sparse.csc_matrix,
    count: int,
) -> Modes:
    """Return the `count` lowest modes of K φ = λ M φ, by `modes_below` a limit that has
    at least as many below it.

    SolverError for a count that the surface does not have, and where a mode is missed.
    """
    size = stiffness.shape[0]
    largest = size if size <= DENSE_VERTICES else size // 2
    if not 1 <= count <= largest:
        raise SolverError(
            "impossible number of modes",
            found=count,
            expected=f"1 to {largest} for {size} vertices",
        )
    if size <= DENSE_VERTICES:
        return Modes(
            *linalg.eigh(
                stiffness.toarray(), mass.toarray(), subset_by_index=(0, count - 1)
            )
        )
    needed, top = count + 2, (count + 6) * _spacing(mass)
    while (n_below := count_below(stiffness, mass, top)) < count:
        top *= 1.01 * needed / max(n_below, needed // 4)
    modes = modes_below(stiffness, mass, top, n_below)
    return Modes(modes.eigenvalues[:count], modes.functions[:, :count])


def modes_below(
    stiffness: sparse.csc_matrix,
    mass: sparse.csc_matrix,
    value: float,
    count: int | None = None,
) -> Modes:
    """Return all modes of K φ = λ M φ with λ below `value` (mm⁻²).

    Spectrum slicing with shift and invert: the inertia of K − λM at the ends of a slice
    gives the number of its eigenvalues, so that none can be missed (Grimes, Lewis and
    Simon 1994, SIAM J. Matrix Anal. Appl. 15, 228-272). `count` is that of
    `count_below`, if known. SolverError where a mode is missed.
    """
    if count is None:
        count = count_below(stiffness, mass, value)
    if stiffness.shape[0] <= DENSE_VERTICES:
        return lowest_modes(stiffness, mass, count)

    # the eigenvalues of a surface are evenly spaced (Weyl's law)
    n_slices = max(1, round(count / MODES_PER_SLICE))
    ends = np.linspace(-_spacing(mass), value, n_slices + 1)
    counts = [0]
    for end in ends[1:-1]:
        counts.append(count_below(stiffness, mass, float(end)))
    counts.append(count)

    slices = []
    for i in range(n_slices):
        low, high = ends[i], ends[i + 1]
        try:
            slices.append(
                _modes_between(stiffness, mass, low, high, counts[i + 1] - counts[i])
            )
        except (linalg.LinAlgError, RuntimeError) as error:
            problem = (
                f"the modes with λ from {low:g} to {high:g} mm⁻² could not be found"
            )
            raise SolverError(problem, found=str(error), remedy=SLIVERS) from error
    eigenvalues = np.concatenate([modes.eigenvalues for modes in slices])
    return Modes(eigenvalues, np.hstack([modes.functions for modes in slices]))


def _modes_between(
    stiffness: sparse.csc_matrix,
    mass: sparse.csc_matrix,
    low: float,
    high: float,
    count: int,
) -> Modes:
    """Return the `count` modes with low < λ < high, by block Lanczos with (K − σM)⁻¹ M
    and σ in the middle.

    SolverError where not all are found.
    """
    shift = 0.5 * (low + high)
    solve = _factorise(stiffness, mass, shift).solve
    size = stiffness.shape[0]
    max_vectors = min(5 * count + 20 * BLOCK, size - size % BLOCK)
    basis = np.empty((size, max_vectors), order="F")
    # the operator in the basis: its upper triangle
    projected = np.zeros((max_vectors, max_vectors))

    block, _ = _orthonormalise(
        np.random.default_rng(1).standard_normal((size, BLOCK)), mass
    )
    next_check = 2 * count + 4 * BLOCK
    found = 0
    for used in range(BLOCK, max_vectors + 1, BLOCK):
        last = slice(used - BLOCK, used)
        basis[:, last] = block
        block = solve(mass @ basis[:, last])
        recent = slice(max(used - 2 * BLOCK, 0), used)
        projected[recent, last] = basis[:, recent].T @ (mass @ block)
        block -= basis[:, recent] @ projected[recent, last]
        # in exact arithmetic the block is orthogonal to the earlier ones by now
        block -= basis[:, :used] @ (basis[:, :used].T @ (mass @ block))
        block, coupling = _orthonormalise(block, mass)
        if used < next_check and used < max_vectors:
            continue

        next_check = used + 2 * BLOCK
        inverse, vectors = linalg.eigh(projected[:used, :used], lower=False)
        eigenvalues = shift + 1.0 / inverse
        is_inside = (low < eigenvalues) & (eigenvalues < high)
        residuals = np.linalg.norm(coupling @ vectors[-BLOCK:], axis=0)
        has_converged = residuals <= RESIDUAL_TOL * np.abs(inverse)
        found = int(np.count_nonzero(is_inside & has_converged))
        if found == count == np.count_nonzero(is_inside):
            order = np.argsort(eigenvalues[is_inside])
            functions = basis[:, :used] @ vectors[:, is_inside][:, order]
            # Rayleigh's quotient is more exact than 1/θ where the shift is near an
            # eigenvalue
            return Modes(np.sum(functions * (stiffness @ functions), axis=0), functions)
    problem = f"not all modes with λ from {low:g} to {high:g} mm⁻² were found"
    raise SolverError(
        problem,
        found=found,
        expected=count,
        remedy=SLIVERS,
    )


def _orthonormalise(block: Floats, mass: sparse.csc_matrix) -> tuple[Floats, Floats]:
    """Return M-orthonormal vectors Q (n, b) and R (b, b) with block = Q R."""
    vectors, first = linalg.qr(block, mode="economic")
    products = vectors.T @ (mass @ vectors)
    second = linalg.cholesky(products)
    transposed = linalg.solve_triangular(second, vectors.T, trans="T")
    return transposed.T, second @ first


def _spacing(mass: sparse.csc_matrix) -> float:
    return float(4.0 * np.pi / mass.sum())


def _factorise(
    stiffness: sparse.csc_matrix,
    mass: sparse.csc_matrix,
    shift: float,
) -> SuperLU:
    # this order of columns is not SuperLU's own: its larger panels and relaxed
    # supernodes take ten times as long
    return splu(
        sparse.csc_matrix(stiffness - shift * mass),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        relax=1,
        panel_size=1,
        options={"SymmetricMode": True},
    )


def count_below(
    stiffness: sparse.csc_matrix,
    mass: sparse.csc_matrix,
    value: float,
) -> int:
    """Return the number of eigenvalues below `value` (mm⁻²), from the inertia of K −
    value·M.

    With pivots on the diagonal, P(K − value·M)Pᵀ = L U with U = D Lᵀ, so D has the
    signs of the eigenvalues.
    """
    factors = _factorise(stiffness, mass, value)
    if not np.array_equal(factors.perm_r, factors.perm_c):
        raise SolverError(
            "no inertia: a pivot off the diagonal was taken",
            found=f"shift {value:g} mm⁻²",
        )
    return int(np.count_nonzero(factors.U.diagonal() < 0))
