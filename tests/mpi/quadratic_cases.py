"""Quadratic elements with curved sides: what they must do as linear ones do, and what
is theirs alone."""

import numpy as np
import pytest
from boxes import (
    COMM,
    at_the_bottom,
    box_with_a_bowed_side,
    gathered,
    problem_on,
    solved,
    zones_of,
)
from contact_bodies import (
    GAP_MM,
    HEIGHT_MM,
    approach,
    at_start,
    gap_and_pressure,
    problem_with_contact,
    stress_at,
    two_blocks,
)
from mpi4py import MPI
from shapes import box_mesh
from verification_cases.boxes import slab_parameters

from gyriflow.geometry.straightening import straightness
from gyriflow.geometry.tetrahedra import (
    boundary_faces,
    quadratic,
)
from gyriflow.units import M_PER_MM


def test_an_element_that_inverts_between_its_points_is_detected():
    mesh = quadratic(box_mesh((1, 1, 1), (2.0, 2.0, 2.0)))
    problem = problem_on(mesh, zones_of(mesh))
    # a node on an edge pulled beyond a quarter of it: the Jacobian changes sign at the
    # end of the edge
    a, b, middle = mesh.tets[0, [0, 1, 4]]
    bounds = []
    for part in (0.2, 0.3):
        moved = np.zeros_like(mesh.vertices)
        moved[middle] = part * (mesh.vertices[b] - mesh.vertices[a])
        u = problem.domain.local(moved * M_PER_MM)
        bounds.append(problem.domain.smallest_volume_ratio(u))
        inside = np.linalg.det(problem.evaluate("deformation", u))
        assert problem.domain.min_over_ranks(inside) > 0
    assert bounds[0] > 0 >= bounds[1]


BLOCKS = quadratic(two_blocks((2, 2, 1), (3, 2, 2)))


def test_pressed_blocks_have_the_pressure_of_the_closed_answer_on_any_number_of_ranks():
    moved = []
    # one rank alone need not solve it twice
    for comm in (COMM, MPI.COMM_SELF)[: COMM.size]:
        problem, contact = problem_with_contact(
            BLOCKS, 0.1, growth_along_z=0.1, comm=comm
        )
        u = solved(
            problem, newton_tolerance=1e-10, krylov_tolerance=1e-8, max_newton=80
        ).displacement
        assert contact.pair_count(u) > 10
        moved.append(gathered(problem.domain, u))
    assert np.abs(moved[0] - moved[-1]).max() <= 1e-6 * np.abs(moved[-1]).max()
    gap, pressure = gap_and_pressure(BLOCKS, problem, contact, u)
    assert 0 < gap < 0.1
    stretch = 1 + (GAP_MM - gap) / 2 / HEIGHT_MM
    assert pressure == pytest.approx(-stress_at(stretch, 0.1), rel=0.01)
    # an even pressure leaves faces even, although the meshes do not match: elements are
    # 2 and 3 mm long
    below = np.isclose(BLOCKS.vertices[:, 2], GAP_MM / 2)
    assert moved[0][below, 2].std() < 0.01 * M_PER_MM


def test_the_diagonal_has_the_blocks_of_contact():
    problem, contact = problem_with_contact(BLOCKS, 0.15)
    u = approach(problem.domain)
    tangent = problem.tangent(problem.residual(u))
    assert contact.pair_count(u) > 0
    blocks = tangent.diagonal()
    assert not np.array_equal(blocks, tangent.elastic.matrix.diagonal)
    unit, product = tangent.matrix.createVecs()
    first = unit.getOwnershipRange()[0] // 3
    for node in range(0, len(problem.domain.positions), 97):
        unit.set(0.0)
        if 0 <= node - first < problem.domain.n_owned:
            unit.array[3 * (node - first) + 1] = 1.0
        tangent.matrix.mult(unit, product)
        if 0 <= node - first < problem.domain.n_owned:
            expected = product.array.reshape(-1, 3)[node - first]
            # products are in single precision
            assert blocks[node - first, :, 1] == pytest.approx(
                expected, rel=1e-6, abs=1e-6 * np.abs(blocks).max()
            )


@pytest.mark.parametrize("memory_gw", [0.0, 1.0])
def test_inner_sides_that_bow_are_straightened_unless_stress_is_kept(memory_gw):
    mesh, bowed = box_with_a_bowed_side()
    changes = {"stress_memory_gw": memory_gw, "contact": "global"}
    p = slab_parameters(5.0, 0.01, fissure_x_mm=0.0, **changes)
    folding, state = at_start(mesh, zones_of(mesh, at_the_bottom), p)
    after = folding.step(state, p.step_s)
    moved_by_solver = state.positions + after.last
    is_moved = (after.positions != moved_by_solver).any(axis=1)
    least = straightness(after.positions, mesh.tets).min()
    if memory_gw:
        assert not is_moved.any()
        assert least < 0.4
    else:
        assert is_moved[bowed]
        assert not is_moved[boundary_faces(mesh)[0]].any()
        assert least > 0.4
    assert (COMM.bcast(after.positions) == after.positions).all()
