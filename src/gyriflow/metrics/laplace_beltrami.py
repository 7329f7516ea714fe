"""Modes of the Laplace-Beltrami operator of a triangle surface, K φ = λ M φ, with a
count that none is missing."""

from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from ..errors import MeshError, SolverError
from ..geometry.diffusion import stiffness_matrix
from ..geometry.triangles import Floats, TriangleMesh, vertex_areas
from ..settings.terms import MassMatrix

RESIDUAL_TOL = 1e-5
"""Largest residual of a mode, relative to its eigenvalue of the inverted operator.
Eigenvalues are exact to its square. Modes mix with those of other slices by some 1e-5,
which changes the power of a band by less."""
MODES_PER_SLICE = 100
"""Eigenvalues to find with each shift; from 60 to 200 it matters little."""
BLOCK = 8
"""Vectors that are multiplied at once; from 4 to 8 it matters little."""
SUPERNODE = 10
"""Columns of the factors that are stored together in spite of some zeros: solutions
take two thirds of the time; from 4 to 20 it matters little."""
SLIVERS = "Remesh the surface: slivers make its spectrum inexact."
DENSE_VERTICES = 1000
"""Up to this size LAPACK solves the problem as a whole."""


@dataclass(frozen=True, eq=False)
class Modes:
    """The lowest modes of a surface: (k,) ascending eigenvalues λ in mm⁻², the first 0,
    and (n, k) functions in mm⁻¹.

    The functions, as columns, are M-orthonormal: φᵢᵀ M φⱼ = δᵢⱼ. On surfaces of more
    than `DENSE_VERTICES` they are in single precision.
    """

    eigenvalues: Floats
    functions: NDArray[np.floating]


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
    matrix = igl.massmatrix(
        mesh.vertices,
        mesh.faces,
        igl.MASSMATRIX_TYPE_FULL,
    )
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
        # eigenvalues are exact to its square
        tol=1e-6,
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
    return Modes(
        modes.eigenvalues[:count],
        modes.functions[:, :count],
    )


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

    # one order for all factorisations
    order = np.argsort(_factorise(stiffness, mass, -_spacing(mass)).perm_c)
    stiffness, mass = (matrix[order][:, order] for matrix in (stiffness, mass))

    # the eigenvalues of a surface are evenly spaced (Weyl's law)
    n_slices = max(1, round(count / MODES_PER_SLICE))
    ends = np.linspace(
        -_spacing(mass),
        value,
        n_slices + 1,
    )
    counts = [0]
    for end in ends[1:-1]:
        counts.append(
            _inertia(
                _factorise(stiffness, mass, float(end), "NATURAL"),
                end,
            )
        )
    counts.append(count)

    eigenvalues = np.empty(count)
    functions = np.empty(
        (len(order), count),
        dtype=np.float32,
        order="F",
    )
    for i in range(n_slices):
        low, high = ends[i], ends[i + 1]
        part = slice(counts[i], counts[i + 1])
        try:
            modes = _modes_between(
                stiffness,
                mass,
                low,
                high,
                part.stop - part.start,
            )
        except (linalg.LinAlgError, RuntimeError) as error:
            problem = (
                f"the modes with λ from {low:g} to {high:g} mm⁻² could not be found"
            )
            raise SolverError(
                problem,
                found=str(error),
                remedy=SLIVERS,
            ) from error
        eigenvalues[part] = modes.eigenvalues
        functions[order, part] = modes.functions
    return Modes(eigenvalues, functions)


