"""The table of validation: sizes, errors, distances, placement and folds of brains that differ in a known way."""

import numpy as np
import pytest
from shapes import rigid

from gyriflow.compare.validation import ObservedWeek, validation_table
from gyriflow.geometry.triangles import area, signed_volume, transformed

from .bumpy import PREPARED, RADIUS, REAL, bumpy, shaped

LABELS = {"run": "measured", "kind": "predicted", "start": "a", "start_week": 21.0}
OBSERVED = ObservedWeek("b", REAL, PREPARED, start=shaped(bumpy(2)), adjacent=shaped(bumpy(1, height=0.8)))
SIZES = {"area_cm2": area(REAL) / 100, "volume_ml": signed_volume(REAL) / 1000}


def grown(factor):
    """Return the observed brain in another pose, its lengths multiplied by a factor."""
    return transformed(REAL, rigid(0, 4, 8, shift=(3, -2, 1)) @ np.diag([factor] * 3 + [1.0]))


def validate(simulated, observed=None, sizes=None):
    observed = observed or dict.fromkeys(simulated, OBSERVED)
    return validation_table(LABELS, simulated, observed, sizes or {}, radius_mm=3.0).set_index("week", drop=False)


def test_a_brain_that_is_a_fiftieth_too_large_has_this_error_in_its_place():
    found = validate({23.0: grown(1.02)}, sizes={23.0: SIZES}).loc[23.0]
    assert tuple(found[["run", "kind", "start", "real", "horizon"]]) == ("measured", "predicted", "a", "b", 2.0)
    # a ball of 20 mm with shallow bumps: 50 cm², 34 mL
    assert found["curve_area_cm2"] == pytest.approx(4 * np.pi * RADIUS**2 / 100, rel=0.1)
    assert found["curve_volume_ml"] == pytest.approx(4 / 3 * np.pi * RADIUS**3 / 1000, rel=0.1)
    assert found["area_cm2"] == pytest.approx(1.02**2 * found["curve_area_cm2"])
    assert found["area_error"] == pytest.approx(1.02**2 - 1)
    assert found["volume_difference"] == pytest.approx(1.02**3 - 1)
    assert found["relative_area"] == pytest.approx(found["real_relative_area"])
    # as they are, not scaled: a fiftieth of the radius everywhere
    assert found["distance_mm"] == pytest.approx(0.02 * np.linalg.norm(REAL.vertices, axis=1).mean(), rel=0.05)
    assert found["distance95_mm"] > found["distance_mm"]
    assert 0.7 < found["cortex_dice"] < 0.99
    # folds are compared after scaling
    assert found["r_shape_index"] > 0.95
    assert found["skill_shape_index"] > 0.9
    assert found["curvature_rms_ratio"] == pytest.approx(1.0, abs=0.05)


def test_each_week_is_compared_with_its_own_brain_and_baselines():
    other = bumpy(2)
    weeks = {
        22.0: ObservedWeek("b22", REAL, PREPARED, start=shaped(other), adjacent=shaped(other)),
        25.0: ObservedWeek("b25", other, shaped(other), start=PREPARED, adjacent=shaped(other)),
    }
    table = validate({25.0: other, 22.0: REAL}, weeks, sizes={25.0: SIZES})
    assert table["week"].tolist() == [22.0, 25.0]
    assert table["real"].tolist() == ["b22", "b25"]
    assert table["horizon"].tolist() == [1.0, 4.0]
    assert (table["r_mean_curvature"] > 0.9).all()
    assert (table["r_start_mean_curvature"].abs() < 0.4).all()
    assert table["r_adjacent_mean_curvature"].tolist() == pytest.approx(
        [table.loc[22.0, "r_start_mean_curvature"], 1.0]
    )
    assert (table["distance_mm"] < 0.05).all()
    # no curve, no error against one
    assert np.isnan(table.loc[22.0, ["curve_area_cm2", "area_error", "volume_error"]].to_numpy(dtype=float)).all()
    assert table.loc[25.0, "curve_area_cm2"] == SIZES["area_cm2"]


def test_folds_are_measured_with_the_radius_that_is_asked_for():
    sharp = bumpy(1, height=2.0, sharpness=60.0)
    fine, coarse = (
        validation_table(LABELS, {22.0: sharp}, {22.0: OBSERVED}, {}, radius_mm=radius)["curvature_rms_ratio"].item()
        for radius in (3.0, 6.0)
    )
    assert coarse < 0.9 * fine
