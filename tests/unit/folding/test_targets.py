"""Growth of a step towards shapes: what the path gives, and what feedback makes up
for."""

from types import SimpleNamespace

import numpy as np
import pytest
from ellipsoid import FREE_BODY, FREE_RUN
from facts import Facts
from verification_cases.growth_maps import WavyBox, errors_of_map

from gyriflow.errors import InputError
from gyriflow.folding.growth import GrowthInputs, StepStart
from gyriflow.folding.targets import (
    FEEDBACK_GW,
    TargetGrowth,
    growth_on_path,
    missed_targets,
    path_of_run,
    shrinkage_note,
)
from gyriflow.folding.tissue import Elements
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.alignment import align_points
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.jacobians import SLOPES
from gyriflow.geometry.paths import path_through
from gyriflow.settings.folding import parameters_from

DAY_S, DAY_GW = 86_400.0, 1 / 7
RUN = FREE_RUN | {
    "growth": {
        "model": "shapes",
        "area_cm2": {21.0: 1.0, 23.0: 1.0},
        "volume_ml": {21.0: 1.0, 23.0: 1.0},
    },
    "targets": {23.0: "target"},
}


def misfits_after_steps(mesh, misfit, steps):
    """Return the misfits (n, 3) before and after steps in which a body on a growing
    path takes all of its growth.

    The body grows by 4 % a week; `misfit` (n, 3) in mm is where it is off its path at
    the start.
    """
    p = parameters_from(RUN)
    inputs = GrowthInputs(mesh, zones_of_run(mesh, p), {})
    path = path_through([21.0, 23.0], [mesh.vertices, 1.04**2 * mesh.vertices], mesh)
    sizes = vertex_sizes(mesh.vertices, inputs.pieces)
    positions = mesh.vertices + misfit

    def misfit_at(week):
        return align_points(path(week), positions, sizes) - positions

    misfits = [misfit_at(21.0)]
    for number in range(steps):
        start = StepStart(positions, number * DAY_S, DAY_S)
        positions = growth_on_path(p, inputs, path, start).goal_mm
        misfits.append(misfit_at(21.0 + (number + 1) * DAY_GW))
    return misfits


@pytest.mark.parametrize("steps", [1, 3])
def test_feedback_makes_up_for_a_misfit_with_its_time_constant(steps):
    x, y, z = FREE_BODY.vertices.T
    waves = 0.4 * np.stack([np.sin(y / 8), np.cos(z / 8), np.sin(x / 8)], axis=1)
    before, *_, after = misfits_after_steps(FREE_BODY, waves, steps)
    assert np.linalg.norm(before, axis=1).max() > 0.3
    # by projection, so that what else changed does not count
    remaining = (before * after).sum() / (before**2).sum()
    expected = np.exp(-steps * DAY_GW / FEEDBACK_GW)
    assert remaining == pytest.approx(expected, abs=0.01)


def test_a_map_of_growth_has_the_error_of_its_elements():
    coarse, fine = (errors_of_map(WavyBox(30.0, 30.0, nodes)) for nodes in (8, 16))
    for name in ("tensor", "area"):
        assert fine[name] < 0.6 * coarse[name]
        assert fine[name] < 2.5 / fine["per_wave"]
    assert coarse["slope"] < fine["slope"] < 1.01


def test_an_element_at_most_doubles_in_a_step_and_never_grows_to_an_inverted_goal():
    p = parameters_from(RUN)
    tets = np.arange(12).reshape(3, 4)
    single = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    goals = np.concatenate(
        [single * [1.5, 1.0, 1.0], single * [3.0, 1.0, 1.0], single * [1.0, 1.0, -1.2]]
    )
    start = StepStart(np.concatenate([single] * 3), 0.0, DAY_S)
    counted = []
    growth = TargetGrowth(
        p, start, goals, 0.0, lambda count: counted.append(count) or count
    )
    points = SimpleNamespace(order=1, gradients=SLOPES[None])
    elements = Elements(tets, np.arange(12), points)
    tissue = SimpleNamespace(
        elements=elements,
        growing=np.ones(12),
        at_points=lambda values: values[tets[:, :1]],
    )
    inverse = growth.inverse(tissue)[:, 0]
    for found, stretch in zip(inverse, (1.5, np.exp(0.7), 1.0), strict=True):
        assert found == pytest.approx(np.diag([1 / stretch, 1.0, 1.0]))
    assert (growth.shrinking, growth.held, counted) == ([0], [2], [0, 2])
    fixed = np.arange(36).reshape(12, 3) % 5 == 0
    guess = growth.guess(fixed)
    assert (guess[fixed] == 0).all()
    assert guess[~fixed] == pytest.approx((goals - start.positions_mm)[~fixed] / 1000)


def test_a_run_off_its_path_tells_how_far_and_how_many_elements_were_held_in_any_step():
    row = {"week": 23.0, "to_path_mm": 0.15, "held_elements": 0}
    for rows in ([row], [], [{"week": 22.0}]):
        assert missed_targets(rows) == []
    assert missed_targets([row | {"to_path_mm": 0.25}]) == [Facts("GW 23", "0.25 mm")]
    assert missed_targets([row | {"held_elements": 7}, row]) == [Facts("GW 23", 7)]
    shrinking, growing = (
        {"shrinking_elements": count, "min_J": ratio}
        for count, ratio in ((3, 0.4), (0, 0.9))
    )
    assert shrinkage_note([shrinking, growing]) == Facts(3, "10%", "0.40")
    assert shrinkage_note([growing]) == ""


def test_shapes_of_a_run_are_those_after_its_start_and_reach_to_its_end():
    x, y, z = 1.1 * FREE_BODY.vertices.T
    shape = {"target_x": x, "target_y": y, "target_z": z}
    p = parameters_from(RUN | {"targets": {21.0: "earlier", 23.0: "target"}})
    inputs = GrowthInputs(FREE_BODY, zones_of_run(FREE_BODY, p), shape)
    path = path_of_run(p, inputs)
    assert list(path.weeks) == [21.0, 23.0]
    assert path(23.0) == pytest.approx(1.1 * FREE_BODY.vertices, abs=1e-6)
    short = parameters_from(RUN | {"targets": {22.9: "target"}})
    with pytest.raises(InputError, check=Facts("22.9 GW", "23 GW")):
        path_of_run(short, inputs)
