"""Curves for runs that follow sizes."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.errors import InputError
from gyriflow.growth.curves import curve_table
from gyriflow.growth.following import fits_of_series, followed_sizes

WEEKS = np.arange(21.0, 26.0)
AREAS = pd.DataFrame(
    {"series": "volume", "week": WEEKS, "area_cm2": 90 * 1.1 ** (WEEKS - 21), "volume_ml": 46 * 1.2 ** (WEEKS - 21)}
).assign(thickness_mm=np.nan)
MEASURED = {"area_cm2": "measured", "volume_ml": "measured", "thickness_mm": None}


def curves(areas=AREAS):
    (fits,) = fits_of_series(areas).values()
    return curve_table({name: fit.curve for name, fit in fits.items()}).assign(series="volume")


def test_measured_sizes_are_followed_every_quarter_of_a_week():
    growth = MEASURED | {"volume_ml": {21: 40.0, 25: 80.0}}
    sizes = followed_sizes(growth, curves(), "volume", [21.0, 22.0, 23.0], False)
    assert list(sizes["area_cm2"])[:3] == [21.0, 21.25, 21.5]
    assert max(sizes["area_cm2"]) >= 23.0
    assert sizes["area_cm2"][23.0] == pytest.approx(90 * 1.21, rel=5e-3)
    assert sizes["volume_ml"][23.0] == pytest.approx(np.sqrt(40 * 80), rel=1e-9)


def test_a_growth_model_without_sizes_follows_none():
    assert followed_sizes({"model": "rates"}, None, None, [21.0, 22.0], False) == {}


def test_a_brain_without_a_series_has_no_measured_curve():
    for table, series in ((None, None), (curves(), "surface")):
        with pytest.raises(InputError, match="no measured curve of area_cm2"):
            followed_sizes(MEASURED, table, series, [21.0, 22.0], False)


def test_a_given_table_shrinks_only_where_that_is_allowed():
    growth = MEASURED | {"area_cm2": {21: 90.0, 25: 80.0}, "volume_ml": {21: 40.0, 25: 80.0}}
    with pytest.raises(InputError, match="area_cm2 shrinks"):
        followed_sizes(growth, None, None, [21.0, 22.0], False)
    assert followed_sizes(growth, None, None, [21.0, 22.0], True)["area_cm2"][22.0] < 90


def test_thickness_follows_its_measured_curve_and_may_shrink():
    table = curves(AREAS.assign(thickness_mm=2.4 - 0.1 * (WEEKS - 21)))
    growth = MEASURED | {"thickness_mm": "measured"}
    sizes = followed_sizes(growth, table, "volume", [21.0, 22.0], False)
    assert sizes["thickness_mm"][22.0] == pytest.approx(2.3, rel=5e-3)
    with pytest.raises(InputError, match="no thickness_mm in two weeks"):
        followed_sizes(growth, curves(), "volume", [21.0, 22.0], False)
