"""Newton's method for the displacement of one step: linear solves, each guarded by a line search."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from .linear_solver import PLAIN, LinearSolver, NotConvergedError
from .problem import Problem
from .tangent import Tangent

ROUND_OFF = 1e-12
"""Relative error of an energy, a sum over elements."""
UNRESOLVED = 1e-6
"""Relative change of an energy that strains of a ten-thousandth leave uncertain."""
GAIN = 1e-6
"""Relative fall of the energy from which an iteration counts as progress, and not towards their limit."""
PATIENCE = 10
"""Most iterations, progress or not, over their limit."""
SLOW = 10.0
"""Multiple of the tolerance below which an iteration that gains less than half calls for the true tangent."""
LOOSE = 0.1
"""Relative tolerance of a linear solve that need not be good."""


@dataclass(frozen=True)
class NewtonSettings:
    """Tolerances and limits of the iteration.

    `newton_tolerance` is relative to the residual at u = 0, `krylov_tolerance` to the linear right-hand side: see
    `linear_tolerance`.
    """

    newton_tolerance: float = 1e-4
    krylov_tolerance: float = 1e-3
    max_newton: int = 20
    max_krylov: int = 1000
    max_backtracks: int = 8


@dataclass
class StepCount:
    """What a step took: iterations, the furthest rung of a linear solve, the residual relative to that at rest.

    It has `converged` where that is below the tolerance: not where nothing but round-off was left to gain.
    """

    newton: int = 0
    krylov: int = 0
    rung: int = PLAIN
    residual: float = np.inf
    converged: bool = False


@dataclass(frozen=True)
class Iterate:
    """Where the iteration stands; the displacement and its residual are with problem and solver.

    The norm of the residual in N, the energy in J where it is known, its relative fall that led here where that was
    asked for, and whether nothing is left to gain but round-off.
    """

    norm: float
    energy: float | None = None
    gain: float = 0.0
    exhausted: bool = False


def linear_tolerance(enough: float, left: float, least: float) -> float:
    """Return the part of the residual that a linear solve may leave (forcing terms as of Eisenstat and Walker 1996).

    `enough` ends the step, `left` is what the last iteration left of its residual (the next one leaves about the
    square, however well it is solved), and `least` the tolerance of solves in which the iteration converges fast.
    """
    if left**2 > LOOSE:
        return max(LOOSE, enough)
    good = max(least, left**2)
    # a little farther where that ends the step
    return enough if enough >= 0.1 * good else good


class NewtonSolver:
    """Solves for the displacement of one step after the other with objects made once.

    What it keeps from one step to the next decides how a solution is found, and changes it within the tolerance only.

    A residual below `residual_floor`, in N, counts as solved whatever the step's start. `inverting` is det F (c, p) of
    the local elements at the last trial of the present step that turned one inside out.
    """

    def __init__(self, problem: Problem, settings: NewtonSettings, residual_floor: float) -> None:
        self.problem = problem
        self.settings = settings
        self.residual_floor = residual_floor
        self.linear_solver = LinearSolver(problem, settings.max_krylov)
        self._residual = problem.new_vector()
        self._first_left = 0.0  # part of the residual that the first iteration of the step before left
        self._trial = problem.new_vector()
        self._direction = problem.new_vector()
        self.inverting: NDArray[np.float64] | None = None

    def solve(self, *guesses: NDArray[np.float64]) -> StepCount:
        """Solve for the displacement from the first good one of some guesses (k, 3) in m; it is left in the problem.

        NotConvergedError where the residual does not fall below the tolerance.
        """
        problem, count = self.problem, StepCount()
        self.inverting = None
        at_rest = self._residual_at(np.zeros_like(problem.displacement))
        if not np.isfinite(at_rest):
            raise NotConvergedError("the forces without any displacement are not finite")
        tolerance = max(self.settings.newton_tolerance * at_rest, self.residual_floor)
        iterate = Iterate(at_rest if at_rest <= tolerance else self._begin(guesses, at_rest))
        before, stalled = np.inf, 0
        while iterate.norm > tolerance and not iterate.exhausted:
            norm = iterate.norm
            # where folds snap or slide past each other, the energy falls far before the residual does
            if max(stalled, count.newton / PATIENCE) >= self.settings.max_newton:
                raise NotConvergedError(
                    "Newton's method did not converge",
                    found=f"residual {norm:.2e} N after {count.newton} iterations",
                    expected=f"at most {tolerance:.2e} N",
                )
            count.newton += 1
            slow = before / 2 < norm <= SLOW * tolerance
            left = norm / before if count.newton > 1 else max(norm / at_rest, self._first_left)
            reduction = linear_tolerance(0.4 * tolerance / norm, left, self.settings.krylov_tolerance)
            # one that is off by no more than the linear solve may leave is as good as a new one
            tangent = problem.tangent(within=0.0 if slow else reduction)
            try:
                iterate = self._iterate(iterate, tangent, reduction, count, convexify=not slow)
            except NotConvergedError:
                least = self.settings.krylov_tolerance
                if not problem.kept_tangent and reduction <= least:
                    raise
                iterate = self._iterate(iterate, problem.tangent(), min(reduction, least), count, convexify=not slow)
            stalled += iterate.gain < GAIN
            if count.newton == 1:
                self._first_left = iterate.norm / norm
            before = norm
        count.residual = iterate.norm / at_rest if at_rest > 0 else 0.0
        count.converged = iterate.norm <= tolerance
        return count

    def _iterate(
        self, iterate: Iterate, tangent: Tangent, reduction: float, count: StepCount, *, convexify: bool
    ) -> Iterate:
        linear = self.linear_solver.solve(tangent, self._residual, self._direction, reduction, convexify=convexify)
        count.krylov += linear.iterations
        count.rung = max(count.rung, linear.rung)
        return self._advance(iterate, convex=linear.convex)

    def _residual_at(self, displacement: NDArray[np.float64]) -> float:
        self.problem.set_displacement(displacement)
        return self.problem.residual(self._residual)

    def _begin(self, guesses: Sequence[NDArray[np.float64]], at_rest: float) -> float:
        """Goes to the first guess that leaves less than half of the residual at rest, or stays at rest.

        Returns the norm of the residual there.
        """
        problem = self.problem
        for guess in map(problem.admissible, guesses):
            problem.set_displacement(problem.largest_step(guess) * guess)
            if problem.smallest_volume_ratio() > 0:
                norm = problem.residual(self._residual)
                if norm < 0.5 * at_rest:  # false where it is not a number
                    return norm
        return self._residual_at(np.zeros_like(problem.displacement))

    def _advance(self, iterate: Iterate, *, convex: bool) -> Iterate:
        """Move along the direction as far as energy and elements allow; return where that leads.

        `convex` says that the tangent was positive definite as it was.
        """
        problem, start, norm = self.problem, self.problem.displacement.copy(), iterate.norm
        slope = self._direction.dot(self._residual)
        before = None
        if not problem.convex:
            # so that the energy is asked where its sum can tell
            before = problem.energy() if iterate.energy is None else iterate.energy
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
                    return self._accept(trial, energy, (before - energy) / max(abs(before), np.finfo(float).tiny))
            else:
                self.inverting = problem.volume_ratios()
            length /= 2
        problem.set_displacement(start)
        if before is not None and abs(slope) <= ROUND_OFF * abs(before):
            return Iterate(norm, before, exhausted=True)
        raise NotConvergedError("the line search found no step that lowers the energy")

    def _accept(self, norm: float, energy: float | None = None, gain: float = 0.0) -> Iterate:
        self._residual, self._trial = self._trial, self._residual
        return Iterate(norm, energy, gain)
