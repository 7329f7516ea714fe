"""Curves of growth are smooth and robust, and give the sizes that runs follow; growth
rates multiply up to the ratios of sizes."""

import numpy as np
import pandas as pd
import pytest
from facts import Facts
from scripts import run_script
from shapes import sphere

from gyriflow.errors import InputError
from gyriflow.growth.curves import (
    curve_table,
    errors,
    fits_of_series,
    fitted,
    followed_sizes,
    rate,
    sizes_on_curves,
    value,
)
from gyriflow.growth.rates import rates_of_series
from gyriflow.io.files import read_table, write_json, write_table
from gyriflow.io.surfaces import write_surface
from gyriflow.units import SECONDS_PER_GW

WEEKS = np.arange(21.0, 31.0)
# growth that slows down: 0.16 per week at 21, 0.07 at 30
VOLUMES = 50 * np.exp(0.16 * (WEEKS - 21) - 0.005 * (WEEKS - 21) ** 2)
SCATTERED = VOLUMES * np.exp(0.01 * np.random.default_rng(5).normal(size=10))


def leaping(week, factor, volumes=VOLUMES):
    """Return volumes of which that of one week is larger by a factor."""
    return volumes * np.where(week == WEEKS, factor, 1.0)


@pytest.mark.parametrize(("week", "factor"), [(21.0, 1.3), (25.0, 0.8), (30.0, 1.3)])
def test_a_week_that_leaps_does_not_leap(week, factor):
    fit = fitted(WEEKS, leaping(week, factor))
    tolerance = 0.04 if week in (21.0, 30.0) else 0.01
    assert value(fit.curve, WEEKS) == pytest.approx(VOLUMES, rel=tolerance)
    assert fit.weights[week == WEEKS] < 0.1
    table = errors({"volume": fit}).set_index("week")
    assert table.loc[week, "error"] == pytest.approx(1 / factor - 1, abs=0.05)


def test_the_first_week_is_kept_where_all_growth_refers_to_it(caplog):
    volumes = leaping(21.0, 1.5, SCATTERED)
    assert value(fitted(WEEKS, volumes).curve, 21.0) < 1.05 * VOLUMES[0]
    assert caplog.messages == [Facts("curve", 21)]
    caplog.clear()
    fit = fitted(WEEKS, volumes, keeps_first=True)
    assert fit.weights[0] == 1
    assert value(fit.curve, 21.0) > 1.2 * VOLUMES[0]
    assert caplog.messages == []


def test_a_small_scatter_is_no_outlier_and_few_weeks_show_none():
    assert fitted(WEEKS, leaping(25.0, 1.004)).weights.min() > 0.8
    volumes = leaping(24.0, 1.3)
    assert fitted(WEEKS[:7], volumes[:7]).weights == pytest.approx(np.ones(7))


def test_it_is_monotone_where_weeks_are_not():
    measured = [50.0, 60.0, 70.0, 64.0, 63.0, 75.0, 90.0]
    fit = fitted(WEEKS[:7], measured, degrees_of_freedom=6)
    assert (np.diff(fit.curve.values) >= 0).all()
    assert (rate(fit.curve, np.linspace(21, 27, 200)) >= 0).all()


def test_with_two_degrees_of_freedom_it_is_a_regression_line_with_its_error():
    fit = fitted(WEEKS, SCATTERED, degrees_of_freedom=2)
    logs = np.log(SCATTERED)
    line = np.polynomial.Polynomial.fit(WEEKS, logs, 1)(WEEKS)
    assert value(fit.curve, WEEKS) == pytest.approx(np.exp(line), rel=0.005)
    scatter = np.sqrt(((logs - line) ** 2).sum() / (len(WEEKS) - 2))
    from_mean = WEEKS - WEEKS.mean()
    share = 1 / len(WEEKS) + from_mean**2 / (from_mean**2).sum()
    found = np.interp(WEEKS, fit.curve.weeks, fit.curve.sd)
    assert found == pytest.approx(scatter * np.sqrt(share), rel=0.1)


