"""Newton's method for the displacement of one step, with conjugate gradients and algebraic multigrid.

The preconditioner is kept across iterations and steps and rebuilt when it has gone stale. A ladder of further means
follows when conjugate gradients fail; the rung used is reported.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ..errors import SolverError
from .krylov import Wear, new_krylov, smooth_with
from .problem import Problem
from .tangent import Tangent

RUNGS = ("cg", "cg, preconditioner rebuilt", "cg, tangent shifted", "gmres", "mumps")
KEPT, REBUILT, SHIFTED, GMRES, DIRECT = range(5)
ROUND_OFF = 1e-12
"""Relative error of an energy, a sum over elements."""
UNRESOLVED = 1e-6
"""Relative change of an energy that strains of a ten-thousandth leave uncertain."""
NEAR = 100.0
"""Multiple of the tolerance below which the tangent of the iteration before is as good as a new one."""
SLOW = 1e3
"""Multiple of the tolerance below which an iteration that gains less than half calls for the true tangent."""
LOOSE = 0.03
"""Relative tolerance of a linear solve that need not be good."""
INDEFINITE = (PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_MAT, PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_PC)
SHIFTS = (0.0, 1e-4, 1e-3, 1e-2, 0.1, 1.0)
"""Parts of its diagonal that are added to a tangent until it is positive definite."""
FREE_SHIFT = 1e-6
"""The same for the factorisation of a free body's tangent, which is singular."""
FALLBACKS = {GMRES: ("gmres", "gamg"), DIRECT: ("preonly", "lu")}


@dataclass(frozen=True)
class NewtonSettings:
    """Tolerances and limits of the iteration.

    `newton_tolerance` is relative to the residual at u = 0, `krylov_tolerance` to the linear right-hand side. Where one
    linear solve can end the step, it is solved as far as that takes, down to a tenth of `krylov_tolerance`.
    """

    newton_tolerance: float = 1e-6
    krylov_tolerance: float = 1e-3
    max_newton: int = 20
    max_krylov: int = 300
    max_backtracks: int = 8


@dataclass
class StepCount:
    """What a step took."""

    newton: int = 0
    krylov: int = 0
    rung: int = KEPT
    residual: float = np.inf


class NotConvergedError(SolverError):
    """The step was not solved; a smaller one may be."""


