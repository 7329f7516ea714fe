"""Growth towards known shapes and by curves of sizes: they are met, and a run that was
stopped meets them as well."""

import math

import numpy as np
import pytest
from boxes import COMM, box_with_a_bowed_side
from contact_bodies import after_steps, at_start, problem_with_contact, two_blocks
from ellipsoid import FREE_BODY, FREE_RUN
from shapes import box_mesh, rigid

from gyriflow.folding.growth import GrowthInputs
from gyriflow.folding.simulation import advance
from gyriflow.folding.step_fields import _von_mises
from gyriflow.folding.stretches import (
    deformation_gradients,
    log_stretch,
)
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.alignment import align_points, rigid_fit
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.straightening import straightness
from gyriflow.geometry.tetrahedra import linear_pieces, quadratic, volumes_between
from gyriflow.settings.folding import parameters_from
from gyriflow.units import CM2_PER_MM2, M_PER_MM, ML_PER_MM3, MM_PER_M

DAY_S = 86_400.0


def bent(week):
    """Return the target of the body's vertices after some weeks: larger, and bent
    smoothly."""
    x, y, z = FREE_BODY.vertices.T
    wave = np.stack(
        [1.2 * np.sin(y / 12), 0.8 * np.cos(z / 10), 1.0 * np.sin(x / 14)], axis=1
    )
    return 1.04**week * FREE_BODY.vertices + week * wave


def towards(targets, mesh=FREE_BODY, **changes):
    """Return a free body with target shapes by week, and its state at the start."""
    uniform = {"shear_modulus_cortex_pa": 300.0, "shear_modulus_core_pa": 300.0}
    sizes = {"area_cm2": {21.0: 1.0, 23.0: 1.0}, "volume_ml": {21.0: 1.0, 23.0: 1.0}}
    names = {week: f"target_{week:05.2f}" for week in targets}
    growth = {"model": "shapes"} | sizes
    settings = uniform | {"growth": growth, "targets": names} | changes
    parameters = parameters_from(FREE_RUN | settings)
    maps = {
        f"{names[week]}_{axis}": places
        for week, at in targets.items()
        for axis, places in zip("xyz", at.T, strict=True)
    }
    return at_start(mesh, zones_of_run(mesh, parameters), parameters, maps=maps)


def volume(vertices, mesh=FREE_BODY):
    return volumes_between(vertices, linear_pieces(mesh)).sum()


def misfit(state, target):
    """Return the root mean square distance in mm to a target, without rigid motion."""
    now = state.positions * MM_PER_M
    sizes = vertex_sizes(now, linear_pieces(FREE_BODY))
    left = align_points(target, now, sizes) - now
    return float(np.sqrt(np.average((left**2).sum(axis=1), weights=sizes)))


def test_shapes_a_week_apart_are_met_in_any_pose():
    targets = {22.0: bent(1), 23.0: bent(2)}
    folding, start = towards(targets)
    first = after_steps(folding, start, 7)
    assert misfit(start, targets[22.0]) > 0.9
    assert misfit(first, targets[22.0]) < 0.05
    last = after_steps(folding, first, 7)
    assert misfit(last, targets[23.0]) < 0.05
    # the distance to the path at the start of each step is reported
    misfits = [row["to_path_mm"] for row in last.rows]
    assert misfits[0] < 1e-9
    assert misfits[7] == pytest.approx(misfit(first, targets[22.0]), rel=1e-6)
    assert (COMM.bcast(last.positions) == last.positions).all()

    # the sum of growth is that of the target: 4 % in each direction, and the bend
    sizes = volumes_between(FREE_BODY.vertices, FREE_BODY.tets)
    grown = np.linalg.det(first.growth) @ sizes
    assert grown == pytest.approx(volume(targets[22.0]), rel=1e-3)
    assert first.growth_s == 7 * DAY_S

    motion = rigid(20, -35, 50, shift=(8.0, -3.0, 5.0))
    turned = {week: transform_points(at, motion) for week, at in targets.items()}
    again = after_steps(towards(turned)[0], start, 2)
    expected = after_steps(folding, start, 2).positions
    assert again.positions == pytest.approx(expected, abs=1e-3 * M_PER_MM)


def waves(vertices, week):
    """Return vertices after some weeks: 4 % larger each, with waves of 30 to 45 mm."""
    x, y, z = vertices.T
    wave = np.stack([np.sin(y / 5), np.cos(z / 6), np.sin(x / 7)], axis=1)
    return 1.04**week * vertices + 0.3 * week * wave


