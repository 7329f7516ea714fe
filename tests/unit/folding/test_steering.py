"""Growth by sizes: the curves of a run, what free growth makes, and the rates that are
set; growth that is shown."""

import json
import math

import numpy as np
import pytest
from ellipsoid import GAP_MM, RUN, SEMI_AXES, brain_mesh
from facts import Facts
from shapes import box_mesh, rigid

from gyriflow.errors import SolverError
from gyriflow.folding.growth import GrowthInputs, Size, StepStart
from gyriflow.folding.growth_models import growth_model
from gyriflow.folding.output import growth_components, log_growth_at_vertices
from gyriflow.folding.steering import (
    SteeredStep,
    blended,
    free_growth,
    missed_curves,
    steered_rates,
)
from gyriflow.folding.stretches import packed, unpacked
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.tetrahedra import quadratic
from gyriflow.geometry.triangles import TriangleMesh, face_areas
from gyriflow.settings.folding import parameters_from
from gyriflow.units import CM2_PER_MM2, ML_PER_MM3, SECONDS_PER_GW

GROWING = {"support": "free", "thickness_mm": 2.0}
CURVE = {21.0: 100.0, 22.0: 110.0, 24.0: 121.0}
MADE = np.array([[2.0, 0.0], [1.2, 1.75]])
BOUNDS = (0.0, 1.0)
DAY_S = 86_400.0


def test_a_brain_off_the_curve_comes_onto_it_within_a_week():
    assert blended(CURVE, 100.0, 21.0, 23.0) == pytest.approx(math.sqrt(110 * 121))
    assert blended(CURVE, 90.0, 21.0, 21.0) == pytest.approx(90.0)
    assert blended(CURVE, 90.0, 21.0, 21.5) == pytest.approx(
        math.sqrt(100 * 110) * math.sqrt(0.9)
    )
    for week, expected in ((22.0, 110.0), (23.0, math.sqrt(110 * 121)), (24.0, 121.0)):
        assert blended(CURVE, 90.0, 21.0, week) == pytest.approx(expected)


def test_a_curve_that_is_missed_is_named_with_how_far():
    row = {
        "week": 23.0,
        "area_cm2": 99.0,
        "area_aim_cm2": 100.0,
        "volume_ml": 50.1,
        "volume_aim_ml": 50.0,
    }
    assert missed_curves(row) == Facts("GW 23", "area", "-1.0 %")
    assert missed_curves(row) != Facts("volume")
    assert missed_curves(row | {"area_cm2": 100.2}) == ""
    assert missed_curves({"week": 23.0, "area_cm2": 99.0, "volume_ml": 50.0}) == ""


def grown_by_sizes(area_ratio, volume_ratio, correction=None, **changes):
    """Return the first step of an ellipsoid whose area and volume grow by ratios in a
    week, and what it was made of."""
    mesh = brain_mesh(12)
    values = RUN | GROWING | changes
    plain = parameters_from(values)
    inputs = GrowthInputs(mesh, zones_of_run(mesh, plain, GAP_MM), {})
    start = inputs.size(mesh.vertices)
    area, volume = start.area_mm2 * CM2_PER_MM2, start.volume_mm3 * ML_PER_MM3
    areas = {21.0: area, 22.0: area_ratio * area}
    volumes = {21.0: volume, 22.0: volume_ratio * volume}
    p = parameters_from(
        values | {"growth": {"model": "sizes", "area_cm2": areas, "volume_ml": volumes}}
    )
    first = StepStart(mesh.vertices, 0.0, p.step_s, correction)
    return growth_model(p, inputs)(first), growth_model(plain, inputs)(first), plain


@pytest.mark.parametrize("missing", [(-0.02, 0.01), (0.0, 0.0)])
def test_a_run_begins_with_the_rates_that_lead_to_its_curves(missing):
    """What the last step missed is made up for."""
    correction = np.array(missing) / SECONDS_PER_GW
    step, by_rates, plain = grown_by_sizes(1.13, 1.2, tuple(correction))
    expected = np.array([math.log(1.13), math.log(1.2)]) - missing
    assert step.free_rates * SECONDS_PER_GW == pytest.approx(expected, rel=1e-6)
    assert not step.limited
    # a prescribed growth is the run's own
    assert by_rates.parameters == plain


