"""Growth by sizes: the curves of a run, what free growth makes, and the rates that are
set; growth that is shown."""

import math

import numpy as np
import pytest
from ellipsoid import GAP_MM, RUN, brain_mesh
from facts import Facts
from shapes import box_mesh

from gyriflow.errors import SolverError
from gyriflow.folding.growth import GrowthInputs, StepStart
from gyriflow.folding.growth_models import growth_model
from gyriflow.folding.output import log_growth_at_vertices
from gyriflow.folding.steering import (
    _free_growth,
    _steered_rates,
    missed_curves,
)
from gyriflow.folding.stretches import unpacked
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.tetrahedra import quadratic
from gyriflow.settings.folding import parameters_from
from gyriflow.units import CM2_PER_MM2, ML_PER_MM3, SECONDS_PER_GW

GROWING = {"support": "free", "thickness_mm": 2.0}
MADE = np.array([[2.0, 0.0], [1.2, 1.75]])


def test_a_curve_that_is_missed_is_named_with_how_far():
    row = {"week": 23.0, "area_cm2": 99.0, "area_aim_cm2": 100.0}
    row |= {"volume_ml": 50.1, "volume_aim_ml": 50.0}
    assert missed_curves(row) == Facts("GW 23", "area", "-1.0 %")
    assert missed_curves(row) != Facts("volume")
    assert missed_curves(row | {"area_cm2": 100.2}) == ""


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
    growth = {"model": "sizes", "area_cm2": areas, "volume_ml": volumes}
    p = parameters_from(values | {"growth": growth})
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


def test_growth_reaches_as_deep_as_the_cortex_is_thick_at_its_thickest():
    mesh = brain_mesh(12)
    p = parameters_from(RUN | GROWING | {"thickness_mm": {"map": "thickness_mm"}})
    zones = zones_of_run(mesh, p, GAP_MM)
    even = np.full(len(mesh.vertices), 4.0)
    thin_at_one = even.copy()
    thin_at_one[0] = 0.5
    by_core = []
    for map_mm in (even, thin_at_one):
        inputs = GrowthInputs(mesh, zones, {"thickness_mm": map_mm})
        by_core.append(_free_growth(p, mesh.vertices, inputs, 21)[1, 0])
    assert by_core[1] == pytest.approx(by_core[0], rel=0.005)


@pytest.mark.parametrize(
    ("required", "made", "cortex", "core", "is_limited"),
    [
        ((0.04, 0.06), MADE, 0.02, 0.036 / 1.75, False),
        # more area than the core, which may not shrink, leaves room for
        ((0.2, 0.06), MADE, 0.05, 0.0, True),
        # less area than the volume makes: the core grows by itself
        ((-0.02, 0.035), MADE, 0.0, 0.02, True),
        ((-0.01, -0.02), MADE, 0.0, 0.0, True),
        # more of both than the bounds allow
        ((10.0, 10.0), MADE, 1.0, 1.0, True),
        # a surface that hardly gains by growth of the cortex, as a ball's
        ((0.05, 0.06), MADE * [[1e-9, 1], [1, 1]], 0.05, 0.0, True),
    ],
)
def test_bounds_leave_the_volume_on_its_curve(required, made, cortex, core, is_limited):
    *rates, found = _steered_rates(np.array(required), made, (0.0, 1.0))
    assert rates == pytest.approx([cortex, core])
    assert found == is_limited


def test_a_core_that_adds_no_volume_is_refused():
    with pytest.raises(SolverError):
        _steered_rates(np.array([0.01, 0.02]), MADE * [[1, 1], [1, 0]], (0.0, 1.0))


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
    np.testing.assert_allclose(logs[z > 3.0, 0, 0], math.log(1.2), atol=0.01)
    np.testing.assert_allclose(logs[z < -3.0, 0, 0], 0.0, atol=0.01)
    assert np.abs(logs - logs[:, :1, :1] * np.diag([1, 0, 0])).max() < 1e-9