def sound(cells, order=1):
    """Return a box of 30 mm of sound elements, centred, with so many nodes along an
    edge."""
    mesh = box_mesh((cells // order,) * 3, (30.0, 30.0, 30.0))
    return quadratic(mesh) if order == 2 else mesh


@pytest.mark.one_rank
@pytest.mark.parametrize("order", [1, 2])
def test_a_run_along_a_compatible_path_arrives_without_stress_on_any_mesh(order):
    for cells in (4, 6):
        mesh = sound(cells, order)
        targets = {21 + age: waves(mesh.vertices, age) for age in (0.5, 1.0, 1.5, 2.0)}
        target = targets[23.0]
        folding, start = towards(targets, mesh=mesh)
        state = after_steps(folding, start, 14)
        places = state.positions * MM_PER_M
        sizes = vertex_sizes(mesh.vertices, linear_pieces(mesh))
        # in quadratic elements the sums of growth and nodes differ by what the elements
        # do not resolve
        assert np.abs(align_points(target, places, sizes) - places).max() < 1e-3
        stress = folding.problem.evaluate("stress", folding.solved.displacement)
        median_pa = np.median(_von_mises(stress.reshape(-1, 3, 3)))
        assert median_pa < 1e-4 * folding.parameters.shear_modulus_core_pa
        # the growth of elements is the stretch of the whole way, but for axes that turn
        # in a step
        end = transform_points(target, rigid_fit(target, places, sizes))
        points = folding.problem.points
        F = deformation_gradients(mesh.vertices, end, mesh.tets, points.gradients)
        mean = np.einsum("q,cqij->cij", points.weights, F)
        exact = log_stretch(mean, left=True)
        found = log_stretch(state.growth, left=True)
        assert np.linalg.norm(found - exact) < 0.01 * np.linalg.norm(exact)


@pytest.mark.one_rank
@pytest.mark.parametrize("order", [1, 2])
def test_elements_that_a_target_inverts_do_not_grow_and_the_run_goes_on(order):
    mesh = sound(6, order)
    # a node near the centre moves out of its elements
    target = 1.05 * mesh.vertices
    centre = np.argmin(np.linalg.norm(mesh.vertices, axis=1))
    target[centre, 0] += 3.5 if order == 2 else 7.0
    folding, state = towards({21.5: target, 23.0: target}, mesh=mesh)
    while state.time_s < 4 * DAY_S * (1 - 1e-9):
        state = advance(folding, state, 4 * DAY_S)
    assert 0 < max(row["held_elements"] for row in state.rows) < 0.2 * len(mesh.tets)
    assert min(row["min_J"] for row in state.rows) > 0
    grown = volume(state.positions * MM_PER_M, mesh) / volume(mesh.vertices, mesh)
    assert grown == pytest.approx(1.05**3, rel=0.01)


@pytest.mark.one_rank
def test_sides_of_elements_that_follow_a_path_are_not_straightened():
    """Growth is recorded by element, so tissue stays in its element."""
    mesh, _ = box_with_a_bowed_side()
    folding, start = towards({23.0: 1.02 * mesh.vertices}, mesh=mesh)
    after = folding.step(start, DAY_S)
    moved_by_solver = start.positions + after.last
    np.testing.assert_array_equal(after.positions, moved_by_solver)
    assert straightness(after.positions, mesh.tets).min() < 0.4


def test_a_displacement_that_is_far_too_long_for_contact_is_shortened():
    mesh = two_blocks()
    problem, contact = problem_with_contact(mesh, 0.1)
    approach = problem.domain.local(problem.domain.positions).copy()
    approach[:, :2], approach[:, 2] = 0.0, np.sign(approach[:, 2])
    for way_mm, part in ((100.0, 0.08), (4.0, 1.0)):
        found = contact.max_step(problem.rest(), approach * way_mm * M_PER_MM)
        assert found == pytest.approx(part, rel=1e-6)


def test_area_and_volume_meet_their_curves_at_the_end_of_each_week():
    zones = zones_of_run(FREE_BODY, parameters_from(FREE_RUN))
    start = GrowthInputs(FREE_BODY, zones, {}).size(FREE_BODY.vertices)
    area_cm2, volume_ml = start.area_mm2 * CM2_PER_MM2, start.volume_mm3 * ML_PER_MM3
    growth = {
        "model": "sizes",
        "area_cm2": {21.0: area_cm2, 23.0: area_cm2 * math.exp(0.2)},
        "volume_ml": {21.0: volume_ml, 23.0: volume_ml * math.exp(0.29)},
    }
    parameters = parameters_from(FREE_RUN | {"growth": growth})
    folding, state = at_start(FREE_BODY, zones, parameters)
    state = after_steps(folding, state, 14)
    for row in (state.rows[6], state.rows[13]):
        assert row["area_cm2"] == pytest.approx(row["area_aim_cm2"], rel=5e-3)
        assert row["volume_ml"] == pytest.approx(row["volume_aim_ml"], rel=1e-3)
    found = folding.inputs.size(state.positions * MM_PER_M)
    assert row["area_cm2"] == pytest.approx(found.area_mm2 * CM2_PER_MM2, rel=1e-12)
    # the aim is the curve itself
    assert row["area_aim_cm2"] == pytest.approx(area_cm2 * math.exp(0.2), rel=1e-9)
