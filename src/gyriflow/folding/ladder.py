"""The linear systems of Newton's method: conjugate gradients with multigrid, and what follows where they fail.

The preconditioner is kept across iterations and steps and rebuilt when it has gone stale. A ladder of further means
follows; the rung used is reported.
"""

from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from ..errors import SolverError
from .krylov import PreconditionerLifetime, estimate_bounds, keep_bounds, new_krylov, renew_bounds, smooth_with
from .problem import Problem
from .tangent import Tangent

RUNGS = ("cg", "cg, preconditioner rebuilt", "cg, tangent shifted", "gmres")
KEPT, REBUILT, SHIFTED, GMRES = range(4)
INDEFINITE = (PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_MAT, PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_PC)
SHIFTS = (0.0, 1e-4, 1e-3, 1e-2, 0.1, 1.0)
"""Parts of its diagonal that are added to a tangent until it is positive definite."""
KEPT_SHIFT = 1e-4
"""The part added for the multigrid of a free body, well below the softest bending. Without it the coarsest matrix would
be singular. The multigrid is kept for later shapes, whose rigid motions are others: it would blow them up."""


class NotConvergedError(SolverError):
    """The step was not solved; a smaller one may be."""


@dataclass
class LinearCount:
    """What a linear solve took, and whether the tangent was positive definite as it was."""

    iterations: int = 0
    rung: int = KEPT
    convex: bool = True


class LinearLadder:
    """Finds descent directions from one tangent after the other, with solvers made once.

    What it keeps from one solve to the next decides how a direction is found. A solver has failed after
    `max_iterations`.
    """

    def __init__(self, problem: Problem, max_iterations: int) -> None:
        self.problem = problem
        self.max_iterations = max_iterations
        self._cg = self._new_krylov("cg")
        self._gmres: PETSc.KSP | None = None
        self.lifetime = PreconditionerLifetime()
        self._doubtful = False  # whether the preconditioner was made of an indefinite tangent
        self._level = 0  # of the shift that the last tangent needed

    def _new_krylov(self, method: str) -> PETSc.KSP:
        return new_krylov(self.problem.domain.comm, method, self.max_iterations, self.problem.hierarchy)

    def renew_cg(self) -> None:
        """Makes conjugate gradients anew: set up again, PETSc 3.25's would keep some of the old smoother."""
        self._cg.destroy()
        self._cg = self._new_krylov("cg")

    def solve(
        self, tangent: Tangent, residual: PETSc.Vec, direction: PETSc.Vec, reduction: float, *, convexify: bool
    ) -> LinearCount:
        """Leaves in `direction` a solution of J d = −r that descends; goes down the ladder until there is one.

        `reduction` is the part of the right-hand side that may be left. Where conjugate gradients fail with the true
        tangent, its further parts may be made convex if `convexify`. NotConvergedError where the last rung fails too.
        """
        system = _System(self.problem, tangent, residual, direction, reduction)
        count = LinearCount()
        if not self.problem.convex:
            if self._solve_with_kept(system, count):
                return count
            # parts that are pressed together tend to slide aside, which makes the tangent indefinite; made convex, it
            # rarely is, but it is no longer exact
            if convexify:
                self.problem.convexify(tangent)
        if self._solve_shifted(system, count):
            return count
        count.convex = False
        self._fall_back(system, count)
        return count

    def _solve_with_kept(self, system: "_System", count: LinearCount) -> bool:
        if self.lifetime.over:
            return False
        reason, iterations = system.run(self._cg, reuse=True, fast=True)
        count.iterations += iterations
        if reason > 0 and system.slope < 0:
            self._served(iterations, system.reduction, definite=True)
            return True
        if reason <= 0 and reason != INDEFINITE[0]:
            self.lifetime.end()
        return False

    def _solve_shifted(self, system: "_System", count: LinearCount) -> bool:
        # where the tangent was not positive definite before, it may still not be
        for level in range(max(self._level - 1, 0), len(SHIFTS)):
            with system.tangent.raised(SHIFTS[level]):
                reason = self._run_cg(system, count, shifted=level > 0)
            count.rung = max(count.rung, SHIFTED if level else KEPT)
            if reason > 0 or reason not in INDEFINITE:
                self._level = level
                break
        count.convex = level == 0
        return reason > 0 and system.slope < 0

    def _run_cg(self, system: "_System", count: LinearCount, *, shifted: bool) -> int:
        if not self.lifetime.over:
            reason, iterations = system.run(self._cg, reuse=True, fast=not shifted)
            count.iterations += iterations
            # a matrix that is not positive definite is no fault of the preconditioner
            if reason == INDEFINITE[0]:
                return reason
            if reason > 0:
                self._served(iterations, system.reduction, definite=not shifted)
                return reason
            count.rung = max(count.rung, REBUILT)
        with system.tangent.raised(KEPT_SHIFT if self.problem.free and not shifted else 0.0):
            system.tangent.whole().setNearNullSpace(self.problem.near_null_space())
            self.renew_cg()
            reason, iterations = system.run(self._cg, reuse=False, fast=not shifted)
        count.iterations += iterations
        self.lifetime.renew()
        self._doubtful = reason == INDEFINITE[0]
        if reason > 0:
            self.lifetime.add(iterations, system.reduction)
        elif not self._doubtful:
            self.lifetime.end()
        return reason

    def _served(self, iterations: int, reduction: float, *, definite: bool) -> None:
        self.lifetime.add(iterations, reduction)
        # one made of an indefinite tangent serves its shifts, and then gives way to a better one
        if self._doubtful and definite:
            self.lifetime.end()

    def _fall_back(self, system: "_System", count: LinearCount) -> None:
        if self._gmres is None:
            self._gmres = self._new_krylov("gmres")
        reason, iterations = system.run(self._gmres, reuse=False)
        count.iterations += iterations
        count.rung = GMRES
        slope = system.slope
        if reason <= 0 or slope == 0:
            raise NotConvergedError("no linear solver found a descent direction")
        if slope > 0:  # the way to a saddle: the energy falls in the other direction
            system.direction.scale(-1.0)


