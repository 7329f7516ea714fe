"""Newton's method for the displacement of one step: inexact linear solves, each
followed by a line search."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.tetrahedra import TetrahedralMesh, signed_volumes
from ..geometry.triangles import Floats
from ..units import M_PER_MM, MM_PER_M
from .linear_solver import (
    DEFAULT_COARSE,
    PLAIN,
    CoarseSettings,
    Direction,
    LinearSolver,
    NotConvergedError,
)
from .problem import NonlinearProblem
from .tangent import Residual, Tangent

ENERGY_ROUND_OFF = 1e-12
"""Relative round-off of an energy, a sum over elements."""
MIN_RESOLVED = 1e-6
"""Relative change below which energies cannot be compared: round-off at strains of a
ten-thousandth."""
MAX_ITERATIONS_FACTOR = 10
"""Iterations allowed in all, as a multiple of `max_newton`."""
STAGNATION_FACTOR = 10.0
"""Below this multiple of the tolerance, an iteration that does not halve the residual
is followed by one with the exact tangent."""
MAX_FORCING = 0.1
"""Largest forcing term: relative tolerance of a linear solve far from the solution."""
ARMIJO = 1e-4
"""Fraction of the decrease predicted by the slope that a line search requires (Armijo
1966)."""


@dataclass(frozen=True)
class NewtonSettings:
    """Tolerances and limits of the iteration.

    `newton_tolerance` is relative to the residual at u = 0, `krylov_tolerance` to the
    linear right-hand side: see `_forcing_term`. An iteration that lowers the energy by
    more than the fraction `min_progress` does not count towards `max_newton`.
    `keeps_iterates` is for those who need the way to a solution.
    """

    newton_tolerance: float = 1e-4
    krylov_tolerance: float = 1e-3
    max_newton: int = 20
    max_krylov: int = 1000
    max_backtracks: int = 8
    min_progress: float = 1e-6
    keeps_iterates: bool = False
    coarse: CoarseSettings = DEFAULT_COARSE


@dataclass
class Solution:
    """A step's displacement (k, 3) of the local nodes in m, and the work it took.

    In addition the iterations, the highest index in `RUNGS` of a linear solve, and the
    residual relative to that at zero displacement. `converged` is True if this is below
    the tolerance, False if round-off prevented further progress.
    """

    displacement: Floats
    newton: int = 0
    krylov: int = 0
    rung: int = PLAIN
    residual: float = np.inf
    converged: bool = False


@dataclass(frozen=True, eq=False)
class Iterate:
    """An iterate: its residual at its displacement, and its energy in J if computed.

    `progress` is the relative decrease of the energy in the iteration, if computed.
    `exhausted` is True if round-off prevents further progress.
    """

    residual: Residual
    energy: float | None = None
    progress: float = 0.0
    exhausted: bool = False


def residual_floor(mesh: TetrahedralMesh, modulus_pa: float) -> float:
    """Return the residual in N that counts as solved in a mesh in mm, whatever that at
    zero displacement."""
    edge_m = float(np.cbrt(signed_volumes(mesh).mean())) * M_PER_MM
    return 1e-11 * modulus_pa * edge_m**2 * math.sqrt(len(mesh.vertices))


def _forcing_term(
    final: float,
    left: float,
    tightest: float,
) -> float:
    """Return the forcing term of inexact Newton, the relative tolerance of a linear
    solve (Eisenstat and Walker 1996).

    `final` is the tolerance that would end the step. `left` is the fraction of the
    residual that remained after the last iteration (after the next one, about its
    square remains, however accurate the linear solve). `tightest` is the tolerance for
    fast convergence.
    """
    if left**2 > MAX_FORCING:
        return max(MAX_FORCING, final)
    forcing = max(tightest, left**2)
    # a slightly tighter tolerance, if that ends the step
    return final if final >= 0.1 * forcing else forcing


class NewtonSolver:
    """Newton's method for the steps of a run.

    State that it keeps between steps affects how a solution is found, and changes the
    solution within the tolerance only.

    A residual below `residual_floor`, in N, counts as solved even if that at zero
    displacement is hardly larger. `last` is the residual of the current step's last
    iterate, even if the solve failed. `inverted` is det F (c, p) of the local elements
    in its last trial that inverted an element, None if there was none. `iterates` are
    the displacements (k, 3) of the current step's iterates, if they are kept.
    """

    def __init__(
        self,
        problem: NonlinearProblem,
        settings: NewtonSettings,
        residual_floor: float,
    ) -> None:
        self.problem = problem
        self.settings = settings
        self.residual_floor = residual_floor
        self.linear_solver = LinearSolver(problem, settings.max_krylov, settings.coarse)
        # fraction of the residual after the first iteration of the last step
        self._first_left = 0.0
        self.last: Residual | None = None
        self.inverted: Floats | None = None
        self.iterates: list[Floats] = []

    def solve(self, *guesses: Floats) -> Solution:
        """Return the displacement of the step, starting from the first useful one of
        the guesses (k, 3) in m.

        NotConvergedError if the residual does not fall below the tolerance.
        """
        problem = self.problem
        settings = self.settings
        self.inverted = None
        self.iterates = []
        at_rest = problem.residual(problem.rest())
        self.last = at_rest
        if not np.isfinite(at_rest.norm):
            raise NotConvergedError("the forces at zero displacement are not finite")
        tolerance = max(settings.newton_tolerance * at_rest.norm, self.residual_floor)
        is_solved = at_rest.norm <= tolerance
        iterate = Iterate(at_rest if is_solved else self._best_start(guesses, at_rest))
        norm = iterate.residual.norm
        norm_before = np.inf
        solution = Solution(iterate.residual.displacement)
        # where folds snap through or slide along each other, the energy decreases long
        # before the residual does
        n_stalled = 0
        max_iterations = MAX_ITERATIONS_FACTOR * settings.max_newton
        while norm > tolerance and not iterate.exhausted:
            self.last = iterate.residual
            if n_stalled >= settings.max_newton or solution.newton >= max_iterations:
                raise NotConvergedError(
                    "Newton's method did not converge",
                    found=f"residual {norm:.2e} N after {solution.newton} iterations",
                    expected=f"at most {tolerance:.2e} N",
                )
            solution.newton += 1
            stagnates = norm_before / 2 < norm <= STAGNATION_FACTOR * tolerance
            if solution.newton == 1:
                left = max(norm / at_rest.norm, self._first_left)
            else:
                left = norm / norm_before
            tightest = settings.krylov_tolerance
            forcing = _forcing_term(0.4 * tolerance / norm, left, tightest)
            # a lagged tangent with an error below the forcing term is as good as a new
            # one
            within = 0.0 if stagnates else forcing
            tangent = problem.tangent(iterate.residual, within=within)
            try:
                iterate = self._iterate(
                    iterate, tangent, forcing, solution, convexify=not stagnates
                )
            except NotConvergedError:
                if not tangent.elastic.lagged and forcing <= tightest:
                    raise
                tangent = problem.tangent(iterate.residual)
                forcing = min(forcing, tightest)
                iterate = self._iterate(
                    iterate, tangent, forcing, solution, convexify=not stagnates
                )
            if iterate.progress < settings.min_progress:
                n_stalled += 1
            if settings.keeps_iterates:
                self.iterates.append(iterate.residual.displacement)
            norm_before = norm
            norm = iterate.residual.norm
            if solution.newton == 1:
                self._first_left = norm / norm_before
        self.last = iterate.residual
        solution.displacement = iterate.residual.displacement
        solution.residual = norm / at_rest.norm if at_rest.norm > 0 else 0.0
        solution.converged = norm <= tolerance
        return solution

    def _best_start(self, guesses: Sequence[Floats], at_rest: Residual) -> Residual:
        """Return the first residual at a guess that is below half of that at rest, else
        the residual at rest."""
        problem = self.problem
        for guess in map(problem.without_rigid_motion, guesses):
            # as far as contact allows
            length = problem.max_step(at_rest.displacement, guess)
            u = length * guess
            if problem.keeps_volume(u):
                residual = problem.residual(u)
                if residual.norm < 0.5 * at_rest.norm:  # false for NaN
                    return residual
        return at_rest

    def _iterate(
        self,
        iterate: Iterate,
        tangent: Tangent,
        forcing: float,
        solution: Solution,
        *,
        convexify: bool,
    ) -> Iterate:
        direction = self.linear_solver.solve(
            tangent, iterate.residual, forcing, convexify=convexify
        )
        solution.krylov += direction.iterations
        solution.rung = max(solution.rung, direction.rung)
        return self._line_search(iterate, direction)

    def _line_search(self, iterate: Iterate, direction: Direction) -> Iterate:
        """Halve the step along a direction until it lowers the energy and inverts no
        element; return that iterate."""
        problem = self.problem
        start = iterate.residual.displacement
        slope = direction.slope
        before = iterate.energy
        is_convex = direction.convex
        if problem.contributions:
            # the energy is compared wherever its change is above round-off
            before = problem.energy(start) if before is None else before
            is_convex = is_convex and abs(slope) <= MIN_RESOLVED * abs(before)
        owned = direction.values[: problem.domain.n_owned].ravel()
        longest = problem.max_step(start, direction.values)
        for halvings in range(self.settings.max_backtracks):
            length = longest / 2**halvings
            u = start + length * direction.values
            if not problem.keeps_volume(u):
                self.inverted = problem.domain.volume_ratios(u)
                continue
            trial = problem.residual(u)
            is_finite = np.isfinite(trial.norm)
            is_smaller = trial.norm < iterate.residual.norm
            # a convex energy whose slope nearly vanishes at the trial has fallen by
            # about half of the initial slope
            is_flat = abs(problem.domain.dot(owned, trial.owned)) <= 0.1 * abs(slope)
            if is_convex and is_finite and is_smaller and is_flat:
                return Iterate(trial)
            before = problem.energy(start) if before is None else before
            energy = problem.energy(u)
            is_lower = is_finite and energy <= before + ARMIJO * length * slope
            # if the energy's change is within round-off, the residual decides
            is_same = abs(energy - before) <= ENERGY_ROUND_OFF * abs(before)
            if is_lower or (is_smaller and is_same):
                progress = (before - energy) / max(
                    abs(before),
                    np.finfo(float).tiny,
                )
                return Iterate(trial, energy, progress)
        if before is not None and abs(slope) <= ENERGY_ROUND_OFF * abs(before):
            return Iterate(iterate.residual, before, exhausted=True)
        raise NotConvergedError("the line search found no step that lowers the energy")

    def worst_places(self) -> str:
        """Return where a failed solve was worst: the most compressed element and the
        largest residual, in mm."""
        problem = self.problem
        domain = problem.domain
        last = self.last or problem.residual(problem.rest())
        ratios = self.inverted
        if ratios is None:
            ratios = domain.volume_ratios(last.displacement)
        nodes_mm = domain.nodes * MM_PER_M
        centres_mm = nodes_mm[domain.corners].mean(axis=1)
        ratio, tet, centre = domain.locate_minimum(
            ratios.min(axis=1), domain.tet_of_cell, centres_mm
        )
        forces = np.linalg.norm(
            last.owned.reshape(-1, 3),
            axis=1,
        )
        negative, vertex, position = domain.locate_minimum(
            -forces, domain.vertex_of_node, nodes_mm
        )
        return (
            f"smallest det F {ratio:.3g} in element {tet} at"
            f" {np.round(centre, 1).tolist()} mm, largest residual {-negative:.2e} N at"
            f" vertex {vertex} at {np.round(position, 1).tolist()} mm"
        )