def _modes_between(
    stiffness: sparse.csc_matrix,
    mass: sparse.csc_matrix,
    low: float,
    high: float,
    count: int,
) -> Modes:
    """Return the `count` modes with low < λ < high, by block Lanczos with (K − σM)⁻¹ M
    and σ in the middle.

    Of a matrix whose order has little fill. SolverError where not all are found.
    """
    shift = 0.5 * (low + high)
    solve = _factorise(stiffness, mass, shift, "NATURAL").solve
    size = stiffness.shape[0]
    max_vectors = min(
        5 * count + 20 * BLOCK,
        size - size % BLOCK,
    )
    # in single precision: vectors that are orthogonal to the root of the rounding of
    # double precision have the same projected operator (Simon 1984, Linear Algebra
    # Appl. 61, 101-131)
    basis = np.empty(
        (size, max_vectors),
        dtype=np.float32,
        order="F",
    )
    # the operator in the basis: its upper triangle
    projected = np.zeros((max_vectors, max_vectors))

    block, weighted, coupling = _orthonormalise(
        np.random.default_rng(1).standard_normal((size, BLOCK)), mass
    )
    before = np.zeros((size, BLOCK))
    next_check = 2 * count + 8 * BLOCK
    found = 0
    for used in range(BLOCK, max_vectors + 1, BLOCK):
        last = slice(used - BLOCK, used)
        basis[:, last] = block
        following = np.ascontiguousarray(solve(weighted))
        if used > BLOCK:
            following -= before @ coupling.T
            projected[used - 2 * BLOCK : used - BLOCK, last] = coupling.T
        overlap = weighted.T @ following
        projected[last, last] = overlap
        following -= block @ overlap
        # in exact arithmetic it is orthogonal to the earlier ones by now
        earlier = basis[:, :used]
        # transposed, since BLAS is twice as fast with a wide matrix on the right
        overlaps = (mass @ following).astype(np.float32).T @ earlier
        following -= (overlaps @ earlier.T).T
        before = block
        block, weighted, coupling = _orthonormalise(following, mass)
        if used < next_check and used < max_vectors:
            continue

        next_check = used + 2 * BLOCK
        inverse, vectors = linalg.eigh(
            projected[:used, :used],
            lower=False,
        )
        eigenvalues = shift + 1.0 / inverse
        is_inside = (low < eigenvalues) & (eigenvalues < high)
        residuals = np.linalg.norm(
            coupling @ vectors[-BLOCK:],
            axis=0,
        )
        has_converged = residuals <= RESIDUAL_TOL * np.abs(inverse)
        found = int(np.count_nonzero(is_inside & has_converged))
        if found == count == np.count_nonzero(is_inside):
            order = np.argsort(eigenvalues[is_inside])
            combined = vectors[:, is_inside][:, order].astype(np.float32)
            functions = np.ascontiguousarray(basis[:, :used] @ combined)
            squares = _column_products(functions, mass @ functions)
            # Rayleigh's quotient is more exact than 1/θ where the shift is near an
            # eigenvalue
            return Modes(
                _column_products(functions, stiffness @ functions) / squares,
                functions / np.sqrt(squares).astype(np.float32),
            )
    problem = f"not all modes with λ from {low:g} to {high:g} mm⁻² were found"
    raise SolverError(
        problem,
        found=found,
        expected=count,
        remedy=SLIVERS,
    )


def _orthonormalise(
    block: Floats, mass: sparse.csc_matrix
) -> tuple[Floats, Floats, Floats]:
    """Return M-orthonormal vectors Q (n, b), M Q, and R (b, b) with block = Q R."""
    # rows of eight numbers together, as sparse products read them
    vectors = np.ascontiguousarray(block)
    weighted = mass @ vectors
    coupling = np.eye(block.shape[1])
    # once more, as rounding grows with the square of the block's condition
    for _ in range(2):
        factor = linalg.cholesky(vectors.T @ weighted)
        inverse = linalg.inv(factor)
        vectors = vectors @ inverse
        weighted = weighted @ inverse
        coupling = factor @ coupling
    return vectors, weighted, coupling


def _column_products(a: NDArray[np.floating], b: NDArray[np.floating]) -> Floats:
    """Return the (k,) inner products of the columns of two (n, k) arrays."""
    return np.einsum("ij,ij->j", a, b, dtype=np.float64)


def _spacing(mass: sparse.csc_matrix) -> float:
    return float(4.0 * np.pi / mass.sum())


def _factorise(
    stiffness: sparse.csc_matrix,
    mass: sparse.csc_matrix,
    shift: float,
    order: str = "MMD_AT_PLUS_A",
) -> SuperLU:
    # larger panels, and relaxed supernodes in any other order than that of the factors,
    # take ten times as long
    relax = SUPERNODE if order == "NATURAL" else 1
    return splu(
        sparse.csc_matrix(stiffness - shift * mass),
        permc_spec=order,
        diag_pivot_thresh=0.0,
        relax=relax,
        panel_size=1,
        options={"SymmetricMode": True},
    )


def count_below(
    stiffness: sparse.csc_matrix,
    mass: sparse.csc_matrix,
    value: float,
) -> int:
    """Return the number of eigenvalues below `value` (mm⁻²), from the inertia of K −
    value·M."""
    return _inertia(_factorise(stiffness, mass, value), value)


def _inertia(factors: SuperLU, shift: float) -> int:
    """Return the number of eigenvalues below the shift of factors.

    With pivots on the diagonal, P(K − σM)Pᵀ = L U with U = D Lᵀ, so D has the signs of
    the eigenvalues.
    """
    if not np.array_equal(factors.perm_r, factors.perm_c):
        raise SolverError(
            "no inertia: a pivot off the diagonal was taken",
            found=f"shift {shift:g} mm⁻²",
        )
    return int(np.count_nonzero(factors.U.diagonal() < 0))
