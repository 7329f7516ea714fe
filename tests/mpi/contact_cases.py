"""Contact of the surface with itself: forces, pressed blocks, large steps, a closing sulcus, mirrored hemispheres."""

import sys
from pathlib import Path

import igl.predicates
import ipctk
import numpy as np
import pytest
from boxes import COMM, MATERIAL, everywhere_known, smooth_displacement
from mpi4py import MPI
from scipy.optimize import brentq
from shapes import box_mesh, ellipsoid_mesh

from gyriflow.errors import MeshError
from gyriflow.folding.checkpoint import State
from gyriflow.folding.contact import ContactSettings, SelfContact
from gyriflow.folding.domain import Domain
from gyriflow.folding.newton import NewtonSettings, NewtonSolver
from gyriflow.folding.problem import Problem
from gyriflow.folding.simulation import Folding
from gyriflow.folding.zones import Zones, zones_of_run
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces, grid
from gyriflow.parameters.reading import parameters_from
from gyriflow.parameters.terms import CLAMPED, FREE, SIDE_X, SIDE_Y
from gyriflow.units import M_PER_MM, MM_PER_M, SECONDS_PER_GW

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from verification_cases.mirrored import folded, hemisphere

HEIGHT_MM, SIDE_MM, GAP_MM = 4.0, 6.0, 0.2
MU, NU = 1000.0, MATERIAL.poisson_ratio
GROWTH = 2e-7


def two_blocks(cells=(5, 5, 3), other=(5, 5, 3), gap=GAP_MM):
    """Returns two boxes, one above the other, a gap apart."""
    low, high = (box_mesh(n, (SIDE_MM, SIDE_MM, HEIGHT_MM)) for n in (cells, other))
    shift = np.array([0.0, 0.0, (HEIGHT_MM + gap) / 2])
    vertices = np.concatenate([low.vertices - shift, high.vertices + shift])
    return TetrahedralMesh(vertices, np.concatenate([low.tets, high.tets + len(low.vertices)]))


def in_a_tube(mesh):
    """Returns zones that hold the ends of two blocks and let their sides slide."""
    facets, _ = boundary_faces(mesh)
    centre = mesh.vertices[facets].mean(axis=1)
    zone = np.full(len(facets), FREE)
    zone[np.abs(centre[:, 0]) > SIDE_MM / 2 - 1e-6] = SIDE_X
    zone[np.abs(centre[:, 1]) > SIDE_MM / 2 - 1e-6] = SIDE_Y
    zone[np.abs(centre[:, 2]) > np.abs(mesh.vertices[:, 2]).max() - 1e-6] = CLAMPED
    return Zones(facets, zone, np.ones(len(mesh.vertices)), 0.0, (-0.5, 0.5))


def problem_with_contact(mesh, zones, distance, stiffness=2 * MU, growth_along_z=0.0):
    domain = Domain(COMM, mesh)
    problem = Problem(domain, zones, MATERIAL)
    nodes, cells = len(domain.vertex_of_node), len(domain.cells)
    normal = np.tile([0.0, 0.0, 1.0], (cells, 1))
    problem.set_layers(np.full(nodes, MU), np.zeros(nodes), np.full(nodes, growth_along_z), normal)
    contact = SelfContact(domain, problem.displacement, zones.facets, ContactSettings(stiffness, distance))
    problem.contributions.append(contact)
    return problem, contact


def approach(domain):
    """Returns displacements of the local nodes in m by which two blocks close half of their gap, not evenly."""
    x = domain.local(domain.positions)
    u = smooth_displacement(domain, 1e-5)
    u[:, 2] -= np.sign(x[:, 2]) * GAP_MM / 4 * M_PER_MM
    return u


