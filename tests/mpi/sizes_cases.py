"""Growth by sizes: curves of area and volume are met, whatever part of growth the tissue realises."""

import math

import numpy as np
import pytest
from boxes import COMM
from contact_bodies import after_steps
from shapes import ellipsoid_mesh

from gyriflow.folding.checkpoint import State
from gyriflow.folding.growth import GrowthInputs
from gyriflow.folding.simulation import Folding
from gyriflow.folding.zones import zones_of_run
from gyriflow.parameters.folding import parameters_from
from gyriflow.units import CM2_PER_MM2, M_PER_MM, ML_PER_MM3, MM_PER_M

DAY_S = 86_400.0


def following(growth):
    """Return a free ellipsoid that is to grow by (area, volume) per week as logarithms, and the state before."""
    mesh = ellipsoid_mesh(8, (20.0, 24.0, 18.0))
    known = {"start_week": 21.0, "end_week": 23.0, "output_weeks": [21.0, 23.0], "fissure_x_mm": 0.0, "step_s": DAY_S}
    known |= {"support": "free", "no_growth": {"kind": "none"}, "contact": {"kind": "none"}, "thickness_mm": 4.0}
    start = GrowthInputs.of(mesh, zones_of_run(mesh, parameters_from(known)), {}).size(mesh.vertices)
    sizes = {"area_cm2": start.area_mm2 * CM2_PER_MM2, "volume_ml": start.volume_mm3 * ML_PER_MM3}
    curves = {
        name: {21.0: size, 23.0: size * math.exp(2 * rate)}
        for (name, size), rate in zip(sizes.items(), growth, strict=True)
    }
    parameters = parameters_from(known | {"growth": {"model": "sizes", **curves}})
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


def test_what_a_step_lacked_is_corrected_after_a_resumption_too():
    folding, state = following((0.10, 0.15))
    middle = after_steps(folding, state, 3)
    whole = after_steps(folding, middle, 2)
    resumed = after_steps(following((0.10, 0.15))[0], middle, 2)
    assert resumed.learnt == pytest.approx(whole.learnt, rel=1e-6)
    assert resumed.rows[-1]["growth_rate_per_s"] == pytest.approx(whole.rows[-1]["growth_rate_per_s"], rel=1e-6)
    np.testing.assert_allclose(resumed.positions, whole.positions, atol=1e-3 * M_PER_MM)
