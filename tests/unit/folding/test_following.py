"""The curves and maps that growth follows."""

import math

import pytest
from ellipsoid import RUN, SEMI_AXES
from shapes import ellipsoid_mesh

from gyriflow.folding.following import growing_at_start, joined, map_at, missed_curves, size_of, value_on
from gyriflow.folding.output import layer_fields
from gyriflow.folding.zones import zones_of_run
from gyriflow.parameters.reading import parameters_from
from gyriflow.units import CM2_PER_MM2, ML_PER_MM3, SECONDS_PER_GW

CURVE = {21.0: 100.0, 22.0: 110.0, 24.0: 121.0}


def test_a_curve_is_geometric_between_its_weeks_and_goes_on_beyond_them():
    assert value_on(CURVE, 21.5) == pytest.approx(math.sqrt(100 * 110))
    assert value_on(CURVE, 23.0) == pytest.approx(math.sqrt(110 * 121))
    assert value_on(CURVE, 20.0) == pytest.approx(100 / 1.1)
    assert value_on(CURVE, 26.0) == pytest.approx(121 * 1.1)


def test_a_brain_off_the_curve_comes_onto_it_within_a_week():
    assert joined(CURVE, 90.0, 21.0, 21.0) == pytest.approx(90.0)
    assert joined(CURVE, 90.0, 21.0, 21.5) == pytest.approx(value_on(CURVE, 21.5) * math.sqrt(0.9))
    assert joined(CURVE, 90.0, 21.0, 22.0) == pytest.approx(110.0)
    assert joined(CURVE, 90.0, 21.0, 23.5) == pytest.approx(value_on(CURVE, 23.5))


def test_a_map_holds_from_its_week_to_the_next():
    maps = {21.0: "a", 22.0: "b"}
    assert [map_at(maps, week) for week in (21.0, 21.5, 22.0, 22.1, 30.0)] == ["a", "a", "a", "b", "b"]
    assert map_at({}, 21.0) is None


def test_a_curve_that_is_missed_is_named_with_how_far():
    row = {"week": 23.0, "area_cm2": 99.0, "area_aim_cm2": 100.0, "volume_ml": 50.1, "volume_aim_ml": 50.0}
    assert missed_curves(row) == "at GW 23 the brain is area -1.0 % off its curve"
    assert missed_curves(row | {"area_cm2": 100.2}) == ""
    assert missed_curves({"week": 23.0, "area_cm2": 99.0, "volume_ml": 50.0}) == ""


def test_a_run_that_follows_begins_with_the_growth_that_leads_to_its_curves():
    mesh = ellipsoid_mesh(12, SEMI_AXES)
    plain = parameters_from(RUN)
    zones = zones_of_run(mesh, plain)
    start = size_of(mesh.vertices, zones)
    area, volume = start.area_mm2 * CM2_PER_MM2, start.volume_mm3 * ML_PER_MM3
    curves = {"area_cm2": {21.0: area, 22.0: 1.12 * area}, "volume_ml": {21.0: volume, 22.0: 1.2 * volume}}
    followed = growing_at_start(parameters_from(RUN | {"follow": curves}), mesh.vertices, zones, {})
    # 0.6 of the tangential growth turns into area at first
    rate = math.log(1.12) / SECONDS_PER_GW / (2 * 0.6)
    assert followed.growth_rate_per_s == pytest.approx(rate)
    assert followed.growth_rate_per_s != pytest.approx(plain.growth_rate_per_s, rel=0.1)
    shown = layer_fields(mesh.vertices, zones, followed, {}, 21.0, ["growth"])["tangential_growth_per_step"]
    assert shown.max() == pytest.approx(rate * followed.step_s, rel=1e-3)
    # a prescribed growth is the run's own
    assert growing_at_start(plain, mesh.vertices, zones, {}) == plain
