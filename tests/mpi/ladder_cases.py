"""Each rung of the linear solver's ladder on a case that needs it, and further contributions to the problem."""

import numpy as np
import pytest
from boxes import (
    COMM,
    distorted_box,
    everywhere_known,
    problem_on,
    set_layers,
    zones_of,
)
from petsc4py import PETSc
from shapes import box_mesh

from gyriflow.folding import newton
from gyriflow.folding.ladder import GMRES, KEPT, REBUILT, SHIFTED, NotConvergedError
from gyriflow.folding.newton import NewtonSettings, NewtonSolver
from gyriflow.geometry.tetrahedra import TetrahedralMesh


def at_the_bottom(centre):
    return centre[:, 2] < -2.99


def clamped_box(**layers):
    mesh = distorted_box()
    uniform = {"mu": 500.0, "dg": lambda x: 0.01 + x[:, 2], "dr": 0.002}
    return problem_on(mesh, zones_of(mesh, at_the_bottom), **(uniform | layers))


def solved(problem, **settings):
    solver = NewtonSolver(problem, NewtonSettings(**({"newton_tolerance": 1e-9} | settings)), residual_floor=0.0)
    count = solver.solve(np.zeros_like(problem.displacement))
    assert problem.smallest_volume_ratio() > 0
    return count, everywhere_known(problem)


def empty_matrix(problem):
    size = (3 * problem.domain.owned, 3 * len(problem.domain.positions))
    return PETSc.Mat().createAIJ((size, size), bsize=3, nnz=(6, 6), comm=COMM)


class Springs:
    """Linear springs between each node and its place, stronger along one axis; optionally turned, as no energy is."""

    def __init__(self, problem, stiffness, turned=0.0, reach=1.0):
        self.problem = problem
        self.block = stiffness * (np.eye(3) + turned * np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
        self.reach = reach
        self.asked = 0

    def _owned(self):
        return self.problem.displacement[: self.problem.domain.owned]

    def energy(self):
        u = self._owned()
        return COMM.allreduce(float(0.5 * np.einsum("ni,ij,nj->", u, self.block, u)))

    def add_residual(self, out):
        out.array += (self._owned() @ self.block.T).ravel()

    def stiffness(self, *, convex=False):
        matrix = empty_matrix(self.problem)
        first = matrix.getOwnershipRange()[0]
        for node in range(self.problem.domain.owned):
            rows = np.arange(first + 3 * node, first + 3 * node + 3, dtype=PETSc.IntType)
            matrix.setValues(rows, rows, self.block)
        matrix.assemble()
        return matrix

    def largest_step(self, direction):
        self.asked += 1
        return self.reach


def test_an_easy_step_stays_on_the_first_rung():
    assert solved(clamped_box())[0].rung == KEPT


STIFFENED_LIMIT = 15


def stiffened_box_solved_by(solver):
    """Solves a body a hundred times as stiff at one end, with a solver of the plain one or a new one."""
    problem = solver.problem
    x = problem.domain.local(problem.domain.positions)
    stiff = np.where(x[:, 0] > 0, 5e5, 5.0)
    centres = np.tile([0.0, 0.0, 1.0], (len(problem.domain.cells), 1))
    set_layers(problem, stiff, 0.01 + x[:, 2], np.zeros(len(x)), centres)
    return solver.solve(np.zeros_like(problem.displacement))


def tight_solver():
    return NewtonSolver(clamped_box(), NewtonSettings(1e-9, 1e-8, max_krylov=STIFFENED_LIMIT), residual_floor=0.0)


def test_a_stale_preconditioner_is_rebuilt_where_conjugate_gradients_fail_with_it():
    solver = tight_solver()
    solver.solve(np.zeros_like(solver.problem.displacement))
    # what was learnt of the plain body misleads
    count = stiffened_box_solved_by(solver)
    assert count.rung == REBUILT
    # a rebuilt preconditioner is as good as a new one: all that is lost are the attempts with kept and with new bounds
    fresh = stiffened_box_solved_by(tight_solver())
    assert fresh.rung == KEPT
    assert count.krylov <= 1.2 * fresh.krylov + 2 * STIFFENED_LIMIT


def test_the_smoother_follows_the_tangent():
    problem = clamped_box()
    domain = problem.domain
    nothing, up = np.zeros(len(problem.displacement)), np.tile([0.0, 0.0, 1.0], (len(domain.cells), 1))
    inverses = []
    for stiffness in (500.0, 1500.0):
        set_layers(problem, np.full(len(nothing), stiffness), nothing, nothing, up)
        inverses.append(problem.tangent().smoothing.invertBlockDiagonal().copy())
    held = domain.positions[domain.vertex_of_node[: domain.owned], 2] <= -2.99e-3
    assert inverses[0][~held] == pytest.approx(3.0 * inverses[1][~held], rel=1e-9)


def test_a_tangent_that_is_not_positive_definite_is_shifted():
    # a bar, slightly bent, that grows by 4 % between two walls: three times what makes it buckle
    bar = box_mesh((16, 2, 2), (32.0, 2.0, 2.0))
    bend = 0.1 * np.cos(np.pi * bar.vertices[:, 0] / 32) ** 2
    mesh = TetrahedralMesh(bar.vertices + bend[:, None] * [0.0, 0.0, 1.0], bar.tets)
    zones = zones_of(mesh, lambda centre: np.abs(centre[:, 0]) > 15.99)
    problem = problem_on(mesh, zones, mu=500.0, dg=0.04, dr=0.04)
    count, u = solved(problem, newton_tolerance=1e-8, max_newton=60)
    assert count.rung == SHIFTED
    assert count.residual <= 1e-8
    # it has given way sideways, by more than it could grow
    assert u[:, 2].max() > 1e-3


def test_gmres_takes_a_tangent_that_is_not_symmetric(monkeypatch):
    # these forces have no energy, which directions that are solved loosely need not lower
    monkeypatch.setattr(newton, "LOOSE", 1e-6)
    problem = clamped_box()
    problem.contributions.append(Springs(problem, 2.0, turned=4.0))
    count, _ = solved(problem, newton_tolerance=1e-8, krylov_tolerance=1e-6, max_krylov=60)
    assert count.rung == GMRES
    assert count.residual <= 1e-8


def test_what_no_rung_solves_in_time_is_told():
    with pytest.raises(NotConvergedError, match="no linear solver"):
        solved(clamped_box(), krylov_tolerance=1e-8, max_krylov=2)


def test_a_contribution_holds_the_body_and_limits_the_steps():
    free, held = clamped_box(), clamped_box()
    springs = Springs(held, 50.0, reach=0.5)
    held.contributions.append(springs)
    count, moved = solved(held, max_newton=60)
    easy, far = solved(free)
    assert np.abs(moved).max() < 0.5 * np.abs(far).max()
    # half steps at most: the residual can no more than halve in each
    assert count.newton >= 25 > easy.newton
    assert springs.asked == count.newton + 1