def test_no_rate_is_above_that_which_may_be_prescribed():
    step, *_ = grown_by_sizes(1e9, 1e12)
    assert step.parameters.growth_rate_per_s == pytest.approx(1e-5)
    assert step.parameters.core_growth_rate_per_s == pytest.approx(1e-5)
    assert step.limited


def test_growth_of_the_surface_is_a_mean_over_area_where_a_part_does_not_grow():
    # triangles and elements of unequal size
    mesh = brain_mesh(10, (20.0, 44.0, 12.0))
    p = parameters_from(RUN | {"thickness_mm": 2.0})
    inputs = GrowthInputs(mesh, zones_of_run(mesh, p, GAP_MM), {})
    faces = inputs.zones.measured_facets
    growing = inputs.zones.growing[faces].mean(axis=1)
    areas = face_areas(TriangleMesh(mesh.vertices, faces))
    share = float(np.average(growing, weights=areas))
    assert 0.1 < share < 0.95
    assert abs(share - growing.mean()) > 0.01
    made = free_growth(p, mesh.vertices, inputs, 21)
    assert made[0, 0] == pytest.approx(2 * share)


def test_growth_reaches_as_deep_as_the_cortex_is_thick_at_its_thickest():
    mesh = brain_mesh(12)
    found = []
    for map_mm in (
        np.full(len(mesh.vertices), 4.0),
        np.where(np.arange(len(mesh.vertices)) == 0, 0.5, 4.0),
    ):
        p = parameters_from(RUN | GROWING | {"thickness_mm": {"map": "thickness_mm"}})
        inputs = GrowthInputs(
            mesh, zones_of_run(mesh, p, GAP_MM), {"thickness_mm": map_mm}
        )
        found.append(free_growth(p, mesh.vertices, inputs, 21)[1, 0])
    assert found[1] == pytest.approx(found[0], rel=0.005)


def test_free_growth_of_a_body_is_known():
    mesh, thickness = brain_mesh(16), 4.0
    # the cortex thickens by the week
    by_week = {
        "thickness_mm": {"weeks": {21: 2.0, 22: thickness}},
    }
    p = parameters_from(RUN | GROWING | by_week)
    inputs = GrowthInputs(mesh, zones_of_run(mesh, p, GAP_MM), {})
    made = free_growth(p, mesh.vertices, inputs, 22)
    # all of it grows by one rate: three directions of the core, two of the cortex
    layer = 3 - made[1].sum()
    assert made[1, 0] == pytest.approx(2 * layer)
    # the cortex is two layers of elements thick: so much of the body is found within
    # 0.02 %
    assert layer == pytest.approx(
        1 - np.prod(1 - thickness / np.array(SEMI_AXES)), rel=0.01
    )
    assert made[0] == pytest.approx([2.0, 0.0])