def test_four_weeks_have_three_degrees_of_freedom():
    # a size, a rate and its steady change are met by these
    fit = fitted(WEEKS[:4], VOLUMES[:4])
    assert value(fit.curve, WEEKS[:4]) == pytest.approx(VOLUMES[:4], rel=1e-3)


def test_several_brains_of_a_week_and_two_weeks_alone():
    several = fitted([21, 21, 23, 23], [49.0, 51.0, 98.0, 102.0]).curve
    assert value(several, [21, 23]) == pytest.approx([50, 100], rel=2e-3)
    alone = fitted([21, 24], [50.0, 80.0]).curve
    assert value(alone, [21, 24]) == pytest.approx([50, 80], rel=1e-4)
    assert rate(alone, 22) == pytest.approx(np.log(1.6) / 3, rel=1e-3)
    assert np.isnan(alone.sd).all()


def test_shrinking_is_refused():
    with pytest.raises(InputError, check=Facts("ventricles", "21, 22", 30)):
        fitted(WEEKS, VOLUMES[::-1], name="ventricles")


@pytest.mark.parametrize(
    ("weeks", "values"),
    [([21, 21], [1.0, 2.0]), ([21, 22], [1.0, -1.0]), ([21, 22], [1.0, np.nan])],
)
def test_what_is_no_curve_is_refused(weeks, values):
    with pytest.raises(InputError, check=Facts("volume")):
        fitted(weeks, values, name="volume")


# sizes that runs follow

# two brains of one week, larger and smaller than the curve
AREAS = pd.DataFrame({"week": np.sort([*WEEKS, 23.0, 27.0])})
AREAS["area_cm2"] = 90 * 1.1 ** (AREAS["week"] - 21)
AREAS["volume_ml"] = 46 * 1.2 ** (AREAS["week"] - 21)
AREAS.loc[[2, 7], ["area_cm2", "volume_ml"]] *= 1.02
AREAS.loc[[3, 8], ["area_cm2", "volume_ml"]] /= 1.02
MEASURED = {"area_cm2": "measured", "volume_ml": "measured"}


@pytest.fixture(scope="module")
def curves():
    fits = fits_of_series(AREAS.assign(series="volume"))["volume"]
    table = curve_table({name: fit.curve for name, fit in fits.items()})
    return table.assign(series="volume")


def test_sizes_are_followed_every_quarter_of_a_week(curves):
    growth = MEASURED | {"volume_ml": {25: 80.0, 21: 40.0}}
    sizes = followed_sizes(growth, curves, "volume", [21.0, 22.0, 23.0], False)
    assert list(sizes["area_cm2"])[:3] == [21.0, 21.25, 21.5]
    assert max(sizes["area_cm2"]) >= 23.0
    assert sizes["area_cm2"][23.0] == pytest.approx(90 * 1.21, rel=5e-3)
    assert sizes["volume_ml"][23.0] == pytest.approx(np.sqrt(40 * 80), rel=1e-9)
    # a growth model without sizes
    assert followed_sizes({"model": "rates"}, None, None, [21.0, 22.0], False) == {}


def test_a_brain_without_a_series_has_no_measured_curve(curves):
    for table, series in ((None, None), (curves, "surface")):
        with pytest.raises(InputError, check=Facts("area_cm2")):
            followed_sizes(MEASURED, table, series, [21.0, 22.0], False)
    with pytest.raises(InputError):
        sizes_on_curves({"model": "rates"}, curves, "other", [23.0])
    assert sizes_on_curves({"model": "rates"}, None, None, [23.0]) == {23.0: {}}


def test_sizes_of_a_week_are_those_that_a_run_follows(curves):
    growth = {"model": "sizes", "area_cm2": {21.0: 100.0, 25.0: 144.0}}
    growth |= {"volume_ml": {21.0: 40.0, 25.0: 90.0}}
    followed = sizes_on_curves(growth, curves, "volume", [23.0])[23.0]
    # logarithms are interpolated
    assert followed == pytest.approx({"area_cm2": 120, "volume_ml": 60})


