"""PETSc's linear solvers as the folding wants them, and when a kept preconditioner has served its time."""

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

SETUP = 70.0
"""What a new preconditioner costs, in iterations."""
YARDSTICK = 5
"""Solves with a new preconditioner, about a step's, that tell what it can do."""


class Wear:
    """The wear of a preconditioner that is kept while the matrix changes.

    It is stale once its solves have taken as many iterations too many as a new one costs. The first solves with it,
    easy and hard ones, are the yardstick.
    """

    def __init__(self) -> None:
        self._solves, self._iterations, self._powers = 0, 0, 0.0
        self._excess = np.inf

    @property
    def stale(self) -> bool:
        """Whether a new preconditioner is due."""
        return self._excess >= SETUP

    def add(self, iterations: int, reduction: float) -> None:
        """Takes note of a solve that brought the residual down to a part of what it was."""
        powers = -np.log10(reduction)
        if self._solves < YARDSTICK:
            self._solves += 1
            self._iterations += iterations
            self._powers += powers
        else:
            self._excess = max(self._excess + iterations - powers * self._iterations / self._powers, 0.0)

    def renew(self) -> None:
        """Takes note of a new preconditioner."""
        self._solves, self._iterations, self._powers = 0, 0, 0.0
        self._excess = 0.0

    def wear_out(self) -> None:
        """Declares the preconditioner stale."""
        self._excess = np.inf


def new_krylov(comm: MPI.Comm, method: str, preconditioner: str, max_iterations: int) -> PETSc.KSP:
    """Returns a linear solver; options in PETSc's database go by the prefix `gyriflow_<method>_`."""
    krylov = PETSc.KSP().create(comm)
    prefix = f"gyriflow_{method}_"
    options = PETSc.Options(prefix)
    if preconditioner == "gamg":
        options["pc_gamg_threshold"] = 0.01
        # else a rebuilt preconditioner would keep the coarse spaces of the first shape
        options["pc_gamg_reuse_interpolation"] = False
        options["pc_gamg_aggressive_coarsening"] = 1
        options["mg_levels_ksp_type"] = "chebyshev"
        options["mg_levels_ksp_max_it"] = 2
        options["mg_levels_pc_type"] = "pbjacobi"
    krylov.setOptionsPrefix(prefix)
    krylov.setType(method)
    krylov.getPC().setType(preconditioner)
    if method == "cg":
        # the norm that Newton's method is judged by
        krylov.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    if preconditioner == "lu":
        krylov.getPC().setFactorSolverType("mumps")
    krylov.setTolerances(atol=0.0, max_it=max_iterations)
    krylov.setFromOptions()
    return krylov


def smooth_with(krylov: PETSc.KSP, products: PETSc.Mat, smoothing: PETSc.Mat) -> None:
    """Gives the smoothers of a multigrid that is set up matrices stored by blocks, which are read in less time.

    Parameters
    ----------
    krylov
        The solver, preconditioned by multigrid.
    products
        What the finest level is multiplied by.
    smoothing
        What the finest level's Jacobi smoother is made from.
    """
    multigrid = krylov.getPC()
    finest = multigrid.getMGLevels() - 1
    multigrid.getMGSmoother(finest).setOperators(products, smoothing)
    for level in range(1, finest):
        smoother = multigrid.getMGSmoother(level)
        operator, matrix = smoother.getOperators()
        if operator.handle == matrix.handle:  # not yet done
            smoother.setOperators(matrix.convert("baij", out=PETSc.Mat()), matrix)