@pytest.mark.parametrize("share", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("days", [0.5, 1.0])
def test_bending_curves_are_met_at_output_weeks_by_a_body_that_realises_part_of_growth(
    share, days
):
    """The area of the body grows by two thirds of its volume, and by a share of what
    the cortex grows more."""
    rates = {"growth_rate_per_s": 3e-7, "core_growth_rate_per_s": 2e-7}
    p = parameters_from(RUN | rates)
    size = Size(1e4, 5e4)
    correction = None
    step_s = days * DAY_S
    steps_a_week = round(7 / days)
    for number in range(4 * steps_a_week):
        weeks = (number + 1) / steps_a_week
        grown = weeks + max(weeks - 2, 0)  # twice as fast from the second week on
        aim = Size(1e4 * math.exp(0.07 * grown), 5e4 * math.exp(0.09 * grown))
        *rates, limited = steered_rates(
            size.rates_to(aim, step_s) - (correction or (0.0, 0.0)), MADE, (0.0, 1e-5)
        )
        start = StepStart(np.empty((0, 3)), number * step_s, step_s, correction)
        step = SteeredStep(p, start, size, aim, MADE @ rates, limited)
        of_area, of_volume = MADE @ rates
        made = 2 / 3 * of_volume + share * (of_area - 2 / 3 * of_volume)
        size = Size(
            size.area_mm2 * math.exp(made * step_s),
            size.volume_mm3 * math.exp(of_volume * step_s),
        )
        # a checkpoint keeps it as JSON
        correction = json.loads(json.dumps(step.correction(size)))
        assert size.volume_mm3 == pytest.approx(aim.volume_mm3, rel=1e-6)
        if (number + 1) % steps_a_week == 0:
            assert size.area_mm2 == pytest.approx(aim.area_mm2, rel=5e-3)
    row = step.row(size)
    expected = {
        "area_cm2": size.area_mm2 / 100,
        "volume_ml": size.volume_mm3 / 1000,
        "area_aim_cm2": aim.area_mm2 / 100,
        "volume_aim_ml": aim.volume_mm3 / 1000,
        "growth_rate_per_s": p.growth_rate_per_s,
        "core_growth_rate_per_s": p.core_growth_rate_per_s,
        "realised_share": made / of_area,
        "growth_limited": 0,
    }
    assert row == pytest.approx(expected)


def test_bounds_leave_the_volume_on_its_curve():
    assert steered_rates(np.array([0.04, 0.06]), MADE, BOUNDS) == (
        0.02,
        pytest.approx(0.036 / 1.75),
        False,
    )
    # more area than the core, which may not shrink, leaves room for
    assert steered_rates(np.array([0.2, 0.06]), MADE, BOUNDS) == (
        pytest.approx(0.05),
        0.0,
        True,
    )
    # less area than the volume makes: the core grows by itself
    assert steered_rates(np.array([-0.02, 0.035]), MADE, BOUNDS) == (
        0.0,
        pytest.approx(0.02),
        True,
    )
    assert steered_rates(np.array([-0.01, -0.02]), MADE, BOUNDS) == (0.0, 0.0, True)
    # more of both than the bounds allow
    assert steered_rates(np.array([10.0, 10.0]), MADE, BOUNDS) == (1.0, 1.0, True)
    # a surface that hardly gains by growth of the cortex, as a ball's
    rates = steered_rates(np.array([0.05, 0.06]), MADE * [[1e-9, 1], [1, 1]], BOUNDS)
    assert rates == (pytest.approx(0.05), 0.0, True)
    singular = MADE * [[1, 1], [1, 0]]
    with pytest.raises(SolverError):
        steered_rates(np.array([0.01, 0.02]), singular, BOUNDS)


def test_growth_is_shown_along_the_surface_across_it_and_by_its_direction():
    # two vertices: one with a normal along z, one with another turned by 40° about x
    turn = rigid(40, 0, 0)[:3, :3]
    first = np.array([[0.02, 0.0, 0.0], [0.0, 0.05, 0.0], [0.0, 0.0, -0.3]])
    tensors = np.stack([first, turn @ first @ turn.T])
    normals = np.stack([[0.0, 0.0, 1.0], turn[:, 2]])
    found = growth_components(packed(tensors), normals)
    assert found["tangential_growth_per_step"] == pytest.approx([0.035, 0.035])
    assert found["radial_growth_per_step"] == pytest.approx([-0.3, -0.3])
    directions = found["growth_direction_per_step"]
    directions = (
        directions
        * np.sign((directions * [[0, 1, 0], turn[:, 1]]).sum(axis=1))[:, None]
    )
    assert directions == pytest.approx(0.03 * np.stack([[0.0, 1.0, 0.0], turn[:, 1]]))


@pytest.mark.parametrize("order", [1, 2])
def test_a_map_of_growth_is_where_the_elements_have_grown(order):
    # elements of unequal size: those above grow by a fifth along x, those below do not
    mesh = box_mesh((4, 5, 8), (8.0, 10.0, 16.0))
    mesh = mesh if order == 1 else quadratic(mesh)
    p = parameters_from(RUN | GROWING)
    inputs = GrowthInputs(mesh, zones_of_run(mesh, p, GAP_MM), {})
    is_above = mesh.vertices[mesh.corners][:, :, 2].mean(axis=1) > 0
    growth = np.where(is_above[:, None, None], np.diag([1.2, 1.0, 1.0]), np.eye(3))
    logs = unpacked(log_growth_at_vertices(mesh.vertices, inputs, growth))
    z = mesh.vertices[:, 2]
    for is_there, expected in ((z > 3.0, math.log(1.2)), (z < -3.0, 0.0)):
        assert logs[is_there, 0, 0] == pytest.approx(
            np.full(is_there.sum(), expected), abs=0.01
        )
    assert np.abs(logs - logs[:, :1, :1] * np.diag([1, 0, 0])).max() < 1e-9
