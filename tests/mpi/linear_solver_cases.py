"""The linear solver: its preconditioner, tangents that are not positive definite, what
is kept between iterations."""

import numpy as np
import pytest
from boxes import (
    at_the_bottom,
    distorted_box,
    gathered,
    problem_on,
    set_layers,
    smooth_displacement,
    solved,
    zones_of,
)
from contact_bodies import after_steps, closing_sulcus
from scipy.spatial.transform import Rotation
from shapes import box_mesh

from gyriflow.folding.linear_solver import (
    SHIFTED,
    CoarseSettings,
    NotConvergedError,
    TwoLevelPreconditioner,
    _inverse_blocks,
    _inverse_matrix,
)
from gyriflow.geometry.tetrahedra import TetrahedralMesh


def tangent_at_rest(problem):
    return problem.tangent(problem.residual(problem.rest()))


def clamped_box(**layers):
    mesh = distorted_box()
    uniform = {"mu": 500.0, "dg": lambda x: 0.01 + x[:, 2], "dr": 0.002}
    return problem_on(mesh, zones_of(mesh, at_the_bottom), **(uniform | layers))


def test_the_preconditioner_is_that_of_the_present_tangent():
    problem = clamped_box()
    domain = problem.domain
    nothing = np.zeros(len(problem.rest()))
    up = np.tile([0.0, 0.0, 1.0], (len(domain.cells), 1))
    r, z = tangent_at_rest(problem).matrix.createVecs()
    r.array[:] = smooth_displacement(domain, 1.0)[: domain.n_owned].ravel()
    problem.clear_fixed(r.array_w)
    results = []
    for stiffness in (500.0, 1500.0):
        set_layers(problem, np.full(len(nothing), stiffness), nothing, nothing, up)
        preconditioner = TwoLevelPreconditioner(domain, tangent_at_rest(problem))
        preconditioner.renew()
        preconditioner.apply(None, r, z)
        results.append(z.array.copy())
    soft, stiff = results
    assert soft == pytest.approx(3 * stiff, rel=1e-6, abs=1e-9 * np.abs(soft).max())


def test_rigid_motions_of_the_parts_are_solved_by_the_coarse_level():
    # with a part for the whole body, which is held by weak springs alone, that is all
    # there is to solve
    mesh = distorted_box()
    problem = problem_on(mesh, zones_of(mesh), mu=500.0)
    tangent = tangent_at_rest(problem)
    matrix = tangent.elastic.matrix
    first, _ = problem.domain.space.dofmap.index_map.local_range
    matrix.values[matrix.nodes == matrix.columns - first] += 1e-3 * np.eye(3)
    preconditioner = TwoLevelPreconditioner(
        problem.domain, tangent, CoarseSettings(max_parts=1)
    )
    preconditioner.renew()
    force, moved = tangent.matrix.createVecs()
    force.array[:] = np.tile([1e-3, 0.0, 0.0], problem.domain.n_owned)
    preconditioner.apply(None, force, moved)
    by_springs = moved.array.reshape(-1, 3)
    assert by_springs[:, 0] == pytest.approx(1.0, rel=0.02)
    assert np.abs(by_springs[:, 1:]).max() < 0.02


@pytest.mark.one_rank
def test_blocks_that_are_not_positive_definite_are_made_so():
    turn = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()
    eigenvalues = np.array([[4.0, 2.0, 1.0], [4.0, 2.0, -1.0]])
    blocks = turn * eigenvalues[:, None] @ turn.T
    expected = turn * [0.25, 0.5, 1.0] @ turn.T
    found = [*_inverse_blocks(blocks), *map(_inverse_matrix, blocks)]
    np.testing.assert_allclose(found, np.tile(expected, (4, 1, 1)), atol=1e-12)


def test_a_tangent_that_is_not_positive_definite_is_shifted():
    # a bar, slightly bent, that grows by 4 % between two walls: three times what makes
    # it buckle
    bar = box_mesh((16, 2, 2), (32.0, 2.0, 2.0))
    bend = 0.1 * np.cos(np.pi * bar.vertices[:, 0] / 32) ** 2
    mesh = TetrahedralMesh(bar.vertices + bend[:, None] * [0.0, 0.0, 1.0], bar.tets)
    zones = zones_of(mesh, lambda centre: np.abs(centre[:, 0]) > 15.99)
    problem = problem_on(mesh, zones, mu=500.0, dg=0.04, dr=0.04)
    count = solved(problem, newton_tolerance=1e-8, max_newton=60)
    assert count.rung == SHIFTED
    assert problem.domain.smallest_volume_ratio(count.displacement) > 0
    assert count.residual <= 1e-8
    # it has given way sideways, by more than it could grow
    assert gathered(problem.domain, count.displacement)[:, 2].max() > 1e-3


@pytest.mark.one_rank
def test_a_solve_that_takes_too_many_iterations_raises_an_error():
    problem = clamped_box()
    with pytest.raises(NotConvergedError):
        solved(problem, newton_tolerance=1e-9, krylov_tolerance=1e-8, max_krylov=2)


def counted(monkeypatch, problem):
    """Return a list that grows by one with each elastic tangent that is assembled."""
    matrix = problem._tangent.elastic.matrix
    assemble, calls = matrix.assemble, []

    def noted(u):
        calls.append(None)
        assemble(u)

    monkeypatch.setattr(matrix, "assemble", noted)
    return calls


@pytest.mark.parametrize(
    "kind", ["global", pytest.param("none", marks=pytest.mark.one_rank)]
)
def test_a_lagged_tangent_saves_assemblies_and_gives_the_same_solution(
    kind, monkeypatch
):
    calls, ends = [], []
    for is_lagged in (True, False):
        folding, start = closing_sulcus(kind, newton_tolerance=1e-9)
        calls.append(counted(monkeypatch, folding.problem))
        if not is_lagged:
            elastic = folding.problem._tangent.elastic
            monkeypatch.setattr(elastic, "predicts", lambda *_: False)
        ends.append(after_steps(folding, start, 4).positions)
    assert len(calls[0]) < len(calls[1])
    moved = np.abs(ends[1] - start.positions).max()
    assert np.abs(ends[0] - ends[1]).max() <= 1e-6 * moved


def test_a_tangent_that_predicts_other_forces_is_not_lagged():
    folding, state = closing_sulcus("none")
    folding.begin(state, state.step_s)
    problem = folding.problem
    x, _, z = folding.domain.local(state.positions).T
    # nothing moves at the base and at the sides, which are held
    u = 0.2 * np.stack([np.sin(np.pi * x / 6e-3) * z, 0 * z, 0 * z], axis=1)
    for part, known in ((0.0, False), (1e-4, True), (1.0, False)):
        residual = problem.residual(part * u)
        assert problem._tangent.elastic.predicts(residual, 0.03) == known
        assert problem.tangent(residual, within=0.03).elastic.lagged == known


@pytest.mark.parametrize(
    "support", ["box", pytest.param("free", marks=pytest.mark.one_rank)]
)
def test_newtons_method_begins_at_the_first_good_guess(support):
    folding, state = closing_sulcus("global", support=support)
    state = after_steps(folding, state, 3)
    folding.begin(state, state.step_s)
    found = folding.solver.solve(folding.domain.local(state.last)).displacement
    assert folding.solver.solve(found).newton == 0
    again = folding.solver.solve(-found, found, 0.5 * found)
    assert again.newton == 0
    assert np.abs(again.displacement - found).max() <= 1e-9 * np.abs(found).max()
    assert folding.solver.solve(0.5 * found).newton > 0
