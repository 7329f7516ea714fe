"""The rate problem of a model that forgets stress: which velocity growth has in the present shape, and steps of it.

A step without memory starts free of stress, so that its limit for short steps is linear: the velocity v makes
½ v·Kv − f·v stationary, with the stiffness K of the present shape and the load f of the growth rate. Steps of second
order are put together from such velocities. What is left for Newton's method is contact, which a step of given length
meets: of all displacements, it takes the one nearest to the wanted one, in the norm of K, that the barrier lets pass.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from .checkpoint import State
from .ladder import NotConvergedError
from .newton import NewtonSolver, StepCount
from .problem import Floats, Problem

SMALL = 1e-3
"""Part of a step's growth by which the load is differenced: the error is of its square, far below all tolerances."""


class RateProblem(Problem):
    """A step's problem with a quadratic elastic energy, ½ u·Ku − b·u, made anew for each shape; parameters as there."""

    summed = True  # multigrid keeps the first operator it is given, and contact comes and goes

    @property
    def quadratic(self) -> bool:
        """Whether the energy is quadratic: it is without contact."""
        return not self.contributions

    def linearise(self) -> None:
        """Takes stiffness and load from the present mesh and layers; the load is then what is to be balanced."""
        growth = [values.x.array.copy() for values in (self._dg, self._dr)]
        self.set_displacement(np.zeros_like(self.displacement))
        loads = [self.new_vector(), self.new_vector()]
        for sign, load in zip((-1.0, 1.0), loads, strict=True):
            self._set_growth(sign * SMALL * growth[0], sign * SMALL * growth[1])
            super()._elastic_residual(load)
        self._set_growth(0.0 * growth[0], 0.0 * growth[1])
        self._matrix, self._products = super()._elastic_tangent()
        self._present, self._elastic = None, None  # assembled anew, in the same place
        self._set_growth(*growth)
        self._force, other = loads
        self._force.axpy(-1.0, other)
        self._force.scale(1 / (2 * SMALL))
        self._force.array[self._fixed_owned] = 0.0
        if self._motions is not None:
            self._motions.remove(self._force.array_w)

    def _set_growth(self, dg: Floats, dr: Floats) -> None:
        self._dg.x.array[:], self._dr.x.array[:] = dg, dr

    @contextmanager
    def in_small(self) -> Iterator[None]:
        """Takes `SMALL` of the growth for the time of the block: what is linear in the step is that part of it then."""
        growth = [values.x.array.copy() for values in (self._dg, self._dr)]
        self._set_growth(SMALL * growth[0], SMALL * growth[1])
        try:
            yield
        finally:
            self._set_growth(*growth)

    def aim_at(self, displacement: Floats) -> None:
        """Makes (k, 3) local displacements in m what the elastic energy wants; contact may want another one."""
        self.set_displacement(displacement)
        self._products.mult(self.vector, self._force)

    @contextmanager
    def without_contact(self) -> Iterator[None]:
        """Leaves the contributions out for the time of the block."""
        kept, self.contributions = self.contributions, []
        try:
            yield
        finally:
            self.contributions = kept

    def stored_energy(self) -> float:
        """Returns the elastic energy in J of the model, not of its quadratic form, at the present displacement."""
        return super().elastic_energy()

    def elastic_energy(self) -> float:
        """Returns ½ u·Ku − b·u in J."""
        self._products.mult(self.vector, self._product)
        return 0.5 * self._product.dot(self.vector) - self._force.dot(self.vector)

    def _elastic_residual(self, out: PETSc.Vec) -> None:
        self._products.mult(self.vector, out)
        out.axpy(-1.0, self._force)

    def _elastic_tangent(self) -> tuple[PETSc.Mat, PETSc.Mat]:
        return self._matrix, self._products

    def _foretold(self, _: float) -> bool:
        return True


@dataclass(frozen=True, eq=False)
class RateStep:
    """What a step made of velocities led to; its displacement is left in the problem.

    Attributes
    ----------
    rate : (n, 3) float
        Velocity in m/s at the step's start, without contact.
    strained : (k, 3) float
        Displacement in m of the local nodes that has the step's stress: of the last velocity and of contact.
    count
        What all its solves took; the residual is that of the last.
    """

    rate: Floats
    strained: Floats
    count: StepCount


def rate_step(
    state: State,
    step_s: float,
    problem: RateProblem,
    solver: NewtonSolver,
    *,
    two_stages: bool,
    move_aside: Callable[[Floats, float], None],
) -> RateStep:
    """Solves a step of second order from the state that the problem has been set up for, growth as at its start.

    Two-step Adams-Bashforth, u = Δt ((1 + r/2) v − r/2 v_before) with r = Δt/Δt_before; the midpoint rule,
    u = Δt v(x + Δt v/2), for the first step and where `two_stages` asks for it.

    Parameters
    ----------
    move_aside
        Places the mesh at (n, 3) positions in m and sets the tissue there, as at a part of the step.

    Raises
    ------
    NotConvergedError
        Where a solve fails or an element would turn inside out.
    """
    domain = problem.domain
    at_start, first = _grown(problem, solver, step_s * domain.local(state.predicted_rate()))
    # what was in contact stays so: where it leads, the last steps know and growth alone does not
    led = domain.local(state.predicted(step_s))
    counts = [first]
    if state.rate is None or two_stages:
        counts.append(_met(problem, solver, at_start / 2, led / 2))
        halfway = domain.gathered(problem.displacement[: domain.owned])
        move_aside(state.positions + halfway, 0.5)
        grown, count = _grown(problem, solver, at_start)
        domain.place(state.positions)
        wanted = grown
        counts.append(count)
    else:
        grown, part = at_start, step_s / state.last_s / 2
        wanted = (1 + part) * grown - part * step_s * domain.local(state.rate)
    counts.append(_met(problem, solver, wanted, led))
    strained = grown + problem.displacement - wanted
    rate: Floats = domain.gathered(at_start[: domain.owned]) * (1 / step_s)
    return RateStep(rate, strained, summed(counts))


def _grown(problem: RateProblem, solver: NewtonSolver, guess: Floats) -> tuple[Floats, StepCount]:
    """Returns the displacement in m of the local nodes that growth without contact leads to at the present rate."""
    problem.linearise()
    with problem.without_contact():
        count = solver.solve(guess)
    return problem.displacement.copy(), count


def _met(problem: RateProblem, solver: NewtonSolver, wanted: Floats, led: Floats) -> StepCount:
    """Leaves in the problem the displacement nearest to a wanted one that contact lets pass; `led` is a guess of it."""
    if problem.contributions:
        problem.aim_at(wanted)
        return solver.solve(wanted, led)
    problem.set_displacement(problem.admissible(wanted))
    if not problem.smallest_volume_ratio() > 0:
        raise NotConvergedError("an element would turn inside out")
    return StepCount(residual=0.0, converged=True)


def summed(counts: Sequence[StepCount]) -> StepCount:
    """Returns what several solves took together."""
    return StepCount(
        sum(count.newton for count in counts),
        sum(count.krylov for count in counts),
        max(count.rung for count in counts),
        max(count.residual for count in counts),
        all(count.converged for count in counts),
    )
