"""PETSc's linear solvers as the folding wants them, and when a kept preconditioner has served its time."""

import ctypes
from collections.abc import Iterable

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from .multigrid import OrderHierarchy

# PETSc itself, through the library that is linked with it
_PETSC = ctypes.CDLL(PETSc.__file__)

SETUP = 70.0
"""What a new preconditioner costs, in iterations."""
YARDSTICK = 5
"""Solves with a new preconditioner, about a step's, that tell what it can do."""


class PreconditionerLifetime:
    """How long a preconditioner serves that is kept while the matrix changes.

    It is over once its solves have taken as many iterations too many as a new one costs. The first solves with it,
    easy and hard ones, are the yardstick.
    """

    def __init__(self) -> None:
        self._solves, self._iterations, self._powers = 0, 0, 0.0
        self._excess = np.inf

    @property
    def over(self) -> bool:
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

    def end(self) -> None:
        """Ends it."""
        self._excess = np.inf


BOUND_STEPS = 30
"""Steps that a smoother's largest eigenvalue is estimated in. A drawn-out element has one apart from all others: ten
steps, PETSc's default, miss it by more than Chebyshev's polynomials allow, and multigrid is no longer positive."""
ALGEBRAIC = {
    "pc_gamg_threshold": 0.01,
    # else a rebuilt preconditioner would keep the coarse spaces of the first shape
    "pc_gamg_reuse_interpolation": False,
    "pc_gamg_aggressive_coarsening": 1,
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 2,
    "mg_levels_ksp_chebyshev_esteig_steps": BOUND_STEPS,
    "mg_levels_pc_type": "pbjacobi",
}
"""Options of algebraic multigrid."""
BY_ORDER = {
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 1,
    "mg_levels_ksp_chebyshev_esteig_steps": BOUND_STEPS,
    "mg_levels_pc_type": "pbjacobi",
    "mg_coarse_ksp_type": "preonly",
    "mg_coarse_pc_type": "gamg",
} | {f"mg_coarse_{name}": value for name, value in ALGEBRAIC.items()}
"""Options of multigrid from quadratic to linear elements, which are left to algebraic multigrid."""


def new_krylov(comm: MPI.Comm, method: str, max_iterations: int, hierarchy: OrderHierarchy | None = None) -> PETSc.KSP:
    """Returns a linear solver; options in PETSc's database go by the prefix `gyriflow_<method>_`.

    The preconditioner is multigrid: by order first where there is a hierarchy, algebraic below.
    """
    krylov = PETSc.KSP().create(comm)
    prefix = f"gyriflow_{method}_"
    options = PETSc.Options(prefix)
    for name, value in (ALGEBRAIC if hierarchy is None else BY_ORDER).items():
        options[name] = value
    krylov.setOptionsPrefix(prefix)
    krylov.setType(method)
    if hierarchy is None:
        krylov.getPC().setType("gamg")
    else:
        hierarchy.attach(krylov.getPC())
    if method == "cg":
        # the norm that Newton's method is judged by
        krylov.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    krylov.setTolerances(atol=0.0, max_it=max_iterations)
    krylov.setFromOptions()
    return krylov


def smooth_with(krylov: PETSc.KSP, products: PETSc.Mat, smoothing: PETSc.Mat) -> None:
    """Gives the smoothers of a multigrid that is set up matrices stored by blocks, which are read in less time.

    On the finest level `products` is what is multiplied by, and `smoothing` what Jacobi's smoother is made from.
    """
    multigrid = krylov.getPC()
    _finest(krylov).setOperators(products, smoothing)
    _store_by_blocks(multigrid, range(1, multigrid.getMGLevels() - 1))
    below = multigrid.getMGCoarseSolve().getPC()
    if below.getType() == "gamg":
        _store_by_blocks(below, range(1, below.getMGLevels()))


BAND = 0.1, 1.1
"""Bounds of what Chebyshev's smoother takes on, in largest eigenvalues as they are estimated: PETSc's defaults."""


def estimate_bounds(krylov: PETSc.KSP) -> None:
    """Has the finest level's smoother estimate its eigenvalue bounds at its next solve, as PETSc does by default."""
    real = ctypes.c_double
    _PETSC.KSPChebyshevEstEigSet(_finest_smoother(krylov), real(0.0), real(BAND[0]), real(0.0), real(BAND[1]))


def keep_bounds(krylov: PETSc.KSP) -> None:
    """Has the smoother of the finest level keep the bounds that it has estimated in the last solve.

    PETSc would estimate them anew for each matrix, in many products. They hold as long as the preconditioner does: what
    deformation changes is within the tenth that is added, and terms of contact have no eigenvalue above 1 (see
    `tangent.Tangent.smoothing`).
    """
    smoother = _finest_smoother(krylov)
    address = ctypes.c_void_p()
    _PETSC.KSPChebyshevEstEigGetKSP(smoother, ctypes.byref(address))
    if not address.value:  # kept already
        return
    largest, least = ctypes.c_double(), ctypes.c_double()
    code = _PETSC.KSPComputeExtremeSingularValues(address, ctypes.byref(largest), ctypes.byref(least))
    if code == 0 and np.isfinite(largest.value) and largest.value > 0:
        low, high = (part * largest.value for part in BAND)
        _PETSC.KSPChebyshevSetEigenvalues(smoother, ctypes.c_double(high), ctypes.c_double(low))


def renew_bounds(krylov: PETSc.KSP, residual: PETSc.Vec) -> None:
    """Has the smoother of the finest level keep bounds that are estimated now, with a residual for the first cycle."""
    estimate_bounds(krylov)
    smoother = _finest(krylov)
    smoother.setOperators(*smoother.getOperators())  # so that it is set up again
    corrected = residual.duplicate()
    krylov.getPC().apply(residual, corrected)  # PETSc estimates on the way, but goes by what it was told to keep
    corrected.destroy()
    keep_bounds(krylov)


def _finest(krylov: PETSc.KSP) -> PETSc.KSP:
    multigrid = krylov.getPC()
    return multigrid.getMGSmoother(multigrid.getMGLevels() - 1)


def _finest_smoother(krylov: PETSc.KSP) -> ctypes.c_void_p:
    return ctypes.c_void_p(_finest(krylov).handle)


def _store_by_blocks(multigrid: PETSc.PC, levels: Iterable[int]) -> None:
    for level in levels:
        smoother = multigrid.getMGSmoother(level)
        operator, matrix = smoother.getOperators()
        if operator.handle == matrix.handle:  # not yet done
            matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)  # as the finest one is; PETSc may not know it
            smoother.setOperators(matrix.convert("sbaij", out=PETSc.Mat()), matrix)
