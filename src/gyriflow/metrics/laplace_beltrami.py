"""Modes of the Laplace-Beltrami operator of a triangle surface, K φ = λ M φ, with a count that none is missing."""

import logging
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from lapy import Solver, TriaMesh
from scipy import linalg, sparse
from scipy.linalg import blas
from scipy.sparse.linalg import SuperLU, splu

from ..errors import MeshError, SolverError
from ..geometry.triangles import Floats, Ints, TriangleMesh

MODES_PER_SLICE = 170
"""With fewer, factorising takes longer; with more, keeping the basis orthonormal. From 100 to 200 it matters little."""

BLOCK = 4
"""Vectors per solve. One costs twice as much per vector; with 8, the basis has to grow a fifth larger."""

TOLERANCE = 1e-10
"""Of the residual of a mode in (K − σM)⁻¹M, relative to its eigenvalue there."""

DENSE_VERTICES = 600
DENSE_VERTICES_MANY_MODES = 3000
"""Up to these sizes LAPACK solves the problem as a whole; the second where over a third of all modes are wanted."""


@dataclass(frozen=True, eq=False)
class Modes:
    """The lowest modes of a surface.

    Attributes
    ----------
    eigenvalues : (k,) float
        λ in mm⁻², ascending; the first is 0.
    functions : (n, k) float
        Eigenfunctions per vertex as columns, in mm⁻¹, M-orthonormal: φᵢᵀ M φⱼ = δᵢⱼ.
    """

    eigenvalues: Floats
    functions: Floats


def laplacian(mesh: TriangleMesh) -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
    """Returns the (n, n) stiffness K (no unit) and mass M (mm²) of linear finite elements (lapy).

    The boundary of an open surface is free (Neumann). MeshError where a vertex has no face.
    """
    unused = len(mesh.vertices) - len(np.unique(mesh.faces))
    if unused:
        raise MeshError("vertices without a face have no Laplacian", found=unused, expected=0)
    logging.getLogger("lapy").setLevel(logging.WARNING)  # it reports each assembly
    solver = Solver(TriaMesh(mesh.vertices, mesh.faces), lump=False)
    return sparse.csc_matrix(solver.stiffness), sparse.csc_matrix(solver.mass)


