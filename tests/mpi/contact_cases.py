"""Contact of the surface with itself: forces, pressed blocks, and large steps that
cross nothing."""

import ipctk
import numpy as np
import pytest
from boxes import COMM, gathered, smooth_displacement, solved
from contact_bodies import (
    GAP_MM,
    HEIGHT_MM,
    SIDE_MM,
    approach,
    gap_and_pressure,
    problem_with_contact,
    slab_with_a_sulcus,
    stress_at,
    two_blocks,
)
from shapes import box_mesh

from gyriflow.errors import MeshError
from gyriflow.folding.contact import SelfContact
from gyriflow.folding.domain import Domain
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces, quadratic
from gyriflow.units import M_PER_MM, MM_PER_M


def test_forces_fit_the_energy_and_stiffness_the_forces():
    # grids that do not match: where edges are parallel, which parts are nearest changes
    # at once
    mesh = two_blocks(upper=(4, 3, 3))
    problem, contact = problem_with_contact(mesh, distance=0.15)
    domain, u = problem.domain, approach(problem.domain)
    v = smooth_displacement(domain, 4e-7)[:, [2, 0, 1]].copy()
    energy = contact.energy(u)
    stiffness = contact.stiffness(u)
    owned = v[: domain.n_owned].ravel()
    direction, change = stiffness.createVecs()
    direction.array[:] = owned
    stiffness.mult(direction, change)

    def forces(at):
        out = np.zeros(3 * domain.n_owned)
        contact.add_forces(at, out)
        return out

    errors = []
    for h in (0.2, 0.1):
        gained = contact.energy(u + h * v) - energy
        of_energy = abs(gained - h * domain.dot(forces(u), owned))
        of_forces = forces(u + h * v) - forces(u) - h * change.array_r
        errors.append([of_energy, domain.norm(of_forces)])
    assert energy > 0
    assert np.log2(np.divide(*errors)) == pytest.approx([2.0, 2.0], abs=0.15)


def test_pressed_blocks_have_the_analytic_pressure_and_their_gap_follows_the_distance():
    growth, gaps = 0.2, []
    assert stress_at(1 + growth, growth) == pytest.approx(0.0, abs=1e-9)
    mesh = two_blocks(upper=(4, 3, 3))
    for distance in (0.2, 0.1, 0.05):
        problem, contact = problem_with_contact(mesh, distance, growth)
        u = solved(
            problem, newton_tolerance=1e-9, krylov_tolerance=1e-6, max_newton=60
        ).displacement
        gap, pressure = gap_and_pressure(mesh, problem, contact, u)
        gaps.append(gap)
        stretch = 1 + (GAP_MM - gap) / 2 / HEIGHT_MM
        assert pressure == pytest.approx(-stress_at(stretch, growth), rel=0.01)
        inside = np.abs(mesh.vertices[:, :2]).max(axis=1) < SIDE_MM / 2 - 1e-6
        inside &= np.isclose(mesh.vertices[:, 2], -GAP_MM / 2)
        assert contact.pressure(u)[inside].mean() == pytest.approx(pressure, rel=0.1)
    assert 0 < gaps[2] < gaps[1] < gaps[0] < 0.2
    # to each pressure belongs a part of the distance
    assert gaps[2] / gaps[1] == pytest.approx(0.5, abs=0.1)
    # close to that of blocks that touch
    touching = -stress_at(1 + GAP_MM / 2 / HEIGHT_MM, growth)
    assert pressure == pytest.approx(touching, rel=0.05)


def test_a_surface_that_crosses_itself_is_refused():
    mesh = two_blocks()
    shift = (mesh.vertices[:, 2:] > 0) * [0.7, 0.4, -3 * GAP_MM]
    crossing = TetrahedralMesh(mesh.vertices + shift, mesh.tets)
    with pytest.raises(MeshError, match=r"mesh\.surface_edge_mm"):
        SelfContact(Domain(COMM, crossing), boundary_faces(mesh)[0], 1000.0, 0.2)


def test_contact_begins_at_a_part_of_the_edge_length_as_it_is():
    mesh = two_blocks(gap=0.5)
    _, contact = problem_with_contact(mesh, None)
    before = contact.distance_mm
    assert before == pytest.approx(0.1 * 1.4, rel=0.15)
    contact.domain.place(1.5 * contact.domain.positions)
    contact.begin_step()
    assert contact.distance_mm == pytest.approx(1.5 * before)


@pytest.mark.parametrize("order", [1, 2])
def test_a_compressed_surface_does_not_repel_itself(order):
    # edges across are ten times as long as those along the box: a share of the mean
    # edge is longer than the latter
    mesh = box_mesh((24, 3, 2), (1.5, 2.0, 2.0))
    mesh = mesh if order == 1 else quadratic(mesh)
    facets, _ = boundary_faces(mesh)
    contact = SelfContact(Domain(COMM, mesh), facets, 1000.0)
    assert contact.pair_count(np.zeros((len(contact.domain.vertex_of_node), 3))) == 0


def test_no_pair_is_missed_where_the_distance_has_grown():
    mesh = two_blocks()
    problem, contact = problem_with_contact(mesh, distance=0.15)
    rest = problem.rest()
    few = contact.pair_count(rest)
    contact._given_mm = 0.5
    contact.begin_step()
    _, wider = problem_with_contact(mesh, distance=0.5)
    assert contact.pair_count(rest) == wider.pair_count(rest) > few
    assert contact.forces(rest) == pytest.approx(wider.forces(rest), rel=1e-12)


@pytest.mark.slow
def test_large_random_steps_of_a_groove_cross_nothing():
    # unlike balls, the walls of a groove face each other, and a step that is not cut
    # does cross them
    mesh = slab_with_a_sulcus()
    facets, _ = boundary_faces(mesh)
    domain = Domain(COMM, mesh)
    displacement = np.zeros((len(domain.vertex_of_node), 3))
    contact = SelfContact(domain, facets, 1000.0, 0.1)
    used, numbers = np.unique(facets, return_inverse=True)
    faces = numbers.reshape(-1, 3).astype(np.int32)
    surface = ipctk.CollisionMesh(mesh.vertices[used], ipctk.edges(faces), faces)

    def crosses(displacement_m):
        places = mesh.vertices + displacement_m * MM_PER_M
        return ipctk.has_intersections(surface, np.asfortranarray(places[used]))

    random, cut, would_cross = np.random.default_rng(6), 0, 0
    for _ in range(300 // COMM.size**2):
        direction = random.normal(0.0, 0.05, mesh.vertices.shape) * M_PER_MM
        direction[:, 0] -= np.sign(mesh.vertices[:, 0]) * 0.3 * M_PER_MM
        length = contact.max_step(displacement, domain.local(direction))
        would_cross += crosses(gathered(domain, displacement) + direction)
        cut += length < 1
        displacement = displacement + length * domain.local(direction)
        assert not crosses(gathered(domain, displacement))
        if contact.smallest_distance_mm(displacement) < 1e-3:
            displacement = np.zeros_like(displacement)
    assert min(cut, would_cross) > 10