@dataclass(frozen=True, eq=False)
class _System:
    """One linear system J d = −r, to be solved up to a part of its right-hand side."""

    problem: Problem
    tangent: Tangent
    residual: PETSc.Vec
    direction: PETSc.Vec
    reduction: float

    @property
    def slope(self) -> float:
        """The energy's slope along the direction."""
        return self.direction.dot(self.residual)

    def run(self, krylov: PETSc.KSP, *, reuse: bool, fast: bool = False) -> tuple[int, int]:
        """Solves into the direction; returns PETSc's reason for the end, 0 for one without, and the iterations.

        `fast` takes the forms of the tangent that are made for products and smoothing.
        """
        tangent = self.tangent
        krylov.setTolerances(rtol=self.reduction)
        matrix = tangent.smoothing if fast and reuse else tangent.whole()
        krylov.setOperators(self.problem.operator(tangent.products if fast else matrix), matrix)
        multigrid = krylov.getPC()
        multigrid.setReusePreconditioner(reuse)
        if not reuse and self.problem.hierarchy is not None and multigrid.getType() == "mg":
            # a copy, as with contact, has none of its own
            matrix.setNearNullSpace(self.problem.near_null_space())
            self.problem.hierarchy.renew(multigrid, matrix)
        try:
            if krylov.getType() == "cg":
                krylov.setUp()
                if fast:
                    smooth_with(krylov, tangent.products, tangent.smoothing)
                if not (fast and reuse):
                    estimate_bounds(krylov)
            krylov.solve(self.residual, self.direction)
            iterations = krylov.getIterationNumber()
            if fast and reuse and krylov.getConvergedReason() == INDEFINITE[1]:
                # elements drawn out since have taken the smoother beyond the bounds that it kept
                renew_bounds(krylov, self.residual)
                krylov.solve(self.residual, self.direction)
                iterations += krylov.getIterationNumber()
            if fast:
                keep_bounds(krylov)
        except PETSc.Error:  # a factorisation of the coarsest level that broke down
            return 0, 0
        self.direction.scale(-1.0)
        self.problem.apply_boundary_conditions(self.direction)
        finite = bool(np.isfinite(self.direction.norm()))
        return krylov.getConvergedReason() if finite else 0, iterations