class NewtonSolver:
    """Solves for the displacement of one step after the other with objects made once.

    What it keeps from one step to the next decides how a solution is found, and changes it within the tolerance only.

    Parameters
    ----------
    problem
        Energy, residual and tangent.
    settings
        Tolerances and limits.
    residual_floor
        Residual in N below which a step counts as solved whatever its start.

    Attributes
    ----------
    inverting : (c,) float or None
        det F of the local elements at the last trial of the present step that turned one inside out.
    """

    def __init__(self, problem: Problem, settings: NewtonSettings, residual_floor: float) -> None:
        self.problem = problem
        self.settings = settings
        self.residual_floor = residual_floor
        self._residual = problem.new_vector()
        self._trial = problem.new_vector()
        self._direction = problem.new_vector()
        self._wear = Wear()
        self._doubtful = False  # whether the preconditioner was made of an indefinite tangent
        self._wanted_reduction = settings.krylov_tolerance
        self._cg = self._new_krylov("cg", "gamg")
        self._fallbacks: dict[int, PETSc.KSP] = {}
        self._level = 0  # of the shift that the last tangent needed
        self._convex = True  # whether the last tangent was positive definite as it was
        self._slow = False  # whether the last iteration has gained little, close to the solution
        self._energy: float | None = None  # at the present iterate, where it is known
        self._first_left = 0.0  # part of the residual that the first iteration of the step before left
        self._exhausted = False  # whether nothing is left to gain but round-off
        self.inverting: NDArray[np.float64] | None = None

    def _new_krylov(self, method: str, preconditioner: str) -> PETSc.KSP:
        return new_krylov(self.problem.domain.comm, method, preconditioner, self.settings.max_krylov)

    def _run(self, krylov: PETSc.KSP, tangent: Tangent, *, reuse: bool, fast: bool = False) -> tuple[int, int]:
        """Solves into the direction; returns PETSc's reason for the end, 0 for one without, and the iterations.

        `fast` takes the forms of the tangent that are made for products and smoothing.
        """
        krylov.setTolerances(rtol=self._wanted_reduction)
        matrix = tangent.smoothing if fast and reuse else tangent.whole()
        krylov.setOperators(self.problem.operator(tangent.products if fast else matrix), matrix)
        multigrid = krylov.getPC()
        multigrid.setReusePreconditioner(reuse)
        try:
            if fast:
                krylov.setUp()
                smooth_with(krylov, tangent.products, tangent.smoothing)
            krylov.solve(self._residual, self._direction)
        except PETSc.Error:  # a factorisation that broke down
            return 0, 0
        self._direction.scale(-1.0)
        self.problem.hold(self._direction)
        finite = bool(np.isfinite(self._direction.norm()))
        return krylov.getConvergedReason() if finite else 0, krylov.getIterationNumber()

    def _run_cg(self, tangent: Tangent, count: StepCount, *, shifted: bool) -> int:
        """Solves by conjugate gradients, with the kept preconditioner and then a new one; returns PETSc's reason."""
        if not self._wear.stale:
            reason, iterations = self._run(self._cg, tangent, reuse=True, fast=not shifted)
            count.krylov += iterations
            # a matrix that is not positive definite is no fault of the preconditioner
            if reason == INDEFINITE[0]:
                return reason
            if reason > 0:
                self._served(iterations, definite=not shifted)
                return reason
            count.rung = max(count.rung, REBUILT)
        tangent.whole().setNearNullSpace(self.problem.near_null_space())
        reason, iterations = self._run(self._cg, tangent, reuse=False, fast=not shifted)
        count.krylov += iterations
        self._wear.renew()
        self._doubtful = reason == INDEFINITE[0]
        if reason > 0:
            self._wear.add(iterations, self._wanted_reduction)
        elif not self._doubtful:
            self._wear.wear_out()
        return reason

    def _served(self, iterations: int, *, definite: bool) -> None:
        """Takes note of a solve with the kept preconditioner."""
        self._wear.add(iterations, self._wanted_reduction)
        # one made of an indefinite tangent serves its shifts, and then gives way to a better one
        if self._doubtful and definite:
            self._wear.wear_out()

    def _solve_linear(self, tangent: Tangent, count: StepCount) -> None:
        """Leaves in the direction the solution of J d = −r; goes down the ladder until it is a descent direction."""
        if self.problem.contributions:
            if not self._wear.stale:
                reason, iterations = self._run(self._cg, tangent, reuse=True, fast=True)
                count.krylov += iterations
                if reason > 0 and self._direction.dot(self._residual) < 0:
                    self._convex = True
                    self._served(iterations, definite=True)
                    return
                if reason <= 0 and reason != INDEFINITE[0]:
                    self._wear.wear_out()
            # folds pressed together would rather slide aside: without that the tangent is rarely indefinite, but wrong
            if not self._slow:
                self.problem.convexify(tangent)
        # where the tangent was not positive definite before, it may still not be
        for level in range(max(self._level - 1, 0), len(SHIFTS)):
            with tangent.raised(SHIFTS[level]):
                reason = self._run_cg(tangent, count, shifted=level > 0)
            count.rung = max(count.rung, SHIFTED if level else KEPT)
            if reason > 0 or reason not in INDEFINITE:
                self._level = level
                break
        self._convex = level == 0
        if reason > 0 and self._direction.dot(self._residual) < 0:
            return
        self._convex = False
        for rung, method in FALLBACKS.items():
            # the operator of a free body is not its matrix, which is singular
            singular = rung == DIRECT and self.problem.free
            if rung not in self._fallbacks:
                self._fallbacks[rung] = self._new_krylov("gmres" if singular else method[0], method[1])
            with tangent.raised(FREE_SHIFT if singular else 0.0):
                reason, iterations = self._run(self._fallbacks[rung], tangent, reuse=False)
            count.krylov += iterations
            count.rung = max(count.rung, rung)
            slope = self._direction.dot(self._residual)
            if reason > 0 and slope != 0:
                if slope > 0:  # the way to a saddle: the energy falls in the other direction
                    self._direction.scale(-1.0)
                return
        raise NotConvergedError("no linear solver found a descent direction")

    def _advance(self, norm: float) -> float:
        """Moves along the direction as far as energy and elements allow; returns the new residual norm."""
        problem, start = self.problem, self.problem.displacement.copy()
        slope = self._direction.dot(self._residual)
        before, convex = None, self._convex
        if problem.contributions:
            # what they add is not convex, so that the energy is asked where its sum can tell
            before = problem.energy() if self._energy is None else self._energy
            convex = convex and abs(slope) <= UNRESOLVED * abs(before)
        self._direction.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
        with self._direction.localForm() as local:
            direction = local.array_r.reshape(-1, 3).copy()
        length = problem.largest_step(direction)
        for _ in range(self.settings.max_backtracks):
            problem.set_displacement(start + length * direction)
            if problem.smallest_volume_ratio() > 0:
                trial = problem.residual(self._trial)
                # where a convex energy's slope has all but vanished, it fell by about half of it: no need to ask for it
                flat = abs(self._direction.dot(self._trial)) <= 0.1 * abs(slope)
                if convex and np.isfinite(trial) and trial < norm and flat:
                    return self._accept(trial)
                if before is None:
                    problem.set_displacement(start)
                    before = problem.energy()
                    problem.set_displacement(start + length * direction)
                energy = problem.energy()
                lower = np.isfinite(trial) and energy <= before + 1e-4 * length * slope
                # what is left to gain is below the energy's round-off: the residual decides
                if lower or (trial < norm and abs(energy - before) <= ROUND_OFF * abs(before)):
                    return self._accept(trial, energy)
            else:
                self.inverting = problem.volume_ratios()
            length /= 2
        problem.set_displacement(start)
        if before is not None and abs(slope) <= ROUND_OFF * abs(before):
            self._exhausted = True
            return norm
        raise NotConvergedError("the line search found no step that lowers the energy")

    def _accept(self, norm: float, energy: float | None = None) -> float:
        self._residual, self._trial = self._trial, self._residual
        self._energy = energy
        return norm

    def solve(self, start: NDArray[np.float64]) -> StepCount:
        """Solves for the displacement from a first guess of shape (k, 3) in m; it is left in the problem.

        Raises
        ------
        NotConvergedError
            Where the residual does not fall below the tolerance.
        """
        problem, count = self.problem, StepCount()
        start, self.inverting = problem.admissible(start), None
        problem.set_displacement(np.zeros_like(start))
        at_rest = problem.residual(self._residual)
        if not np.isfinite(at_rest):
            raise NotConvergedError("the forces without any displacement are not finite")
        tolerance = max(self.settings.newton_tolerance * at_rest, self.residual_floor)
        norm = at_rest
        if at_rest > tolerance:
            problem.set_displacement(problem.largest_step(start) * start)
            if problem.smallest_volume_ratio() > 0:
                norm = problem.residual(self._residual)
            if not norm < at_rest:  # also where it is not a number
                problem.set_displacement(np.zeros_like(start))
                norm = problem.residual(self._residual)
            tangent, before, self._energy, self._exhausted = None, np.inf, None, False
        while not (norm <= tolerance or self._exhausted):
            if count.newton >= self.settings.max_newton:
                raise NotConvergedError(
                    "Newton's method did not converge",
                    found=f"residual {norm:.2e} N after {count.newton} iterations",
                    expected=f"at most {tolerance:.2e} N",
                )
            count.newton += 1
            enough = 0.4 * tolerance / norm
            floor = self.settings.krylov_tolerance
            if problem.contributions:
                # while contact changes from one iterate to the next, a direction need not be better than the last was
                left = norm / before if np.isfinite(before) else self._first_left
                floor = max(floor, min(LOOSE, left**2))
            self._wanted_reduction = enough if enough >= 0.1 * floor else floor
            if tangent is None or norm > NEAR * tolerance or norm > before / 4:
                tangent = problem.tangent()
            self._slow = before / 2 < norm <= SLOW * tolerance
            before = norm
            self._solve_linear(tangent, count)
            norm = self._advance(norm)
            if count.newton == 1:
                self._first_left = norm / before
        count.residual = norm / at_rest if at_rest > 0 else 0.0
        return count