def test_forces_fit_the_energy_and_stiffness_the_forces():
    # grids that do not match: where edges are parallel, which parts are nearest changes at once
    mesh = two_blocks(other=(4, 3, 3))
    problem, contact = problem_with_contact(mesh, in_a_tube(mesh), distance=0.15)
    domain, u = problem.domain, approach(problem.domain)
    v = smooth_displacement(domain, 4e-7)[:, [2, 0, 1]].copy()
    problem.set_displacement(u)
    energy, residual, change = contact.energy(), problem.new_vector(), problem.new_vector()
    direction, other = problem.new_vector(), problem.new_vector()
    direction.array[:] = v[: domain.owned].ravel()
    residual.set(0.0)
    contact.add_residual(residual)
    contact.stiffness().mult(direction, change)
    errors = []
    for h in (0.2, 0.1):
        problem.set_displacement(u + h * v)
        first = abs(contact.energy() - energy - h * residual.dot(direction))
        other.set(0.0)
        contact.add_residual(other)
        other.axpy(-1.0, residual)
        other.axpy(-h, change)
        errors.append((first, other.norm()))
    assert energy > 0
    assert np.log2(np.array(errors[0]) / errors[1]) == pytest.approx([2.0, 2.0], abs=0.15)


def test_forces_have_no_sum_and_no_moment():
    mesh = two_blocks()
    problem, contact = problem_with_contact(mesh, in_a_tube(mesh), distance=0.15)
    problem.set_displacement(approach(problem.domain))
    forces = contact.forces()
    places = (problem.domain.positions + everywhere_known(problem))[np.unique(boundary_faces(mesh)[0])]
    size = np.abs(forces).sum()
    assert size > 0
    assert np.abs(forces.sum(axis=0)).max() <= 1e-12 * size
    assert np.abs(np.cross(places, forces).sum(axis=0)).max() <= 1e-12 * size * np.abs(places).max()


def test_the_preconditioner_sees_contact_and_the_forms_of_the_tangent_agree():
    mesh = two_blocks()
    problem, contact = problem_with_contact(mesh, in_a_tube(mesh), distance=0.15)
    for part in (1.0, 0.9):  # the second time into the same places
        problem.set_displacement(part * approach(problem.domain))
        tangent = problem.tangent()
        x, one, other, bound = (problem.new_vector() for _ in range(4))
        x.array[:] = smooth_displacement(problem.domain, 1.0)[: problem.domain.owned].ravel()
        tangent.products.mult(x, one)
        tangent.whole().mult(x, other)
        tangent.smoothing.mult(x, bound)
        other.axpy(-1.0, one)
        assert other.norm() <= 1e-12 * one.norm()
        assert contact.pair_count() > 0
        assert bound.dot(x) >= one.dot(x)


def stress_at(stretch, growth):
    """Returns the first Piola-Kirchhoff stress in Pa along z of uniaxial strain after growth along z."""
    K = 2 * MU * (1 + NU) / (3 * (1 - 2 * NU))
    Fe = stretch / (1 + growth)
    by_Fe = MU / 2 * (2 * Fe ** (1 / 3) - 2 / 3 * (2 + Fe**2) * Fe ** (-5 / 3)) + K * (Fe - 1)
    return by_Fe / (1 + growth)


@pytest.mark.parametrize("other", [(5, 5, 3), (4, 3, 3)])
def test_pressed_blocks_have_the_pressure_of_the_closed_answer_and_their_gap_closes_with_the_distance(other):
    growth, gaps = 0.2, []
    mesh = two_blocks(other=other)
    zones = in_a_tube(mesh)
    for distance in (0.2, 0.1, 0.05):
        problem, contact = problem_with_contact(mesh, zones, distance, growth_along_z=growth)
        solver = NewtonSolver(problem, NewtonSettings(1e-9, 1e-6, max_newton=60), residual_floor=0.0)
        solver.solve(np.zeros_like(problem.displacement))
        place = mesh.vertices + everywhere_known(problem) * MM_PER_M
        on_top = np.isclose(mesh.vertices[:, 2], -GAP_MM / 2)
        below = np.isclose(mesh.vertices[:, 2], GAP_MM / 2)
        gaps.append(place[below, 2].mean() - place[on_top, 2].mean())
        forces = np.zeros_like(place)
        forces[np.unique(zones.facets)] = contact.forces()
        pressure = forces[on_top, 2].sum() / (SIDE_MM * M_PER_MM) ** 2
        stretch = 1 + (GAP_MM - gaps[-1]) / 2 / HEIGHT_MM
        assert pressure == pytest.approx(-stress_at(stretch, growth), rel=0.01)
        inside = on_top & (np.abs(mesh.vertices[:, :2]).max(axis=1) < SIDE_MM / 2 - 1e-6)
        assert contact.pressure()[inside].mean() == pytest.approx(pressure, rel=0.1)
    assert 0 < gaps[2] < gaps[1] < gaps[0] < 0.2
    # to each pressure belongs a part of the distance
    assert gaps[2] / gaps[1] == pytest.approx(0.5, abs=0.1)
    # close to that of blocks that touch
    assert pressure == pytest.approx(-stress_at(1 + GAP_MM / 2 / HEIGHT_MM, growth), rel=0.05)
    assert brentq(lambda stretch: stress_at(stretch, growth), 0.9, 1.4) == pytest.approx(1 + growth)


