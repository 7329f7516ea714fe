"""Consistency of energy, residual and tangent, the patch test, and the rungs of the
linear solver."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from boxes import (
    COMM,
    at_the_bottom,
    curved_box,
    distorted_box,
    problem_on,
    solved,
    solver_of,
    zones_of,
)
from facts import Facts
from shapes import box_mesh
from verification_cases.consistency import patch_residual, slopes_of_remainders

from gyriflow.folding.linear_solver import PLAIN, NotConvergedError
from gyriflow.folding.newton import NewtonSettings


def growing_problem(contact=False, mesh=None, **changes):
    mesh = mesh or distorted_box()
    # walls that stand on the wrong side of their planes: contact acts from the start
    walls = {
        "left": lambda c: c[:, 0] < -3.99,
        "right": lambda c: c[:, 0] > 3.99,
        "planes": (-5.0, 5.0),
    }
    zones = zones_of(mesh, at_the_bottom, **(walls if contact else {}))
    layers = {
        "mu": lambda x: 300 + 2e5 * (x[:, 2] + 3e-3),
        "dg": lambda x: 0.004 + 0.4 * x[:, 2],
        "dr": 0.002,
    } | changes
    return problem_on(mesh, zones, **layers)


@pytest.mark.parametrize("order", [1, 2])
def test_taylors_remainders_fall_with_the_square_of_the_step(order):
    # with layers, remembered stress, clamped facets and contact at once
    assert slopes_of_remainders(COMM, order) == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("order", [1, 2])
def test_a_uniform_body_is_in_equilibrium_under_an_affine_displacement(order):
    assert patch_residual(COMM, order) <= 1e-12


BOTH_ORDERS = pytest.mark.parametrize(
    "mesh", [distorted_box(), curved_box()], ids=["linear", "quadratic"]
)


@BOTH_ORDERS
def test_contact_pushes_back_with_the_penalty_pressure(mesh):
    zones = zones_of(mesh, right=lambda c: c[:, 0] > 3.99, planes=(-5.0, 4.5))
    problem = problem_on(mesh, zones)
    residual = problem.residual(problem.rest()).owned.reshape(-1, 3)
    force = COMM.allreduce(float(residual[:, 0].sum()))
    # the wall at 4 mm stands 0.5 mm beyond a plane that the right hemisphere may not
    # pass to the left
    assert force == pytest.approx(-5e5 * 0.5e-3 * 36e-6, rel=1e-10)


@BOTH_ORDERS
def test_newton_converges_quadratically_with_tight_linear_solves(mesh):
    count = solved(
        growing_problem(mesh=mesh), newton_tolerance=1e-12, krylov_tolerance=1e-10
    )
    assert count.newton <= 7
    assert count.residual <= 1e-12
    assert count.rung == PLAIN
    # ten digits in each of the linear solves
    assert count.krylov <= 50 * count.newton


@pytest.mark.parametrize("contact", [False, True])
def test_the_energy_never_rises_from_one_iterate_to_the_next(contact):
    problem = growing_problem(contact, dg=lambda x: 0.05 + 5 * x[:, 2])
    solver = solver_of(problem, newton_tolerance=1e-10, krylov_tolerance=1e-8)
    energies = []
    search = solver._line_search

    def recorded(iterate, direction):
        energies.append(problem.energy(iterate.residual.displacement))
        return search(iterate, direction)

    solver._line_search = recorded
    energies.append(problem.energy(solver.solve().displacement))
    assert len(energies) > 2
    assert (np.diff(energies) <= 1e-12 * abs(energies[0])).all()


def test_a_first_guess_that_inverts_elements_is_not_used():
    problem = growing_problem()
    guess = problem.rest()
    guess[:, 2] = -2.0 * problem.domain.local(problem.domain.positions)[:, 2]
    solution = solver_of(problem).solve(guess)
    assert solution.residual <= NewtonSettings().newton_tolerance
    assert problem.domain.smallest_volume_ratio(solution.displacement) > 0


def test_a_rank_on_which_nothing_moves_does_not_stop_the_others():
    # a long bar clamped over most of its length: some rank has clamped nodes only
    mesh = box_mesh((24, 1, 1), (48.0, 2.0, 2.0))
    zones = zones_of(mesh, lambda c: c[:, 0] < 12.0)
    solver = solver_of(problem_on(mesh, zones, dg=0.01, dr=0.01))
    again = solver.solve().displacement
    assert solver.solve(again).residual <= NewtonSettings().newton_tolerance


def test_a_step_with_nothing_left_to_gain_ends_and_is_not_called_converged(monkeypatch):
    problem = growing_problem()
    solver = solver_of(problem)
    monkeypatch.setattr(
        solver, "_line_search", lambda iterate, _: replace(iterate, exhausted=True)
    )
    count = solver.solve()
    assert count.newton == 1
    assert count.residual > NewtonSettings().newton_tolerance
    assert not count.converged
    monkeypatch.undo()
    assert solver.solve().converged


@pytest.mark.one_rank
@pytest.mark.parametrize(("rise", "is_accepted"), [(1e-14, True), (1e-9, False)])
def test_an_energy_may_rise_by_round_off_alone(rise, is_accepted, monkeypatch):
    problem = growing_problem()
    # as if each energy were a little above the one before
    at_rest = problem.energy(problem.rest())
    # energies are compared where there are contributions, such as this one of nothing
    nothing = SimpleNamespace(
        add_forces=lambda u, out: None,
        stiffness=lambda u, convex: None,
        max_step=lambda u, direction: 1.0,
    )
    problem.contributions.append(nothing)
    number = itertools.count()
    monkeypatch.setattr(
        problem, "energy", lambda u: at_rest * (1 + rise) ** next(number)
    )
    solver = solver_of(problem)
    if is_accepted:
        assert solver.solve().converged
    else:
        with pytest.raises(NotConvergedError):
            solver.solve()


@pytest.mark.one_rank
@pytest.mark.parametrize(("gain", "newton"), [(1e-3, 50), (0.0, 5)])
def test_iterations_that_lower_the_energy_do_not_count_towards_their_limit(
    gain, newton, monkeypatch
):
    problem = growing_problem()
    solver = solver_of(problem, max_newton=5)
    monkeypatch.setattr(
        solver, "_line_search", lambda iterate, _: replace(iterate, progress=gain)
    )
    with pytest.raises(NotConvergedError, check=Facts(newton)):
        solver.solve()
