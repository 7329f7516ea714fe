"""Curves and maps for runs that follow real brains."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.errors import InputError
from gyriflow.growth.curves import curve_table
from gyriflow.growth.following import fits_of_series, followed_sizes
from gyriflow.growth.regional import regional_map, relative_growth

WEEKS = np.arange(21.0, 26.0)
AREAS = pd.DataFrame(
    {"series": "volume", "week": WEEKS, "area_cm2": 90 * 1.1 ** (WEEKS - 21), "volume_ml": 46 * 1.2 ** (WEEKS - 21)}
).assign(thickness_mm=np.nan)


MEASURED = {"area_cm2": "measured", "volume_ml": "measured", "known_until_gw": None, "thickness_mm": None}


def curves(areas=AREAS, until=None):
    (fits,) = fits_of_series(areas, until=until).values()
    known = np.nan if until is None else until
    return curve_table({name: fit.curve for name, fit in fits.items()}).assign(series="volume", known_until_gw=known)


def test_measured_sizes_are_followed_every_quarter_of_a_week():
    follow = MEASURED | {"volume_ml": {21: 40.0, 25: 80.0}}
    sizes = followed_sizes(follow, curves(), "volume", [21.0, 22.0, 23.0], False)
    assert list(sizes["area_cm2"])[:3] == [21.0, 21.25, 21.5]
    assert max(sizes["area_cm2"]) >= 23.0
    assert sizes["area_cm2"][23.0] == pytest.approx(90 * 1.21, rel=5e-3)
    assert sizes["volume_ml"][23.0] == pytest.approx(np.sqrt(40 * 80), rel=1e-9)


def test_a_brain_without_a_series_has_no_measured_curve():
    for table, series in ((None, None), (curves(), "surface")):
        with pytest.raises(InputError, match="no measured curve of area_cm2"):
            followed_sizes(MEASURED, table, series, [21.0, 22.0], False)


def test_a_given_table_shrinks_only_where_that_is_allowed():
    follow = MEASURED | {"area_cm2": {21: 90.0, 25: 80.0}, "volume_ml": {21: 40.0, 25: 80.0}}
    with pytest.raises(InputError, match="area_cm2 shrinks"):
        followed_sizes(follow, None, None, [21.0, 22.0], False)
    assert followed_sizes(follow, None, None, [21.0, 22.0], True)["area_cm2"][22.0] < 90


def test_local_growth_is_a_multiple_of_the_whole():
    rates, weights = np.array([[0.1, 0.2, 0.2], [0.1, 0.1, 0.1]]), np.array([2.0, 1.0, 1.0])
    np.testing.assert_allclose(relative_growth(rates, weights, 1.0), [[2 / 3, 4 / 3, 4 / 3], [1, 1, 1]])
    np.testing.assert_allclose(relative_growth(rates, weights, 0.0), np.ones((2, 3)))
    assert relative_growth(np.array([[0.01, 1.0, 0.01]]), np.array([50.0, 1.0, 50.0]), 1.0).max() == 3.0
    with pytest.raises(InputError, match="does not grow"):
        relative_growth(-rates, weights, 1.0)
    assert regional_map(21.5) == "regional_growth_21.50"


def test_thickness_follows_its_measured_curve_and_may_shrink():
    table = curves(AREAS.assign(thickness_mm=2.4 - 0.1 * (WEEKS - 21)))
    follow = MEASURED | {"thickness_mm": "measured"}
    assert followed_sizes(follow, table, "volume", [21.0, 22.0], False)["thickness_mm"][22.0] == pytest.approx(
        2.3, 5e-3
    )


def test_a_prediction_knows_no_brain_after_its_week():
    grown_late = AREAS.assign(area_cm2=np.where(WEEKS > 23, 500.0, AREAS["area_cm2"]))
    table, follow = pd.concat([curves(grown_late), curves(grown_late, until=23.0)]), MEASURED | {"known_until_gw": 23.0}
    sizes = followed_sizes(follow, table, "volume", [23.0, 24.0, 25.0], False)
    assert sizes["area_cm2"][25.0] == pytest.approx(90 * 1.1**4, rel=0.01)
    with pytest.raises(InputError, match="up to 22 GW"):
        followed_sizes(follow | {"known_until_gw": 22.0}, table, "volume", [23.0, 24.0], False)


def test_ventricles_have_a_curve_where_labels_know_them_and_may_shrink():
    table = curves(AREAS.assign(ventricles_ml=8.0 - 0.5 * (WEEKS - 21)))
    follow = MEASURED | {"ventricles_ml": "measured"}
    assert followed_sizes(follow, table, "volume", [21.0, 23.0], False)["ventricles_ml"][23.0] == pytest.approx(
        7.0, 0.01
    )
    # labels that know none have volumes of zero, or none at all
    (without,) = fits_of_series(AREAS.assign(ventricles_ml=0.0)).values()
    assert set(without) == {"area_cm2", "volume_ml"}
    with pytest.raises(InputError, match="labels of its brains do not know ventricles in two weeks or more"):
        followed_sizes(follow, curves(), "volume", [21.0, 23.0], False)
