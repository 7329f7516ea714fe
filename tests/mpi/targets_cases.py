"""Growth towards known shapes and by curves of sizes: they are met, and a run that was stopped meets them as well."""

import math
from dataclasses import replace

import numpy as np
import pytest
from boxes import COMM
from contact_bodies import after_steps, in_a_tube, problem_with_contact, two_blocks
from scipy.spatial.transform import Rotation
from shapes import ellipsoid_mesh, rigid

from gyriflow.folding.checkpoint import State
from gyriflow.folding.domain import Domain
from gyriflow.folding.growth import GrowthInputs
from gyriflow.folding.simulation import Folding
from gyriflow.folding.stress import unpacked
from gyriflow.folding.stretches import Stretches
from gyriflow.folding.targets import inverse_exponential, log_growth, path_through
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.alignment import rigid_fit, without_rigid_motion
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.diffusion import Share, cell_sizes, vertex_sizes
from gyriflow.geometry.tetrahedra import linear_pieces
from gyriflow.settings.folding import parameters_from
from gyriflow.units import CM2_PER_MM2, M_PER_MM, ML_PER_MM3, MM_PER_M

DAY_S = 86_400.0
BODY = ellipsoid_mesh(8, (20.0, 24.0, 18.0))
TIGHT = {"solver": {"newton_tolerance": 1e-11}}


def bent(week):
    """Return the target of the body's vertices after some weeks: larger, and bent smoothly."""
    x, y, z = BODY.vertices.T
    wave = np.stack([1.2 * np.sin(y / 12), 0.8 * np.cos(z / 10), 1.0 * np.sin(x / 14)], axis=1)
    return 1.04**week * BODY.vertices + week * wave


def towards(targets, mesh=BODY, **changes):
    """Return a free body with target shapes by week, and its state at the start."""
    weeks = {"start_week": 21.0, "end_week": 23.0, "output_weeks": [21.0, 23.0], "fissure_x_mm": 0.0}
    settings = {"support": "free", "no_growth": {"kind": "none"}, "contact": {"kind": "none"}, "thickness_mm": 4.0}
    uniform = {"shear_modulus_cortex_pa": 300.0, "shear_modulus_core_pa": 300.0, "step_s": DAY_S}
    sizes = {"area_cm2": {21.0: 1.0, 23.0: 1.0}, "volume_ml": {21.0: 1.0, 23.0: 1.0}}
    names = {week: f"target_{week:05.2f}" for week in targets}
    growth = {"model": "shapes"} | sizes
    parameters = parameters_from(weeks | settings | uniform | {"growth": growth, "targets": names} | changes)
    maps = {
        f"{names[week]}_{axis}": places
        for week, at in targets.items()
        for axis, places in zip("xyz", at.T, strict=True)
    }
    folding = Folding(COMM, mesh, zones_of_run(mesh, parameters), parameters, maps)
    return folding, State.at_start(mesh.vertices * M_PER_MM, DAY_S)


def volume(vertices):
    return cell_sizes(vertices, linear_pieces(BODY)).sum()


def misfit(state, target):
    """Return the root mean square distance in mm to a target, without rigid motion."""
    now = state.positions * MM_PER_M
    sizes = vertex_sizes(now, linear_pieces(BODY))
    left = without_rigid_motion(now, target, sizes)
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
    traces = first.log_growth[:3].sum(axis=0)
    assert np.average(traces, weights=vertex_sizes(BODY.vertices, linear_pieces(BODY))) == pytest.approx(
        np.log(volume(targets[22.0]) / volume(BODY.vertices)), rel=0.05
    )
    assert first.log_growth_s == 7 * DAY_S

    motion = rigid(20, -35, 50, shift=(8.0, -3.0, 5.0))
    turned = {week: transform_points(at, motion) for week, at in targets.items()}
    again = after_steps(towards(turned)[0], start, 2)
    np.testing.assert_allclose(again.positions, after_steps(folding, start, 2).positions, atol=1e-3 * M_PER_MM)


def test_the_path_passes_its_shapes_in_their_weeks_with_a_velocity_that_does_not_jump():
    shapes = {21.0: bent(0), 21.5: bent(0.5), 22.0: bent(1.5), 23.0: bent(2)}
    path = path_through(list(shapes), list(shapes.values()), linear_pieces(BODY))
    velocity = path.derivative()
    for week, shape in shapes.items():
        assert np.abs(without_rigid_motion(path(week), shape, np.ones(len(shape)))).max() < 1e-9
        if 21.0 < week < 23.0:
            assert velocity(week - 1e-9) == pytest.approx(velocity(week + 1e-9), abs=1e-5)
    folding, start = towards({week: shape for week, shape in shapes.items() if week > 21.0})
    state = after_steps(folding, start, 14)
    assert max(row["to_path_mm"] for row in state.rows) < 0.1
    assert misfit(state, shapes[23.0]) < 0.05


