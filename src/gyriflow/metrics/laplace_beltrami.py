"""Modes of the Laplace-Beltrami operator of a triangle surface, K φ = λ M φ, with a count that none is missing."""

from dataclasses import dataclass

import igl
import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from ..errors import MeshError, SolverError
from ..geometry.diffusion import stiffness_matrix
from ..geometry.triangles import Floats, TriangleMesh, vertex_areas
from ..settings.terms import MassMatrix

TOLERANCE = 1e-11
"""Of the residual of a mode, relative to its eigenvalue."""
MODES_PER_SLICE = 100
"""Eigenvalues that SLEPc looks for round each shift; from 60 to 200 it matters little."""
SLIVERS = "Remesh the surface: slivers make its spectrum inexact."
DENSE_VERTICES = 1000
"""Up to this size LAPACK solves the problem as a whole."""


@dataclass(frozen=True, eq=False)
class Modes:
    """The lowest modes of a surface: (k,) ascending eigenvalues λ in mm⁻², the first 0, and (n, k) functions in mm⁻¹.

    The functions, as columns, are M-orthonormal: φᵢᵀ M φⱼ = δᵢⱼ.
    """

    eigenvalues: Floats
    functions: Floats


def laplacian(mesh: TriangleMesh, mass: MassMatrix = "mean") -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
    """Return the (n, n) stiffness K (no unit) and mass M (mm²) of linear finite elements.

    With the consistent mass matrix eigenvalues are too large by about (kh)²/12, for waves of number k on edges h; with
    the lumped one too small by as much. Their `mean` cancels this (Ainsworth and Wajid 2010, SIAM J. Numer. Anal. 48,
    346-371). `consistent` is as in LaPy. The boundary of an open surface is free (Neumann). MeshError where a vertex
    has no face.
    """
    unused = len(mesh.vertices) - len(np.unique(mesh.faces))
    if unused:
        raise MeshError("vertices without a face have no Laplacian", found=unused, expected=0)
    stiffness = stiffness_matrix(mesh.vertices, mesh.faces)
    matrix = igl.massmatrix(mesh.vertices, mesh.faces, igl.MASSMATRIX_TYPE_FULL)
    if mass == "mean":
        matrix = 0.5 * (matrix + sparse.diags(vertex_areas(mesh)))
    return sparse.csc_matrix(stiffness), sparse.csc_matrix(matrix)


def first_eigenvalue(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix) -> float:
    """Return λ1, the lowest eigenvalue above 0, in mm⁻²; MeshError where the surface is not in one piece."""
    shift, size = -_spacing(mass), stiffness.shape[0]
    inverse = LinearOperator((size, size), _factorised(stiffness, mass, shift).solve, dtype=np.float64)
    start = np.random.default_rng(1).standard_normal(size)
    values = eigsh(stiffness, 2, mass, sigma=shift, OPinv=inverse, v0=start, return_eigenvectors=False)
    # the constant is the only mode at 0 of a connected surface; Weyl's spacing gives the scale
    if values.max() < -1e-6 * shift:
        raise MeshError("the surface is not in one piece", remedy="Remove all but its largest piece.")
    return float(values.max())