def lowest_modes(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, count: int, *, threads: int = 1) -> Modes:
    """Returns the `count` lowest modes of K φ = λ M φ.

    The spectrum is cut into slices. The inertia of K − λM at each cut says how many eigenvalues lie below it
    (Sylvester's law), so the number in each slice is known, and none can be missing. Each slice is solved by itself, up
    to `threads` at a time, by shifted block Lanczos (Grimes, Lewis and Simon 1994, SIAM J. Matrix Anal. Appl. 15,
    228-272). SolverError if a mode that is there is not found.
    """
    size = stiffness.shape[0]
    largest = size if size <= DENSE_VERTICES_MANY_MODES else size // 2
    if not 1 <= count <= largest:
        raise SolverError("impossible number of modes", found=count, expected=f"1 to {largest} for {size} vertices")
    if size <= DENSE_VERTICES or (size <= DENSE_VERTICES_MANY_MODES and count > size // 3):
        values, functions = linalg.eigh(stiffness.toarray(), mass.toarray(), subset_by_index=(0, count - 1))
        return Modes(values, functions)

    with ThreadPoolExecutor(threads) as pool:
        cuts, below = _cuts(stiffness, mass, count, pool)
        values, functions = np.empty(below[-1]), np.empty((size, below[-1]), order="F")

        def solve(number: int) -> None:
            inside = slice(below[number], below[number + 1])
            low, high = cuts[number : number + 2]
            values[inside] = _modes_between(stiffness, mass, low, high, functions[:, inside])

        list(pool.map(solve, range(len(below) - 1)))
    return Modes(values[:count], functions[:, :count])


def count_below(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, value: float) -> int:
    """Returns the number of eigenvalues below `value` (mm⁻²), from the inertia of K − value·M."""
    return _factorise(stiffness, mass, value)[1]


def _factorise(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, shift: float) -> tuple[SuperLU, int]:
    """Returns the factors of K − shift·M and the number of its negative eigenvalues.

    With pivots on the diagonal, P(K − shift·M)Pᵀ = L U with U = D Lᵀ, so D has the signs of the eigenvalues.
    """
    factors = splu(
        sparse.csc_matrix(stiffness - shift * mass),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    if not np.array_equal(factors.perm_r, factors.perm_c):
        raise SolverError("no inertia: a pivot off the diagonal was taken", found=f"shift {shift:g} mm⁻²")
    return factors, int(np.count_nonzero(factors.U.diagonal() < 0))


def _cuts(
    stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, count: int, pool: ThreadPoolExecutor
) -> tuple[list[float], list[int]]:
    """Returns where the spectrum is cut, and the numbers of eigenvalues below; `count` or more below the last."""
    spacing = 4.0 * np.pi / mass.sum()  # mean distance between eigenvalues by Weyl's law
    wanted, top = count + 2, (count + 6) * spacing
    while (most := count_below(stiffness, mass, top)) < count:
        top *= 1.01 * wanted / max(most, wanted // 4)
    slices = max(1, round(most / MODES_PER_SLICE))
    cuts = [-spacing, *(top * np.arange(1, slices) / slices)]
    return [*cuts, top], [0, *pool.map(lambda cut: count_below(stiffness, mass, cut), cuts[1:]), most]


def _modes_between(
    stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, low: float, high: float, functions: Floats
) -> Floats:
    """Returns the eigenvalues between `low` and `high`, ascending; their functions fill the columns of `functions`.

    Lanczos' method on (K − σM)⁻¹M from the middle σ, without restarts, with all of the basis kept M-orthonormal.
    """
    size, number = functions.shape
    if number == 0:
        return np.empty(0)
    shift = 0.5 * (low + high)
    factors, _ = _factorise(stiffness, mass, shift)
    mass = mass.tocsr()
    margin = np.sqrt(number * BLOCK)  # the basis grows to about `number` and 9 times this
    limit = min(int(3 * number + 30 * margin), size - BLOCK) // BLOCK * BLOCK
    basis = np.empty((size, limit + BLOCK), order="F")
    projected = np.zeros((limit, limit))
    start = np.random.default_rng(0).standard_normal((BLOCK, size)).T
    basis[:, :BLOCK], _ = _orthonormal(mass, start)
    check = number + 7 * margin
    found: Ints = np.empty(0, dtype=np.int64)
    for end in range(BLOCK, limit + 1, BLOCK):
        begin = end - BLOCK
        block = factors.solve(np.asfortranarray(mass @ basis[:, begin:end]))
        # by theory only the last two blocks have a share in it; the others' is what rounding lets back in
        for first in (max(0, begin - BLOCK), 0):
            known = basis[:, first:end]
            shares = known.T @ (mass @ block)
            block -= (shares.T @ known.T).T  # known @ shares as BLAS likes it, twice as fast
            projected[first:end, begin:end] += shares
        block, rest = _orthonormal(mass, block)
        basis[:, end : end + BLOCK] = block
        if end < check:
            continue
        check = end + number // 20
        inverses, mixes = np.linalg.eigh(projected[:end, :end], UPLO="U")  # SciPy's would hold up the other threads
        values = shift + 1.0 / inverses
        error = np.linalg.norm(rest @ mixes[begin:end], axis=0)
        found = np.flatnonzero((values > low) & (values < high) & (error <= TOLERANCE * np.abs(inverses)))
        if len(found) >= number:
            break
    if len(found) != number:
        raise SolverError(
            f"the number of modes is wrong between λ = {low:g} and {high:g} mm⁻²",
            found=len(found),
            expected=number,
            remedy="Remesh the surface: slivers make its spectrum inexact",
        )
    found = found[np.argsort(values[found])]
    np.matmul(basis[:, :end], mixes[:, found], out=functions)
    return values[found]


def _orthonormal(mass: sparse.csr_matrix, block: Floats) -> tuple[Floats, Floats]:
    """Returns Q and R with QR = block and QᵀMQ = 1; by Cholesky, twice, as once is inexact for nearly equal columns."""
    total = np.eye(block.shape[1])
    for _ in range(2):
        gram = block.T @ (mass @ block)
        triangle = linalg.cholesky(gram)
        block = blas.dtrsm(1.0, triangle, block, side=1)
        total = triangle @ total
    return block, total