def waves(week):
    """Return the body's vertices after some weeks: 4 % larger each, with waves of 20 mm in the outer shell."""
    radius = np.linalg.norm(BODY.vertices / [20.0, 24.0, 18.0], axis=1)[:, None]
    outward = BODY.vertices / np.maximum(np.linalg.norm(BODY.vertices, axis=1), 1e-6)[:, None]
    height = 0.5 * week * np.cos(2 * np.pi * BODY.vertices[:, 1:2] / 20.0) * np.exp(-(((1 - radius) / 0.25) ** 2))
    return 1.04**week * BODY.vertices + height * outward


@pytest.mark.one_rank
def test_growth_and_stress_converge_in_the_time_step():
    found = []
    for steps in (7, 14, 28):
        folding, state = towards({22.0: waves(1), 23.0: waves(2)}, step_s=7 * DAY_S / steps, fields=["stress"])
        state = after_steps(folding, replace(state, step_s=7 * DAY_S / steps), steps)
        fields = folding.fields.elements(["stress"], folding.solved)
        found.append([state.log_growth, next(values for name, values in fields.items() if "von_mises" in name)])
    for first, second, third in zip(*found, strict=True):
        before, now = np.linalg.norm(second - first), np.linalg.norm(third - second)
        assert now < 0.05 * np.linalg.norm(third)
        assert before > 1.7 * now


@pytest.mark.one_rank
def test_a_known_growth_of_a_body_that_bends_and_twists_is_found_in_the_axes_of_the_tissue():
    mesh = ellipsoid_mesh(16, (20.0, 24.0, 18.0))
    pieces = linear_pieces(mesh)

    def grown(week):
        # along x, more where z is large
        longer = mesh.vertices * np.exp(0.08 * week * np.outer(1 + mesh.vertices[:, 2] / 72, [1.0, 0.0, 0.0]))
        angle = np.radians(3 * week) * mesh.vertices[:, 1:2] / 24
        return Rotation.from_rotvec(angle * [0.0, 1.0, 0.0]).apply(longer)

    folding, start = towards({21.5: grown(0.5), 22.0: grown(1), 22.5: grown(1.5), 23.0: grown(2)}, mesh=mesh)
    state = after_steps(folding, start, 14)
    end = transform_points(
        grown(2), rigid_fit(grown(2), state.positions * MM_PER_M, vertex_sizes(mesh.vertices, pieces))
    )
    axes, stretches, back = np.linalg.svd(element_gradients(mesh.vertices, end, pieces))
    expected = (axes * np.log(stretches)[:, None]) @ np.swapaxes(axes, 1, 2)
    result = unpacked(state.log_growth.T)[pieces].mean(axis=1)
    weights = cell_sizes(mesh.vertices, pieces)

    def norm(tensors):
        return np.sqrt(np.average((tensors**2).sum(axis=(1, 2)), weights=weights))

    assert norm(result - expected) < 0.05 * norm(expected)
    # in axes that do not turn it is another one
    turn = axes @ back
    assert norm(np.swapaxes(turn, 1, 2) @ expected @ turn - expected) > 0.05 * norm(expected)


def element_gradients(before, after, pieces):
    edges = [np.swapaxes(x[pieces[:, 1:]] - x[pieces[:, :1]], 1, 2) for x in (before, after)]
    return edges[1] @ np.linalg.inv(edges[0])


@pytest.mark.one_rank
@pytest.mark.parametrize("lengths", [[1.05, 0.98, 1.1], [1.02, 0.99, 1.04], [1.16, 1.0, 1.0]])
def test_growth_of_an_even_stretch_is_that_stretch(lengths):
    # along the diagonal, no entry of FᵀF − I is above a third of its largest eigenvalue
    along = np.random.default_rng(2).normal(size=(3, 3)) if lengths[1] < 1 else np.tri(3)
    axes = np.linalg.qr(along)[0]
    U = axes @ np.diag(lengths) @ axes.T
    turn = rigid(30, 40, 50)[:3, :3]
    stretches = Stretches(linear_pieces(BODY), len(BODY.vertices))
    logs = log_growth(BODY.vertices, stretches, BODY.vertices @ (turn @ U).T - BODY.vertices, 3.0)
    expected = axes @ np.diag(np.log(lengths)) @ axes.T
    at = ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])
    assert logs == pytest.approx(np.tile(expected[at], (len(logs), 1)), abs=1e-6)
    assert inverse_exponential(expected) == pytest.approx(np.linalg.inv(U), abs=1e-6)
    # what a rigid motion alone leaves is none
    assert log_growth(BODY.vertices, stretches, BODY.vertices @ turn.T - BODY.vertices, 3.0) == pytest.approx(
        0, abs=1e-9
    )