def test_a_given_table_shrinks_only_where_that_is_allowed():
    growth = {"area_cm2": {21: 90.0, 25: 80.0}, "volume_ml": {21: 40.0, 25: 80.0}}
    with pytest.raises(InputError, check=Facts("area_cm2", 25)):
        followed_sizes(growth, None, None, [21.0, 22.0], False)
    assert followed_sizes(growth, None, None, [21.0, 22.0], True)["area_cm2"][22.0] < 90


# growth rates


@pytest.mark.parametrize("weeks", [1.0, 4.0])
def test_compound_rates_multiply_up_to_the_ratios(weeks):
    step_s = 600.0
    sizes = {"area_cm2": [90.0, 140.0], "volume_ml": [45.0, 80.0]}
    brains = pd.DataFrame({"series": "s", "week": [21.0, 21.0 + weeks], **sizes})
    row = rates_of_series(brains, ["s"]).iloc[0]
    steps = round(weeks * SECONDS_PER_GW / step_s)
    length = (1 + row["compound_rate_per_s"] * step_s) ** steps
    core_length = (1 + row["core_compound_rate_per_s"] * step_s) ** steps
    assert length**2 == pytest.approx(14 / 9, rel=1e-3)
    assert core_length**3 == pytest.approx(16 / 9, rel=1e-3)
    # the rates that refer to the start of the interval would overshoot
    assert row["rate_per_s"] > row["compound_rate_per_s"]
    assert row["core_rate_per_s"] > row["core_compound_rate_per_s"]


@pytest.mark.usefixtures("recorded_outputs")
def test_the_rule_writes_what_is_known_of_each_brain(tmp_path):
    # radius and volume of tissue
    brains = {"a": (20.0, 30.0), "b": (22.0, 40.0), "c": (20.0, None)}
    brains["d"] = (21.0, None)
    for name, (radius_mm, tissue_ml) in brains.items():
        write_surface(tmp_path / f"{name}.gii", sphere(radius_mm, 2))
        report = {"label_volumes_mL": {"tissue": tissue_ml}} if tissue_ml else {}
        write_json(tmp_path / f"{name}.json", report)
    inputs = {"whole": [f"{name}.gii" for name in brains]}
    inputs |= {"reports": [f"{name}.json" for name in brains]}
    params = {"series": ["mine", "mine", "atlas", "atlas"], "brains": list(brains)}
    params |= {"weeks": [21, 22, 21, 22], "with_rates": ["mine", "atlas"]}
    outputs = {"areas": "areas.csv", "rates": "rates.csv"}
    run_script("growth_rates.py", tmp_path, inputs, outputs, params)
    rates = read_table(tmp_path / "rates.csv").set_index("series")
    # radii grow as the square root of areas
    per_week = rates["rate_per_s"] * SECONDS_PER_GW
    assert per_week.tolist() == pytest.approx([0.1, 0.05], rel=1e-5)
    assert rates["tissue_ratio"].tolist() == pytest.approx([4 / 3, np.nan], nan_ok=True)


@pytest.mark.usefixtures("recorded_outputs")
def test_curves_of_each_series_are_written_with_the_errors_of_its_own(tmp_path):
    tables = []
    for name, factor in (("mine", 1.0), ("atlas", 1.4)):
        table = pd.DataFrame({"week": WEEKS, "area_cm2": 2 * factor * SCATTERED})
        volumes = factor * leaping(25.0, 0.8, SCATTERED)
        tables.append(table.assign(volume_ml=volumes, series=name))
    write_table(tmp_path / "areas.csv", pd.concat(tables))
    outputs = {"curves": "curves.csv", "errors": "errors.csv"}
    run_script("growth_curves.py", tmp_path, {0: "areas.csv"}, outputs)
    table = read_table(tmp_path / "curves.csv").set_index(["series", "quantity"])
    curve = table.loc[("atlas", "area_cm2")]
    found = np.interp(WEEKS, curve["week"], curve["value"])
    assert found == pytest.approx(2.8 * VOLUMES, rel=0.02)
    misfits = read_table(tmp_path / "errors.csv").query("week == 25")
    for quantity, error in (("volume_ml", 0.25), ("area_cm2", 0.0)):
        found = misfits.loc[misfits["quantity"] == quantity, "error"]
        assert found.tolist() == pytest.approx([error] * 2, abs=0.03)
