"""Growth of a step towards shapes: what the path gives, and what feedback makes up for."""

import numpy as np
import pytest
from shapes import box_mesh, ellipsoid_mesh
from verification_cases.growth_maps import WavyBox, errors_of_map

from gyriflow.folding.growth import GrowthInputs, StepStart
from gyriflow.folding.targets import FEEDBACK_FROM_MM, FEEDBACK_GW, FEEDBACK_SMOOTHING_MM, growth_on_path
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.alignment import without_rigid_motion
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.paths import path_through
from gyriflow.settings.folding import parameters_from

DAY_S, DAY_GW = 86_400.0, 1 / 7
BODY = ellipsoid_mesh(8, (20.0, 24.0, 18.0))
RUN = {
    "start_week": 21.0, "end_week": 23.0, "output_weeks": [21.0, 23.0], "fissure_x_mm": 0.0, "step_s": DAY_S,
    "support": "free", "no_growth": {"kind": "none"}, "contact": {"kind": "none"}, "thickness_mm": 4.0,
    "growth": {"model": "shapes", "area_cm2": {21.0: 1.0, 23.0: 1.0}, "volume_ml": {21.0: 1.0, 23.0: 1.0}},
    "targets": {23.0: "target"},
}  # fmt: skip


def misfits_after_steps(mesh, misfit, steps):
    """Return the misfits (n, 3) before and after steps in which a body on a growing path takes all of its growth.

    The body grows by 4 % a week; `misfit` (n, 3) in mm is where it is off its path at the start.
    """
    p = parameters_from(RUN)
    inputs = GrowthInputs(mesh, zones_of_run(mesh, p), {})
    path = path_through([21.0, 23.0], [mesh.vertices, 1.04**2 * mesh.vertices], mesh)
    sizes = vertex_sizes(mesh.vertices, inputs.pieces)
    positions = mesh.vertices + misfit
    misfits = [without_rigid_motion(positions, path(21.0), sizes)]
    for number in range(steps):
        growth = growth_on_path(p, inputs, path, StepStart(positions, number * DAY_S, DAY_S))
        positions = growth.goal_mm
        misfits.append(without_rigid_motion(positions, path(21.0 + (number + 1) * DAY_GW), sizes))
    return misfits


def remaining_share(before, after):
    """Return the part of a misfit (n, 3) that remains: by projection, so that what else changed does not count."""
    return float((before * after).sum() / (before**2).sum())


@pytest.mark.parametrize("steps", [1, 3])
def test_feedback_makes_up_for_a_misfit_with_its_time_constant(steps):
    x, y, z = BODY.vertices.T
    waves = 0.4 * np.stack([np.sin(y / 8), np.cos(z / 8), np.sin(x / 8)], axis=1)
    misfits = misfits_after_steps(BODY, waves, steps)
    assert np.sqrt((misfits[0] ** 2).sum(axis=1)).max() > 0.3
    expected = np.exp(-steps * DAY_GW / FEEDBACK_GW)
    assert remaining_share(misfits[0], misfits[-1]) == pytest.approx(expected, abs=0.01)


def test_feedback_is_of_the_smooth_part_of_a_misfit():
    mesh = box_mesh((10, 10, 10), (10.0, 10.0, 10.0))
    inside = (np.abs(mesh.vertices - mesh.vertices.mean(axis=0)) < 4.5).all(axis=1)
    assert inside.sum() == 9**3
    # the shortest wave of a mesh with edges of 1 mm, 2 mm
    rough = 0.1 * np.where(inside, (-1.0) ** np.rint(mesh.vertices).sum(axis=1), 0.0)[:, None] * [1.0, 0.0, 0.0]
    before, after = misfits_after_steps(mesh, rough, 1)
    fed_back = 1 - remaining_share(before, after)
    # a step of diffusion keeps 1 / (1 + σ² k² / 2) of a wave, here of k² = 12/h² (the largest eigenvalue of the grid)
    kept = 1 / (1 + FEEDBACK_SMOOTHING_MM**2 * 12 / 2)
    assert fed_back == pytest.approx(kept * (1 - np.exp(-DAY_GW / FEEDBACK_GW)), rel=0.3)


def test_misfits_of_the_solver_are_not_made_up_for():
    direction = np.sin(BODY.vertices[:, [1, 2, 0]] / 8)
    before, after = misfits_after_steps(BODY, 0.5 * FEEDBACK_FROM_MM * direction, 1)
    assert remaining_share(before, after) == pytest.approx(1.0, abs=1e-3)


def test_a_map_of_growth_has_the_error_of_its_elements():
    coarse, fine = (errors_of_map(WavyBox(30.0, 30.0, nodes)) for nodes in (8, 16))
    for name in ("tensor", "area"):
        assert fine[name] < 0.6 * coarse[name]
        assert fine[name] < 2.5 / fine["per_wave"]
    assert coarse["slope"] < fine["slope"] < 1.01
