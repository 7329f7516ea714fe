"""The linear solver: its preconditioner, and tangents that are not positive definite."""

import numpy as np
import pytest
from boxes import (
    at_the_bottom,
    distorted_box,
    everywhere_known,
    problem_on,
    set_layers,
    smooth_displacement,
    solved,
    zones_of,
)
from shapes import box_mesh

from gyriflow.folding import linear_solver
from gyriflow.folding.linear_solver import (
    SHIFTED,
    NotConvergedError,
    TwoLevelPreconditioner,
    inverse_blocks,
    inverse_matrix,
)
from gyriflow.geometry.tetrahedra import TetrahedralMesh


def clamped_box(**layers):
    mesh = distorted_box()
    uniform = {"mu": 500.0, "dg": lambda x: 0.01 + x[:, 2], "dr": 0.002}
    return problem_on(mesh, zones_of(mesh, at_the_bottom), **(uniform | layers))


def test_the_preconditioner_is_that_of_the_present_tangent():
    problem = clamped_box()
    domain = problem.domain
    nothing, up = np.zeros(len(problem.displacement)), np.tile([0.0, 0.0, 1.0], (len(domain.cells), 1))
    r, z = problem.new_vector(), problem.new_vector()
    r.array[:] = smooth_displacement(domain, 1.0)[: domain.owned].ravel()
    problem.apply_boundary_conditions(r)
    results = []
    for stiffness in (500.0, 1500.0):
        set_layers(problem, np.full(len(nothing), stiffness), nothing, nothing, up)
        preconditioner = TwoLevelPreconditioner(domain, problem.tangent())
        preconditioner.renew()
        preconditioner.apply(None, r, z)
        results.append(z.array.copy())
    assert results[0] == pytest.approx(3.0 * results[1], rel=1e-6, abs=1e-9 * np.abs(results[0]).max())


def test_rigid_motions_of_the_parts_are_solved_by_the_coarse_level(monkeypatch):
    # with a part for the whole body, which is held by weak springs alone, that is all there is to solve
    monkeypatch.setattr(linear_solver, "PARTS", 1)
    mesh = distorted_box()
    problem = problem_on(mesh, zones_of(mesh), mu=500.0)
    tangent = problem.tangent()
    matrix = tangent.elastic.matrix
    for node in np.flatnonzero(matrix.nodes == matrix.columns - problem.domain.space.dofmap.index_map.local_range[0]):
        matrix.values[node] += 1e-3 * np.eye(3)
    preconditioner = TwoLevelPreconditioner(problem.domain, tangent)
    preconditioner.renew()
    force, moved = problem.new_vector(), problem.new_vector()
    force.array[:] = np.tile([1e-3, 0.0, 0.0], problem.domain.owned)
    preconditioner.apply(None, force, moved)
    by_springs = moved.array.reshape(-1, 3)
    assert by_springs[:, 0] == pytest.approx(1.0, rel=0.02)
    assert np.abs(by_springs[:, 1:]).max() < 0.02


@pytest.mark.one_rank
def test_blocks_that_are_not_positive_definite_are_made_so():
    turn = np.linalg.qr(np.array([[2.0, 1.0, 0.0], [0.3, 1.0, 1.0], [0.0, 0.2, 3.0]]))[0]
    blocks = np.stack([turn @ np.diag(values) @ turn.T for values in ([4.0, 2.0, 1.0], [4.0, 2.0, -1.0])])
    expected = turn @ np.diag([0.25, 0.5, 1.0]) @ turn.T
    assert inverse_blocks(blocks) == pytest.approx(np.stack([expected, expected]), abs=1e-12)
    for block in blocks:
        assert inverse_matrix(block) == pytest.approx(expected, abs=1e-12)


def test_a_tangent_that_is_not_positive_definite_is_shifted():
    # a bar, slightly bent, that grows by 4 % between two walls: three times what makes it buckle
    bar = box_mesh((16, 2, 2), (32.0, 2.0, 2.0))
    bend = 0.1 * np.cos(np.pi * bar.vertices[:, 0] / 32) ** 2
    mesh = TetrahedralMesh(bar.vertices + bend[:, None] * [0.0, 0.0, 1.0], bar.tets)
    zones = zones_of(mesh, lambda centre: np.abs(centre[:, 0]) > 15.99)
    problem = problem_on(mesh, zones, mu=500.0, dg=0.04, dr=0.04)
    count = solved(problem, newton_tolerance=1e-8, max_newton=60)
    assert count.rung == SHIFTED
    assert problem.smallest_volume_ratio() > 0
    assert count.residual <= 1e-8
    # it has given way sideways, by more than it could grow
    assert everywhere_known(problem)[:, 2].max() > 1e-3


@pytest.mark.one_rank
def test_what_is_not_solved_in_time_is_told():
    with pytest.raises(NotConvergedError, match="found no descent"):
        solved(clamped_box(), newton_tolerance=1e-9, krylov_tolerance=1e-8, max_krylov=2)