def test_the_energy_falls_in_every_step_of_newtons_method(monkeypatch):
    mesh = two_blocks(other=(4, 3, 3))
    problem, _ = problem_with_contact(mesh, in_a_tube(mesh), 0.1, growth_along_z=0.1)
    solver = NewtonSolver(problem, NewtonSettings(1e-8, 1e-6, max_newton=60), residual_floor=0.0)
    advance, energies = solver._advance, []

    def recorded(iterate, **known):
        energies.append(problem.energy())
        reached = advance(iterate, **known)
        energies.append(problem.energy())
        return reached

    monkeypatch.setattr(solver, "_advance", recorded)
    solver.solve(np.zeros_like(problem.displacement))
    assert len(energies) > 8
    assert (np.diff(energies) <= 1e-12 * max(energies)).all()


def two_balls():
    ball = ellipsoid_mesh(2, (4.0, 4.0, 4.0))
    vertices = np.concatenate([ball.vertices - [4.1, 0.0, 0.0], ball.vertices + [4.1, 0.0, 0.0]])
    return TetrahedralMesh(vertices, np.concatenate([ball.tets, ball.tets + len(ball.vertices)]))


def test_ten_thousand_large_random_steps_cross_nothing():
    mesh = two_balls()
    facets, _ = boundary_faces(mesh)
    domain = Domain(COMM, mesh)
    displacement = np.zeros((len(domain.vertex_of_node), 3))
    contact = SelfContact(domain, displacement, facets, ContactSettings(1000.0, 0.2))
    random = np.random.default_rng(5)
    surface = ipctk.CollisionMesh(mesh.vertices, ipctk.edges(facets.astype(np.int32)), facets.astype(np.int32))
    cut = 0
    for _ in range(10_000 // COMM.size**2):
        # each vertex by millimetres, the balls towards each other
        direction = random.normal(0.0, 1.0, mesh.vertices.shape) * M_PER_MM
        direction[:, 0] -= np.sign(mesh.vertices[:, 0]) * 0.5 * M_PER_MM
        length = contact.largest_step(domain.local(direction))
        cut += length < 1
        displacement += length * domain.local(direction)
        place = mesh.vertices + domain.gathered(displacement[: domain.owned]) * MM_PER_M
        assert not ipctk.has_intersections(surface, np.asfortranarray(place))
        # no force drives apart here what has come near
        if contact.smallest_distance_mm() < 1e-3:
            displacement[:] = 0.0
    assert cut > 100


def test_a_surface_that_crosses_itself_is_refused():
    mesh = two_balls()
    mesh = TetrahedralMesh(mesh.vertices - np.sign(mesh.vertices[:, :1]) * [0.6, 0.0, 0.0], mesh.tets)
    facets, _ = boundary_faces(mesh)
    with pytest.raises(MeshError, match="crosses itself"):
        SelfContact(Domain(COMM, mesh), np.zeros((1, 3)), facets, ContactSettings(1000.0, 0.2))


def slab_with_a_sulcus():
    """Returns a block with a narrow groove along y in its top, in mm."""
    mesh = grid([np.linspace(-6.0, 6.0, 25), np.linspace(-1.5, 1.5, 4), np.linspace(0.0, 6.0, 11)])
    x, y, z = mesh.vertices.T
    groove = 3.0 * np.exp(-((x / 0.5) ** 2))
    # even in y but for a trace, so that nothing meets exactly
    lift = 1 - groove / 6.0 + 1e-3 * np.sin(1.3 * y + x)
    return TetrahedralMesh(np.stack([x, y, z * lift], axis=1), mesh.tets)


def closing_sulcus(kind, comm=COMM, **changes):
    """Returns what folds a block with a groove that closes in some steps, and the state at the start."""
    mesh = slab_with_a_sulcus()
    p = parameters_from(
        {
            "start_week": 21.0,
            "end_week": 30.0,
            "output_weeks": [21.0, 30.0],
            "fissure_x_mm": 0.0,
            "thickness_mm": 2.0,
            "growth_rate_per_s": 1e-6,
            "support": "box",
            "contact": {"kind": kind},
            "no_growth": {"kind": "none"},
        }
        | changes
    )
    return Folding(comm, mesh, zones_of_run(mesh, p), p), State.at_start(mesh.vertices * M_PER_MM, p.step_s)


def after_steps(folding, state, number):
    for _ in range(number):
        state = folding.step(state, state.step_s)
    return state


def closed_sulcus(kind):
    folding, state = closing_sulcus(kind)
    state = after_steps(folding, state, 12)
    _, crossing, _ = igl.predicates.find_self_intersections(state.positions * MM_PER_M, folding.zones.facets)
    return state, len(crossing) > 0


def test_a_sulcus_closes_without_crossing_where_it_crosses_without_contact():
    _, crosses = closed_sulcus("none")
    assert crosses
    state, crosses = closed_sulcus("global")
    assert not crosses
    row = state.rows[-1]
    assert row["contact_pairs"] > 0
    assert 0 < row["min_distance_mm"] < 0.2
    assert min(row["min_J"] for row in state.rows) > 0
    assert (COMM.bcast(state.positions) == state.positions).all()


def test_contact_begins_at_a_part_of_the_edge_length_as_it_is():
    mesh = two_blocks(gap=0.5)
    _, contact = problem_with_contact(mesh, in_a_tube(mesh), None)
    before = contact.distance_mm
    assert before == pytest.approx(0.2 * 1.4, rel=0.15)
    contact.domain.place(1.5 * contact.domain.positions)
    contact.mesh_moved()
    assert contact.distance_mm == pytest.approx(1.5 * before)


def test_no_pair_is_missed_where_the_distance_has_grown():
    mesh = two_blocks()
    zones = in_a_tube(mesh)
    _, contact = problem_with_contact(mesh, zones, distance=0.15)
    few = contact.pair_count()
    contact.settings = ContactSettings(2 * MU, 0.5)
    contact.mesh_moved()
    _, other = problem_with_contact(mesh, zones, distance=0.5)
    assert contact.pair_count() == other.pair_count() > few
    assert contact.forces() == pytest.approx(other.forces(), rel=1e-12)


def test_a_run_goes_on_in_the_middle_of_contact_as_if_it_had_not_stopped():
    tight = {"solver": {"newton_tolerance": 1e-11, "krylov_tolerance": 1e-8}}
    folding, state = closing_sulcus("global", **tight)
    middle = after_steps(folding, state, 9)
    assert middle.rows[-1]["contact_pairs"] > 0
    ended = after_steps(folding, middle, 2)
    anew = after_steps(closing_sulcus("global", **tight)[0], middle, 2)
    moved = np.abs(ended.positions - middle.positions).max()
    assert np.abs(anew.positions - ended.positions).max() <= 1e-8 * moved


def test_hemispheres_that_press_on_each_other_stay_mirror_images():
    changes = {"contact": {"kind": "global", "gap_mm": 1.9, "distance_mm": 0.4}}
    # growth as it is there: pressed harder, vertices that meet exactly would rather slide aside
    state, found = folded(hemisphere(6), 5, COMM, core_growth_rate_per_s=2e-7, **changes)
    assert state.rows[-1]["contact_pairs"] > 0
    assert found.relative <= 1e-8


def free_blocks(gap, **changes):
    """Returns what folds two free blocks whose meshes match across a gap, and the state at the start."""
    mesh = two_blocks(gap=gap)
    facets, _ = boundary_faces(mesh)
    zones = Zones(facets, np.full(len(facets), FREE), np.ones(len(mesh.vertices)), 0.0, (-0.5, 0.5), free=True)
    values = {"start_week": 21.0, "end_week": 30.0, "output_weeks": [21.0, 30.0], "fissure_x_mm": 0.0}
    p = parameters_from(values | {"support": "free", "no_growth": {"kind": "none"}} | changes)
    return Folding(COMM, mesh, zones, p), State.at_start(mesh.vertices * M_PER_MM, p.step_s)


@pytest.mark.parametrize("support", ["free", "box"])
def test_blocks_near_each_other_that_do_not_grow_do_not_move(support):
    # the gap is a third of the distance that contact would begin at with this mesh
    folding, state = free_blocks(0.1, growth_rate_per_s=0.0)
    if support == "box":
        mesh = two_blocks(gap=0.1)
        folding = Folding(COMM, mesh, in_a_tube(mesh), folding.parameters)
    assert folding.contact.distance_mm < 0.1
    after = folding.step(state, state.step_s)
    assert (after.positions == state.positions).all()
    assert after.rows[-1]["newton"] == 0


def test_parts_that_touch_move_as_one():
    # one part grows towards the other, which has to give way: only the whole has no motion of its own
    folding, state = free_blocks(0.1, growth_rate_per_s=1e-6, core_growth_rate_per_s=1e-6, contact={"distance_mm": 0.2})
    domain = folding.domain
    low = domain.part == domain.part[np.argmin(state.positions[:, 2])]
    folding._growth = domain.local(low.astype(float))
    after = folding.step(state, state.step_s)
    u = after.last
    assert np.abs(u.mean(axis=0)).max() <= 1e-12 * np.abs(u).max()
    # by parts, the one that does not grow would keep its place
    assert u[~low, 2].mean() > 0.1 * np.abs(u).max()
    assert after.rows[-1]["contact_pairs"] > 0


def test_parts_that_do_not_touch_keep_their_own_places():
    folding, state = free_blocks(2.0, growth_rate_per_s=1e-6)
    domain = folding.domain
    folding._growth = domain.local((state.positions[:, 2] < 0).astype(float))
    u = folding.step(state, state.step_s).last
    for part in (0, 1):
        assert np.abs(u[domain.part == part].mean(axis=0)).max() <= 1e-9 * np.abs(u).max()


def pressed(step_s, days=4, **changes):
    """Returns what has folded two blocks that grow evenly against each other in a tube, and the last state."""
    mesh = two_blocks(other=(4, 3, 3))
    values = {"start_week": 21.0, "end_week": 30.0, "output_weeks": [21.0, 30.0], "fissure_x_mm": 0.0}
    values |= {"no_growth": {"kind": "none"}, "support": "box", "step_s": step_s, "fields": ["stress", "strain"]}
    folding = Folding(COMM, mesh, in_a_tube(mesh), parameters_from(values | changes))
    state, problem = State.at_start(mesh.vertices * M_PER_MM, step_s), folding.problem
    honest, ones = folding.set_layers, np.ones(len(folding.domain.vertex_of_node))

    def evenly(time_s, step_s):
        honest(time_s, step_s)
        normals = np.tile([0.0, 0.0, 1.0], (len(folding.domain.cells), 1))
        problem.set_layers(MU * ones, GROWTH * step_s * ones, GROWTH * step_s * ones, normals)

    folding.set_layers = evenly
    for _ in range(round(days * 86400 / step_s)):
        state = folding.step(state, step_s)
    return folding, state


def test_stress_that_is_forgotten_is_written_as_a_rate_that_does_not_depend_on_the_step():
    rates = []
    for step_s in (86400.0, 43200.0, 21600.0):
        folding, state = pressed(step_s)
        fields = folding.element_fields(["stress", "strain"]) | folding.contact_fields(["contact_pressure"])
        at = two_blocks(other=(4, 3, 3)).vertices
        inside = np.isclose(np.abs(at[:, 2]), GAP_MM / 2) & (np.abs(at[:, :2]).max(axis=1) < SIDE_MM / 2 - 1e-6)
        contact = fields["contact_pressure_pa_per_gw"][inside].mean()
        inner = [np.median(fields[name]) for name in ("pressure_pa_per_gw", "elastic_volume_strain_per_gw")]
        rates.append([*inner, contact])
        assert state.rows[-1]["contact_pairs"] > 0
    # held all around: -ln Je = 3 γ t and p = K times that; of first order in the step
    strain = 3 * GROWTH * SECONDS_PER_GW
    bulk = 2 * MU * (1 + NU) / (3 * (1 - 2 * NU))
    errors = np.abs(np.array(rates) / [bulk * strain, -strain, bulk * strain] - 1)
    assert (errors[2] < 0.03).all()
    assert errors[1:, 2] / errors[:-1, 2] == pytest.approx([0.5, 0.5], abs=0.1)


def test_stress_that_is_remembered_is_written_as_it_is():
    pressures = []
    for step_s in (86400.0, 43200.0):
        folding, _ = pressed(step_s, stress_memory_gw=2.0)
        pressures.append(np.median(folding.element_fields(["stress"])["pressure_pa"]))
    assert pressures[0] == pytest.approx(pressures[1], rel=0.03)


@pytest.mark.parametrize("scheme", ["implicit", "adams-bashforth"])
def test_a_closing_sulcus_is_the_same_on_all_ranks_and_on_one(scheme, tmp_path_factory):
    tight = {"solver": {"newton_tolerance": 1e-11, "krylov_tolerance": 1e-8}, "time_scheme": scheme}
    state = after_steps(*closing_sulcus("global", **tight), 10)
    assert state.rows[-1]["contact_pairs"] > 0
    for alone in (COMM.rank == 0, COMM.rank == COMM.size - 1):
        if alone:
            single = after_steps(*closing_sulcus("global", comm=MPI.COMM_SELF, **tight), 10)
            moved = np.abs(single.positions - slab_with_a_sulcus().vertices * M_PER_MM).max()
            assert np.abs(single.positions - state.positions).max() <= 1e-6 * moved
            assert single.rows[-1]["contact_pairs"] == state.rows[-1]["contact_pairs"]
    COMM.barrier()


def test_large_random_steps_of_a_groove_cross_nothing():
    # unlike balls, the walls of a groove face each other, and a step that is not cut does cross them
    mesh = slab_with_a_sulcus()
    facets, _ = boundary_faces(mesh)
    domain = Domain(COMM, mesh)
    displacement = np.zeros((len(domain.vertex_of_node), 3))
    contact = SelfContact(domain, displacement, facets, ContactSettings(1000.0, 0.1))
    used = np.unique(facets)
    number = np.searchsorted(used, facets).astype(np.int32)
    surface = ipctk.CollisionMesh(mesh.vertices[used], ipctk.edges(number), number)
    random, cut, would_cross = np.random.default_rng(6), 0, 0
    for _ in range(600 // COMM.size**2):
        direction = random.normal(0.0, 0.05, mesh.vertices.shape) * M_PER_MM
        direction[:, 0] -= np.sign(mesh.vertices[:, 0]) * 0.3 * M_PER_MM
        length = contact.largest_step(domain.local(direction))
        now = mesh.vertices + domain.gathered(displacement[: domain.owned]) * MM_PER_M
        whole = now + direction * MM_PER_M
        would_cross += ipctk.has_intersections(surface, np.asfortranarray(whole[used]))
        cut += length < 1
        displacement += length * domain.local(direction)
        place = mesh.vertices + domain.gathered(displacement[: domain.owned]) * MM_PER_M
        assert not ipctk.has_intersections(surface, np.asfortranarray(place[used]))
        if contact.smallest_distance_mm() < 1e-3:
            displacement[:] = 0.0
    assert min(cut, would_cross) > 10