def test_shared_growth_is_that_of_one_rank():
    count, pieces = len(BODY.vertices), linear_pieces(BODY)
    domain = Domain(COMM, BODY)
    shares = Stretches(pieces, count), Stretches(pieces, count, Share(COMM.rank, COMM.size, domain.sum_over_ranks))
    alone, shared = (log_growth(BODY.vertices, stretches, bent(1) - BODY.vertices, 3.0) for stretches in shares)
    assert shared == pytest.approx(alone, rel=1e-12, abs=1e-12 * np.abs(alone).max())
    assert (COMM.bcast(shared) == shared).all()


def test_a_displacement_that_is_far_too_long_for_contact_is_shortened():
    mesh = two_blocks()
    problem, contact = problem_with_contact(mesh, in_a_tube(mesh), 0.1)
    approach = problem.domain.local(problem.domain.positions).copy()
    approach[:, :2], approach[:, 2] = 0.0, np.sign(approach[:, 2])
    for way_mm, part in ((100.0, 0.08), (4.0, 1.0)):
        assert contact.max_step(problem.rest(), approach * way_mm * M_PER_MM) == pytest.approx(part, rel=1e-6)


def following(growth):
    """Return a free ellipsoid that is to grow by (area, volume) per week as logarithms, and the state before."""
    mesh = ellipsoid_mesh(8, (20.0, 24.0, 18.0))
    weeks = {"start_week": 21.0, "end_week": 23.0, "output_weeks": [21.0, 23.0], "fissure_x_mm": 0.0, "step_s": DAY_S}
    weeks |= {"support": "free", "no_growth": {"kind": "none"}, "contact": {"kind": "none"}, "thickness_mm": 4.0}
    start = GrowthInputs.of(mesh, zones_of_run(mesh, parameters_from(weeks)), {}).size(mesh.vertices)
    sizes = {"area_cm2": start.area_mm2 * CM2_PER_MM2, "volume_ml": start.volume_mm3 * ML_PER_MM3}
    curves = {
        name: {21.0: size, 23.0: size * math.exp(2 * rate)}
        for (name, size), rate in zip(sizes.items(), growth, strict=True)
    }
    parameters = parameters_from(weeks | {"growth": {"model": "sizes", **curves}})
    folding = Folding(COMM, mesh, zones_of_run(mesh, parameters), parameters)
    return folding, State.at_start(mesh.vertices * M_PER_MM, DAY_S)


@pytest.mark.parametrize("growth", [(0.10, 0.145), pytest.param((0.02, 0.03), marks=pytest.mark.one_rank)])
def test_area_and_volume_meet_their_curves_at_the_end_of_each_week(growth):
    folding, state = following(growth)
    state = after_steps(folding, state, 14)
    for row in (state.rows[6], state.rows[13]):
        assert row["area_cm2"] == pytest.approx(row["area_aim_cm2"], rel=5e-3)
        assert row["volume_ml"] == pytest.approx(row["volume_aim_ml"], rel=1e-3)
    found = folding.inputs.size(state.positions * MM_PER_M)
    assert row["area_cm2"] == pytest.approx(found.area_mm2 * CM2_PER_MM2, rel=1e-12)
    # the aim is the curve itself
    start = folding.parameters.growth.area_cm2[21.0]
    assert row["area_aim_cm2"] == pytest.approx(start * math.exp(2 * growth[0]), rel=1e-9)


@pytest.mark.one_rank
def test_no_rate_is_negative_where_curves_shrink():
    row = after_steps(*following((-0.10, -0.15)), 1).rows[-1]
    assert (row["growth_rate_per_s"], row["core_growth_rate_per_s"], row["growth_limited"]) == (0.0, 0.0, 1)


def test_the_shortfall_of_a_step_is_corrected_after_a_resumption_too():
    folding, state = following((0.10, 0.15))
    middle = after_steps(folding, state, 3)
    whole = after_steps(folding, middle, 2)
    resumed = after_steps(following((0.10, 0.15))[0], middle, 2)
    assert resumed.correction == pytest.approx(whole.correction, rel=1e-6)
    assert resumed.rows[-1]["growth_rate_per_s"] == pytest.approx(whole.rows[-1]["growth_rate_per_s"], rel=1e-6)
    np.testing.assert_allclose(resumed.positions, whole.positions, atol=1e-3 * M_PER_MM)
