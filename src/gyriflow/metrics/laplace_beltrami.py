"""Modes of the Laplace-Beltrami operator of a triangle surface, K φ = λ M φ, with a count that none is missing."""

import logging
from dataclasses import dataclass

import numpy as np
from lapy import Solver, TriaMesh
from scipy import linalg, sparse
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from ..errors import MeshError, SolverError
from ..geometry.triangles import Floats, Ints, TriangleMesh

MODES_PER_SLICE = 80
"""Modes asked of ARPACK per shift. Between 40 and 160 the time differs by a fifth."""

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


def lowest_modes(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, count: int) -> Modes:
    """Returns the `count` lowest modes of K φ = λ M φ.

    ARPACK solves slices of the spectrum around shifts, several times faster than one call for all. Slices meet in
    gaps of the spectrum. There the inertia of K − λM says how many eigenvalues lie below (Sylvester's law); modes that
    a slice lacks, as happens where many are equal, are looked for beside those found. SolverError if one stays missing.
    """
    size = stiffness.shape[0]
    largest = size if size <= DENSE_VERTICES_MANY_MODES else size // 2
    if not 1 <= count <= largest:
        raise SolverError("impossible number of modes", found=count, expected=f"1 to {largest} for {size} vertices")
    if size <= DENSE_VERTICES or (size <= DENSE_VERTICES_MANY_MODES and count > size // 3):
        values, functions = linalg.eigh(stiffness.toarray(), mass.toarray(), subset_by_index=(0, count - 1))
        return Modes(values, functions)

    values, functions = np.empty(count), np.empty((size, count), order="F")
    spacing = 4.0 * np.pi / mass.sum()  # mean distance between eigenvalues by Weyl's law
    done, cut = 0, -spacing
    while done < count:
        wanted = min(MODES_PER_SLICE, 2 * (count - done) + 8)
        slice_values, slice_functions, end = _next_slice(stiffness, mass, done, cut, spacing, wanted)
        new = min(len(slice_values), count - done)
        values[done : done + new] = slice_values[:new]
        functions[:, done : done + new] = slice_functions[:, :new]
        if done:
            spacing = (end - cut) / len(slice_values)
        done, cut = done + new, end
    return Modes(values, functions)


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


def _next_slice(
    stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, done: int, cut: float, spacing: float, wanted: int
) -> tuple[Floats, Floats, float]:
    """Returns the eigenvalues above `cut`, below which `done` lie, up to a gap; their functions; the gap."""
    shift = cut + 0.5 * wanted * spacing
    factors, below = _factorise(stiffness, mass, shift)
    while below - done > wanted:  # the spectrum is denser than expected
        shift = cut + (shift - cut) * 0.5 * wanted / (below - done)
        factors, below = _factorise(stiffness, mass, shift)

    # the modes nearest to the shift: as many above it as there are between the cut and it, and a few more
    number = max(2 * (below - done), wanted) + 8
    values: Floats = np.empty(0)
    functions: Floats = np.empty((mass.shape[0], 0))
    gaps: Ints = np.empty(0, dtype=np.int64)
    while not len(gaps):  # mostly once; equal eigenvalues, as on a sphere, leave no gap among few
        values, functions = _nearest(stiffness, mass, factors, shift, number, values, functions)
        gaps = np.flatnonzero((values[:-1] > shift) & (np.diff(values) > 0.1 * spacing))
    end = 0.5 * (values[gaps[-1]] + values[gaps[-1] + 1])

    expected = count_below(stiffness, mass, end) - done
    for _ in range(4):
        inside = (values > cut) & (values < end)
        missing = expected - np.count_nonzero(inside)
        if missing == 0:
            return values[inside], functions[:, inside], end
        if missing < 0:
            break
        values, functions = _nearest(stiffness, mass, factors, shift, missing + 8, values, functions)
    raise SolverError(
        f"the number of modes is wrong between λ = {cut:g} and {end:g} mm⁻²",
        found=expected - missing,
        expected=expected,
        remedy="Remesh the surface: slivers make its spectrum inexact",
    )


def _nearest(
    stiffness: sparse.csc_matrix,
    mass: sparse.csc_matrix,
    factors: SuperLU,
    shift: float,
    number: int,
    values: Floats,
    functions: Floats,
) -> tuple[Floats, Floats]:
    """Returns the known modes and the `number` next ones nearest to the shift, by ascending eigenvalue."""
    weights = 1.0 / (values - shift)

    def solve_beside_known(right: Floats) -> Floats:
        return factors.solve(right) - functions @ (weights * (functions.T @ right))

    size = mass.shape[0]
    new_values, new_functions = eigsh(
        stiffness,
        k=number,
        M=mass,
        sigma=shift,
        OPinv=LinearOperator(mass.shape, matvec=solve_beside_known, dtype=float),
        ncv=int(1.7 * number) + 10,
        tol=1e-10,
        v0=np.random.default_rng(len(values)).standard_normal(size),
    )
    values, functions = np.concatenate([values, new_values]), np.hstack([functions, new_functions])
    order = np.argsort(values)
    return values[order], functions[:, order]
