"""Rows of validation."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.compare.validation import ordered, validation_row
from gyriflow.geometry.triangles import area, signed_volume, transformed

from .bumpy import RADIUS, bumpy, shaped

REAL = bumpy(1)
SHAPES = {"real": shaped(REAL), "start": shaped(bumpy(2)), "adjacent": shaped(bumpy(1, height=0.8))}


def row(week: float, *, grown: float = 1.0, run: str = "measured") -> dict:
    """A row of the real brain `grown`, which was to have the real brain's own area and volume."""
    return validation_row(
        {"run": run, "kind": "predicted", "start_week": 21.0, "week": week, "start": "a", "real": f"b{week:g}"},
        simulated=transformed(REAL, np.diag([grown] * 3 + [1.0])),
        real_brain=REAL,
        aims={"area_cm2": area(REAL) / 100, "volume_ml": signed_volume(REAL) / 1000},
        run=SHAPES["real"],
        **SHAPES,
    )


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    without_curve = {"curve_area_cm2": np.nan, "area_error": np.nan, "volume_error": np.nan}
    return ordered([row(23.0, grown=1.02), row(22.0), row(22.0, run="reference") | without_curve])


def test_a_row_holds_sizes_errors_placement_and_folds(table):
    found = table.iloc[1]
    assert (found["start"], found["real"]) == ("a", "b23")
    assert found["horizon"] == 2
    # a ball of 20 mm with shallow bumps: 50 cm², 34 mL
    assert found["curve_area_cm2"] == pytest.approx(4 * np.pi * RADIUS**2 / 100, rel=0.1)
    assert found["curve_volume_ml"] == pytest.approx(4 / 3 * np.pi * RADIUS**3 / 1000, rel=0.1)
    assert found["area_cm2"] == pytest.approx(1.02**2 * found["curve_area_cm2"])
    assert found["area_error"] == pytest.approx(1.02**2 - 1)
    assert found["volume_difference"] == pytest.approx(1.02**3 - 1)
    assert found["relative_area"] == pytest.approx(found["real_relative_area"])
    assert found["r_shape_index"] == pytest.approx(1.0)
    assert found["skill_shape_index"] > 1.0
    # as they are, not scaled: a fiftieth of the radius apart everywhere
    assert found["distance_mm"] == pytest.approx(0.02 * np.linalg.norm(REAL.vertices, axis=1).mean(), rel=0.05)
    assert found["distance95_mm"] > found["distance_mm"]
    assert 0.7 < found["cortex_dice"] < table["cortex_dice"].iloc[0] == 1.0
    assert found["curvature_rms_ratio"] == pytest.approx(1.0)
    assert table[["run", "week"]].to_numpy().tolist() == [["measured", 22.0], ["measured", 23.0], ["reference", 22.0]]