def lowest_modes(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, count: int) -> Modes:
    """Return the `count` lowest modes of K φ = λ M φ, by `modes_below` a limit that has at least as many below it.

    SolverError for a count that the surface does not have, and where a mode is missed.
    """
    size = stiffness.shape[0]
    largest = size if size <= DENSE_VERTICES else size // 2
    if not 1 <= count <= largest:
        raise SolverError("impossible number of modes", found=count, expected=f"1 to {largest} for {size} vertices")
    if size <= DENSE_VERTICES:
        return Modes(*linalg.eigh(stiffness.toarray(), mass.toarray(), subset_by_index=(0, count - 1)))
    needed, top = count + 2, (count + 6) * _spacing(mass)
    while (most := count_below(stiffness, mass, top)) < count:
        top *= 1.01 * needed / max(most, needed // 4)
    modes = modes_below(stiffness, mass, top, most)
    return Modes(modes.eigenvalues[:count], modes.functions[:, :count])


def modes_below(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, value: float, count: int | None = None) -> Modes:
    """Return all modes of K φ = λ M φ with λ below `value` (mm⁻²).

    SLEPc's spectrum slicing with shift-and-invert Krylov-Schur (Campos and Roman 2012, Numer. Algorithms 60, 279-295):
    the inertia of K − σM at each shift gives the number of eigenvalues between shifts, so that none can be missed.
    `count` is that of `count_below`, if known. SolverError where a mode is missed.
    """
    size = stiffness.shape[0]
    count = count_below(stiffness, mass, value) if count is None else count
    if size <= DENSE_VERTICES:
        return lowest_modes(stiffness, mass, count)
    # starts MPI, which must not happen before hemispheres are measured in processes of their own
    from petsc4py import PETSc
    from slepc4py import SLEPc

    operators = []
    for rows in (stiffness.tocsr(), mass.tocsr()):
        csr = rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data
        operators.append(PETSc.Mat().createAIJ(rows.shape, csr=csr, comm=PETSc.COMM_SELF))
        operators[-1].setOption(PETSc.Mat.Option.SYMMETRIC, True)
    solver = SLEPc.EPS().create(PETSc.COMM_SELF)
    try:
        solver.setOperators(*operators)
        solver.setProblemType(SLEPc.EPS.ProblemType.GHEP)
        solver.setWhichEigenpairs(SLEPc.EPS.Which.ALL)
        solver.setInterval(-_spacing(mass), value)
        solver.setTolerances(TOLERANCE)
        solver.setKrylovSchurDimensions(nev=min(MODES_PER_SLICE, size // 4))
        transform = solver.getST()
        transform.setType(SLEPc.ST.Type.SINVERT)
        factors = transform.getKSP()
        factors.setType(PETSc.KSP.Type.PREONLY)
        factors.getPC().setType(PETSc.PC.Type.CHOLESKY)
        factors.getPC().setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
        solver.solve()
        if (converged := solver.getConverged()) != count:
            raise SolverError("the number of modes is wrong", found=converged, expected=count, remedy=SLIVERS)
        vector, _ = operators[0].createVecs()
        values = np.array([solver.getEigenvalue(i).real for i in range(count)])
        functions, order = np.empty((size, count), order="F"), np.argsort(values)
        for column, i in enumerate(order):
            solver.getEigenvector(int(i), vector)
            functions[:, column] = vector.getArray()
        vector.destroy()
        return Modes(values[order], functions)
    except PETSc.Error as error:
        problem = f"the modes up to λ = {value:g} mm⁻² could not be found"
        raise SolverError(problem, found=f"SLEPc's error {error.ierr}", remedy=SLIVERS) from error
    finally:
        for thing in (solver, *operators):
            thing.destroy()


def _spacing(mass: sparse.csc_matrix) -> float:
    return float(4.0 * np.pi / mass.sum())


def _factorised(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, shift: float) -> SuperLU:
    return splu(
        sparse.csc_matrix(stiffness - shift * mass),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


def count_below(stiffness: sparse.csc_matrix, mass: sparse.csc_matrix, value: float) -> int:
    """Return the number of eigenvalues below `value` (mm⁻²), from the inertia of K − value·M.

    With pivots on the diagonal, P(K − value·M)Pᵀ = L U with U = D Lᵀ, so D has the signs of the eigenvalues.
    """
    factors = _factorised(stiffness, mass, value)
    if not np.array_equal(factors.perm_r, factors.perm_c):
        raise SolverError("no inertia: a pivot off the diagonal was taken", found=f"shift {value:g} mm⁻²")
    return int(np.count_nonzero(factors.U.diagonal() < 0))
