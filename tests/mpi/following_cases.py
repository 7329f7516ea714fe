"""Growth that follows curves of area and volume: both are met, whatever part of growth the tissue realises."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from shapes import ellipsoid_mesh

from gyriflow.folding.checkpoint import State
from gyriflow.folding.growth import GrowthInputs
from gyriflow.folding.simulation import Folding
from gyriflow.folding.steering import missed_curves
from gyriflow.folding.zones import zones_of_run
from gyriflow.parameters.folding import VENTRICLES, parameters_from
from gyriflow.units import CM2_PER_MM2, M_PER_MM, ML_PER_MM3, MM_PER_M

COMM = MPI.COMM_WORLD
AXES = (20.0, 24.0, 18.0)
DAY_S = 86_400.0


def following(growth, **changes):
    """Returns a free ellipsoid that is to grow by (area, volume) per week as logarithms, and the state before."""
    mesh = ellipsoid_mesh(8, AXES)
    known = {"start_week": 21.0, "end_week": 23.0, "output_weeks": [21.0, 23.0], "fissure_x_mm": 0.0}
    settings = {"support": "free", "no_growth": {"kind": "none"}, "contact": {"kind": "none"}, "thickness_mm": 4.0}
    plain = parameters_from(known | settings)
    start = GrowthInputs.of(mesh, zones_of_run(mesh, plain), {}).size(mesh.vertices)
    sizes = start.area_mm2 * CM2_PER_MM2, start.volume_mm3 * ML_PER_MM3
    curves = {
        name: {21.0: size, 23.0: size * math.exp(2 * rate)}
        for name, size, rate in zip(("area_cm2", "volume_ml"), sizes, growth, strict=True)
    }
    parameters = parameters_from(known | settings | {"follow": curves, "step_s": DAY_S} | changes)
    folding = Folding(COMM, mesh, zones_of_run(mesh, parameters), parameters)
    return folding, State.at_start(mesh.vertices * M_PER_MM, DAY_S)


def grown(folding, state, steps):
    for _ in range(steps):
        state = folding.step(state, DAY_S)
    return state


@pytest.mark.parametrize("growth", [(0.10, 0.15), pytest.param((0.02, 0.03), marks=pytest.mark.one_rank)])
def test_area_and_volume_meet_their_curves_after_a_week(growth):
    folding, state = following(growth)
    state = grown(folding, state, 10)
    row = state.rows[-1]
    # at every step, from the first one on
    for each in state.rows:
        assert each["area_cm2"] == pytest.approx(each["area_aim_cm2"], rel=1.5e-3)
        assert each["volume_ml"] == pytest.approx(each["volume_aim_ml"], rel=1.5e-3)
    found = folding.inputs.size(state.positions * MM_PER_M)
    assert row["area_cm2"] == pytest.approx(found.area_mm2 * CM2_PER_MM2, rel=1e-12)
    # the aim is the curve itself
    weeks = 10 / 7
    start = folding.parameters.follow.area_cm2[21.0]
    assert row["area_aim_cm2"] == pytest.approx(start * math.exp(growth[0] * weeks), rel=1e-9)


def test_a_brain_that_shrinks_is_followed_where_that_is_allowed():
    # a ball keeps its shape, so that its area goes with its volume
    folding, state = following((-0.10, -0.15), allow_negative_growth=True)
    row = grown(folding, state, 9).rows[-1]
    assert row["volume_ml"] == pytest.approx(row["volume_aim_ml"], rel=5e-3)
    assert row["core_growth_rate_per_s"] < 0
    folding, state = following((-0.10, -0.15))
    row = grown(folding, state, 1).rows[-1]
    assert (row["growth_rate_per_s"], row["core_growth_rate_per_s"], row["growth_limited"]) == (0.0, 0.0, 1)


def test_what_was_learnt_of_growth_goes_on_from_the_step_table():
    folding, state = following((0.10, 0.15))
    middle = grown(folding, state, 3)
    whole = grown(folding, middle, 2)
    again, _ = following((0.10, 0.15))
    resumed = grown(again, middle, 2)
    assert resumed.learnt == pytest.approx(whole.learnt, rel=1e-6)
    assert resumed.rows[-1]["growth_rate_per_s"] == pytest.approx(whole.rows[-1]["growth_rate_per_s"], rel=1e-6)
    np.testing.assert_allclose(resumed.positions, whole.positions, atol=1e-3 * M_PER_MM)
    # without it the rates would be others
    forgot = grown(again, replace(middle, learnt=None), 1)
    assert forgot.rows[-1]["growth_rate_per_s"] != pytest.approx(whole.rows[-2]["growth_rate_per_s"], rel=1e-3)


def test_regional_growth_is_faster_where_its_map_says():
    folding, state = following((0.10, 0.15))
    mesh_x = state.positions[:, 0]
    maps = {"regional_growth_21.00": 1.0 + 0.5 * np.sign(mesh_x)}
    values = folding.parameters.model_dump(mode="json") | {"regional_growth": {21.0: "regional_growth_21.00"}}
    local = Folding(COMM, ellipsoid_mesh(8, AXES), folding.zones, parameters_from(values), maps)
    after = grown(local, state, 3)
    stretch = [np.ptp(after.positions[side, 1]) / np.ptp(state.positions[side, 1]) for side in (mesh_x > 0, mesh_x < 0)]
    assert stretch[0] > stretch[1] + 0.01


def test_growth_goes_in_measured_directions_and_still_meets_its_curves():
    folding, state = following((0.10, 0.15))
    count = len(state.positions)
    strain = {"xx": 0.06, "yy": -0.03, "zz": -0.03, "xy": 0.0, "xz": 0.0, "yz": 0.0}
    maps = {f"strain_{part}": np.full(count, value) for part, value in strain.items()}
    values = folding.parameters.model_dump(mode="json") | {"regional_strain": {21.0: "strain"}}
    values |= {"shear_modulus_cortex_pa": 300.0}
    local = Folding(COMM, ellipsoid_mesh(8, AXES), folding.zones, parameters_from(values), maps)
    after = grown(local, state, 7)
    stretch = np.log(np.ptp(after.positions, axis=0) / np.ptp(state.positions, axis=0))
    # a strain that is the same everywhere is compatible, so that the body follows it without stress
    assert stretch[0] - stretch[1:].mean() == pytest.approx(0.09, abs=0.01)
    assert after.rows[-1]["volume_ml"] == pytest.approx(after.rows[-1]["volume_aim_ml"], rel=1e-3)


@pytest.mark.parametrize(("growth", "negative"), [(0.3, False), pytest.param(0.05, True, marks=pytest.mark.one_rank)])
def test_ventricles_follow_a_curve_of_their_own_beside_the_brain(growth, negative):
    folding, state = following((0.10, 0.15), allow_negative_growth=negative)
    inputs, start, after = with_ventricles(folding, state, growth)
    row = after.rows[-1]
    # after a week; what a first step does not know of their surroundings is learnt by then
    assert row["ventricles_ml"] == pytest.approx(row["ventricles_aim_ml"], rel=5e-3)
    assert row["ventricles_ml"] == pytest.approx(start * ML_PER_MM3 * math.exp(growth), rel=5e-3)
    assert max(abs(each["ventricles_ml"] / each["ventricles_aim_ml"] - 1) for each in after.rows) < 0.02
    for each in after.rows:
        assert each["area_cm2"] == pytest.approx(each["area_aim_cm2"], rel=1.5e-3)
        assert each["volume_ml"] == pytest.approx(each["volume_aim_ml"], rel=1.5e-3)
    # with the core's rate they would be far from it
    alike = inputs.size(grown(folding, state, 7).positions * MM_PER_M).ventricles_mm3
    assert abs(math.log(alike / start) - growth) > 0.05


def test_ventricles_whose_rate_may_not_be_negative_are_taken_along_and_told_of():
    _, _, after = with_ventricles(*following((0.10, 0.15)), 0.05)
    assert after.rows[-1]["ventricle_growth_rate_per_s"] == 0.0
    assert after.rows[-1]["ventricles_ml"] > 1.03 * after.rows[-1]["ventricles_aim_ml"]
    (note,) = missed_curves(after.rows)
    assert note.startswith("at GW 22 the ventricles are +")
    assert "at a rate of 0 what grows around them takes them along" in note


def with_ventricles(folding, state, growth):
    """Returns the inputs with a ball of ventricles, their volume in mm³, and the state after a week of their growth."""
    mesh = ellipsoid_mesh(8, AXES)
    maps = {VENTRICLES: (np.linalg.norm(mesh.vertices, axis=1) < 10).astype(float)}
    inputs = GrowthInputs.of(mesh, folding.zones, maps)
    start = inputs.size(mesh.vertices).ventricles_mm3
    values = folding.parameters.model_dump(mode="json")
    values["follow"] |= {"ventricles_ml": {21.0: start * ML_PER_MM3, 23.0: start * ML_PER_MM3 * math.exp(2 * growth)}}
    own = Folding(COMM, mesh, folding.zones, parameters_from(values), maps)
    return inputs, start, grown(own, state, 7)
