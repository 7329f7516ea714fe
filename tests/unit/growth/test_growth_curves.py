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
    interval,
    rate,
    sizes_on_curves,
    tabulated,
    value,
)
from gyriflow.growth.rates import growth_rates, rates_of_series
from gyriflow.io.files import read_table, write_json, write_table
from gyriflow.io.surfaces import write_surface
from gyriflow.settings.folding import params_content

WEEKS = np.arange(21.0, 31.0)
# growth that slows down: 0.16 per week at 21, 0.07 at 30
VOLUMES = 50 * np.exp(0.16 * (WEEKS - 21) - 0.005 * (WEEKS - 21) ** 2)
RATES = 0.16 - 0.01 * (WEEKS - 21)


def test_growth_that_slows_down_is_met():
    fit = fitted(WEEKS, VOLUMES)
    assert value(fit.curve, WEEKS) == pytest.approx(VOLUMES, rel=2e-3)
    assert rate(fit.curve, WEEKS) == pytest.approx(RATES, abs=6e-3)
    assert fit.weights == pytest.approx(np.ones(10), abs=0.05)


@pytest.mark.parametrize("leaping", [0, 4, 9])
@pytest.mark.parametrize("factor", [0.8, 1.3])
def test_a_week_that_leaps_does_not_leap(leaping, factor):
    measured = VOLUMES.copy()
    measured[leaping] *= factor
    fit = fitted(WEEKS, measured)
    away = 0.04 if leaping in (0, 9) else 0.01
    assert value(fit.curve, WEEKS) == pytest.approx(VOLUMES, rel=away)
    assert fit.weights[leaping] < 0.1
    table = errors({"volume": fit}).set_index("week")
    assert table.loc[21.0 + leaping, "error"] == pytest.approx(1 / factor - 1, abs=0.05)


SCATTERED = VOLUMES * np.exp(0.01 * np.random.default_rng(5).normal(size=10))


def test_a_week_without_weight_counts_neither_for_the_curve_nor_for_its_error():
    leaping = SCATTERED.copy()
    leaping[4] *= 1.5
    fit = fitted(WEEKS, leaping)
    without = fitted(np.delete(WEEKS, 4), np.delete(SCATTERED, 4))
    assert fit.weights[4] == 0
    for found, expected in zip(
        interval(fit.curve, WEEKS), interval(without.curve, WEEKS), strict=True
    ):
        assert found == pytest.approx(expected, rel=0.005)
    at = fit.curve.weeks
    assert fit.curve.sd == pytest.approx(
        np.interp(at, without.curve.weeks, without.curve.sd), rel=0.05
    )


def test_the_first_week_is_kept_where_all_growth_refers_to_it(caplog):
    leaping = SCATTERED * np.where(WEEKS == 21, 1.5, 1.0)
    assert value(fitted(WEEKS, leaping).curve, 21.0) < 1.05 * VOLUMES[0]
    assert caplog.messages == [Facts("curve", 21)]
    caplog.clear()
    fit = fitted(WEEKS, leaping, keeps_first=True)
    assert (fit.weights[0], value(fit.curve, 21.0) > 1.2 * VOLUMES[0]) == (1, True)
    assert caplog.messages == []


def test_a_small_scatter_is_no_outlier_and_few_weeks_show_none():
    nearly = VOLUMES * np.where(WEEKS == 25, 1.004, 1.0)
    assert fitted(WEEKS, nearly).weights.min() > 0.8
    leaping = VOLUMES * np.where(WEEKS == 24, 1.3, 1.0)
    assert fitted(WEEKS[:7], leaping[:7]).weights == pytest.approx(np.ones(7))


def test_it_is_monotone_where_weeks_are_not():
    measured = [50.0, 60.0, 70.0, 64.0, 63.0, 75.0, 90.0]
    fit = fitted(WEEKS[:7], measured, degrees_of_freedom=6)
    assert (np.diff(fit.curve.values) >= 0).all()
    assert (rate(fit.curve, np.linspace(21, 27, 200)) >= 0).all()


def test_noise_is_smoothed_and_covered_by_the_interval():
    generator = np.random.default_rng(7)
    covered, gain = [], []
    for _ in range(40):
        measured = VOLUMES * np.exp(0.02 * generator.normal(size=10))
        fit = fitted(WEEKS, measured)
        low, high = interval(fit.curve, WEEKS)
        covered.append((low < VOLUMES) & (high > VOLUMES))
        gain.append(
            np.log(value(fit.curve, WEEKS) / VOLUMES).std()
            / np.log(measured / VOLUMES).std()
        )
    assert 0.75 < np.mean(covered) <= 1.0
    assert np.mean(gain) < 0.8


def test_a_straight_line_has_the_error_of_a_regression():
    """With two degrees of freedom the logarithm is a line; its error is smallest in the
    middle of the weeks."""
    fit = fitted(WEEKS, SCATTERED, degrees_of_freedom=2)
    logs = np.log(SCATTERED)
    line = np.polynomial.Polynomial.fit(WEEKS, logs, 1)
    assert value(fit.curve, WEEKS) == pytest.approx(np.exp(line(WEEKS)), rel=0.005)
    scatter = np.sqrt(((logs - line(WEEKS)) ** 2).sum() / (len(WEEKS) - 2))
    from_mean = WEEKS - WEEKS.mean()
    share = 1 / len(WEEKS) + from_mean**2 / (from_mean**2).sum()
    found = np.interp(WEEKS, fit.curve.weeks, fit.curve.sd)
    assert found == pytest.approx(scatter * np.sqrt(share), rel=0.1)


def test_several_brains_of_a_week_and_two_weeks_alone():
    fit = fitted([21, 21, 23, 23], [49.0, 51.0, 98.0, 102.0])
    assert value(fit.curve, [21, 22, 23]) == pytest.approx(
        [50, np.sqrt(50 * 100), 100], rel=2e-3
    )
    alone = fitted([21, 24], [50.0, 80.0])
    assert value(alone.curve, [21, 24]) == pytest.approx([50, 80], rel=1e-4)
    assert rate(alone.curve, 22) == pytest.approx(np.log(1.6) / 3, rel=1e-3)
    assert np.isnan(alone.curve.sd).all()


def test_four_weeks_have_three_degrees_of_freedom_a_size_a_rate_and_its_change():
    # a rate that changes steadily is met by these
    fit = fitted(WEEKS[:4], VOLUMES[:4])
    assert value(fit.curve, WEEKS[:4]) == pytest.approx(VOLUMES[:4], rel=1e-3)
    assert rate(fit.curve, WEEKS[:4]) == pytest.approx(RATES[:4], abs=1e-3)


def test_beyond_its_ends_growth_goes_on():
    fit = fitted(WEEKS, VOLUMES)
    end = rate(fit.curve, 30.0)
    assert value(fit.curve, 32.0) == pytest.approx(
        value(fit.curve, 30.0) * np.exp(2 * end)
    )


def test_shrinking_is_refused_but_for_a_table_that_may_shrink():
    with pytest.raises(InputError, check=Facts("ventricles", "21, 22", 30)):
        fitted(WEEKS, VOLUMES[::-1], name="ventricles")
    with pytest.raises(InputError, check=Facts(23)):
        tabulated([21, 22, 23], [1.0, 2.0, 1.5])
    assert rate(tabulated([21, 22, 23], [1.0, 2.0, 1.5], may_shrink=True), 22.5) < 0


@pytest.mark.parametrize(
    ("weeks", "values"),
    [
        ([21], [1.0]),
        ([21, 21], [1.0, 2.0]),
        ([21, 22], [1.0, -1.0]),
        ([21, 22], [1.0, np.nan]),
    ],
)
def test_what_is_no_curve_is_refused(weeks, values):
    with pytest.raises(InputError, check=Facts("volume")):
        fitted(weeks, values, name="volume")


def test_tables_go_through_their_values_and_are_written_out():
    curve = tabulated([22, 21, 25], [60.0, 50.0, 90.0])
    assert value(curve, [21, 22, 25]) == pytest.approx([50, 60, 90])
    table = curve_table({"volume_ml": curve})
    assert table.columns.tolist() == [
        "quantity",
        "week",
        "value",
        "low",
        "high",
        "rate_per_week",
    ]
    assert table["value"].tolist() == pytest.approx([50, 60, 90])
    # a table is as it was given, without an error
    for bound in ("low", "high"):
        assert table[bound].tolist() == pytest.approx([50, 60, 90])
    again = tabulated(table["week"], table["value"])
    assert value(again, 23.3) == pytest.approx(value(curve, 23.3))


# curves for runs that follow sizes

TWICE = np.sort([*WEEKS, 23.0, 27.0])
"""The weeks of brains of which two are of one week, and larger and smaller than the
curve."""
SIZE = np.select(
    [np.diff(TWICE, append=99) == 0, np.diff(TWICE, prepend=0) == 0],
    [1 / 1.02, 1.02],
    1.0,
)
AREAS = pd.DataFrame(
    {
        "series": "volume",
        "week": TWICE,
        "area_cm2": 90 * 1.1 ** (TWICE - 21),
        "volume_ml": 46 * 1.2 ** (TWICE - 21),
    }
)
AREAS[["area_cm2", "volume_ml"]] *= SIZE[:, None]
MEASURED = {"area_cm2": "measured", "volume_ml": "measured"}


def curves(areas=AREAS):
    (fits,) = fits_of_series(areas).values()
    return curve_table({name: fit.curve for name, fit in fits.items()}).assign(
        series="volume"
    )


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
        with pytest.raises(InputError, check=Facts("area_cm2")):
            followed_sizes(MEASURED, table, series, [21.0, 22.0], False)


def test_sizes_of_a_week_are_those_followed_or_else_the_measured_ones():
    table = {
        "area_cm2": {21.0: 100.0, 25.0: 144.0},
        "volume_ml": {21.0: 40.0, 25.0: 90.0},
    }
    followed = sizes_on_curves(
        {"model": "sizes", **table}, curves(), "volume", [21.0, 23.0]
    )
    assert followed[21.0] == pytest.approx({"area_cm2": 100, "volume_ml": 40})
    # logarithms are interpolated
    assert followed[23.0] == pytest.approx({"area_cm2": 120, "volume_ml": 60})
    measured = sizes_on_curves({"model": "rates"}, curves(), "volume", [23.0])
    assert measured[23.0] == pytest.approx(
        {"area_cm2": 90 * 1.21, "volume_ml": 46 * 1.44}, rel=5e-3
    )
    assert sizes_on_curves({"model": "rates"}, None, None, [23.0]) == {23.0: {}}
    with pytest.raises(InputError):
        sizes_on_curves({"model": "rates"}, curves(), "other", [23.0])


def test_a_given_table_shrinks_only_where_that_is_allowed():
    growth = MEASURED | {
        "area_cm2": {21: 90.0, 25: 80.0},
        "volume_ml": {21: 40.0, 25: 80.0},
    }
    with pytest.raises(InputError, check=Facts("area_cm2", 25)):
        followed_sizes(growth, None, None, [21.0, 22.0], False)
    assert followed_sizes(growth, None, None, [21.0, 22.0], True)["area_cm2"][22.0] < 90


def test_a_run_s_parameters_have_the_sizes_it_follows_and_the_shapes_it_grows_towards():
    weeks, surface = [21.0, 22.0], {"fissure_x_mm": 0.5, "side": "left"}
    settings = {
        "growth": MEASURED,
        "thickness_mm": 1.5,
        "end_week": 22.0,
    }
    growth = MEASURED | followed_sizes(MEASURED, curves(), "volume", weeks, False)
    found = params_content(settings, growth, weeks, surface, [], [])
    assert {
        name: found[name]
        for name in ("start_week", "output_weeks", "fissure_x_mm", "side", "end_week")
    } == {
        "start_week": 21.0,
        "output_weeks": weeks,
        "fissure_x_mm": 0.5,
        "side": "left",
        "end_week": 22.0,
    }
    assert found["growth"]["area_cm2"][22.0] == pytest.approx(99, rel=5e-3)
    assert "targets" not in found
    shapes = {
        "area_cm2": {21.0: 90.0, 23.0: 80.0},
        "volume_ml": {21.0: 40.0, 23.0: 60.0},
    }
    growth = followed_sizes(shapes, None, None, weeks, True)
    found = params_content({}, growth, weeks, surface, [23.0], [])
    assert found["targets"] == {23.0: "target_23.00"}
    assert found["growth"]["volume_ml"][22.0] == pytest.approx(
        np.sqrt(40 * 60), rel=1e-9
    )


# growth rates

WEEK_S = 604_800.0


@pytest.mark.parametrize("weeks", [1.0, 4.0])
def test_compound_rates_multiply_up_to_the_ratios(weeks: float) -> None:
    step_s = 600.0
    row = growth_rates([21, 21 + weeks], [9000.0, 14_000.0], [45_000.0, 80_000.0]).iloc[
        0
    ]
    length = core_length = 1.0
    for _ in range(round(weeks * WEEK_S / step_s)):
        length *= 1 + row["compound_rate_per_s"] * step_s
        core_length *= 1 + row["core_compound_rate_per_s"] * step_s
    assert length**2 == pytest.approx(14 / 9, rel=1e-3)
    assert core_length**3 == pytest.approx(16 / 9, rel=1e-3)
    # the rates that refer to the start of the interval would overshoot
    assert row["rate_per_s"] > row["compound_rate_per_s"]
    assert row["core_rate_per_s"] > row["core_compound_rate_per_s"]


def brains(series: str, rows: list[tuple[float, float, float, float]]) -> pd.DataFrame:
    """Return brains as the workflow's table has them: of each its week, area, volume
    and volume of tissue."""
    table = pd.DataFrame(rows, columns=["week", "area_cm2", "volume_ml", "tissue_ml"])
    return table.assign(series=series, subject="brain")


def test_each_series_has_rates_of_its_own_and_brains_of_one_week_are_their_mean() -> (
    None
):
    # in any order
    surface = brains(
        "surface", [(22, 121.0, 1331.0, 1200.0), (21, 100.0, 1000.0, 800.0)]
    )
    # two brains of one week, larger and smaller than their mean
    volume = brains(
        "volume",
        [
            (21, 90.0, 1100.0, 480.0),
            (23, 144.0, 1728.0, 550.0),
            (21, 110.0, 900.0, 400.0),
        ],
    )
    areas = pd.concat([surface, volume, surface.assign(series="cross-section")])
    table = rates_of_series(areas, ["surface", "volume"])
    assert table["series"].tolist() == ["surface", "volume"]
    np.testing.assert_allclose(table["rate_per_s"], [0.1 / WEEK_S, 0.1 / WEEK_S])
    np.testing.assert_allclose(table["core_rate_per_s"], [0.1 / WEEK_S, 0.1 / WEEK_S])
    np.testing.assert_allclose(
        table[["area_ratio", "volume_ratio"]], [[1.1**2, 1.1**3], [1.2**2, 1.2**3]]
    )
    np.testing.assert_allclose(table["tissue_ratio"], [1.5, 1.25])
    np.testing.assert_allclose(
        table["tissue_compound_rate_per_s"], np.log([1.5, 1.25]) / (3 * WEEK_S) / [1, 2]
    )
    assert table["to_week"].tolist() == [22, 23]


@pytest.mark.usefixtures("recorded_outputs")
def test_the_rule_writes_what_is_known_of_each_brain(tmp_path) -> None:
    for name, radius_mm, tissue_ml in zip(
        "abcd", (20.0, 22.0, 20.0, 21.0), (30.0, 40.0, None, None), strict=True
    ):
        write_surface(tmp_path / f"{name}.gii", sphere(radius_mm, 2))
        write_json(
            tmp_path / f"{name}.json",
            {"label_volumes_mL": {"tissue": tissue_ml}} if tissue_ml else {},
        )
    inputs = {
        "whole": [f"{name}.gii" for name in "abcd"],
        "reports": [f"{name}.json" for name in "abcd"],
    }
    known = {
        "series": ["mine", "mine", "atlas", "atlas"],
        "brains": [*"abcd"],
        "weeks": [21, 22, 21, 22],
    }
    run_script(
        "growth_rates.py",
        tmp_path,
        inputs,
        {"areas": "areas.csv", "rates": "rates.csv"},
        known | {"with_rates": ["mine", "atlas"]},
    )
    areas = pd.read_csv(tmp_path / "areas.csv")
    assert areas["subject"].tolist() == [*"abcd"]
    np.testing.assert_array_equal(areas["tissue_ml"], [30.0, 40.0, np.nan, np.nan])
    rates = pd.read_csv(tmp_path / "rates.csv").set_index("series")
    # radii grow as the square root of areas
    assert rates["rate_per_s"].tolist() == pytest.approx(
        [0.1 / WEEK_S, 0.05 / WEEK_S], rel=1e-5
    )
    assert rates.loc["mine", "tissue_ratio"] == pytest.approx(4 / 3)
    assert rates.loc["mine", "tissue_compound_rate_per_s"] == pytest.approx(
        np.log(4 / 3) / (3 * WEEK_S)
    )
    assert np.isnan(rates.loc["atlas", "tissue_ratio"])
    assert rates["cortex_ratio"].isna().all()


@pytest.mark.usefixtures("recorded_outputs")
def test_curves_of_each_series_are_written_with_the_errors_of_its_own(tmp_path) -> None:
    tables = []
    for name, factor in (("mine", 1.0), ("atlas", 1.4)):
        table = pd.DataFrame({"week": WEEKS, "area_cm2": 2 * factor * SCATTERED})
        volumes = np.where(WEEKS == 25, 0.8, 1.0) * factor * SCATTERED
        tables.append(table.assign(volume_ml=volumes, series=name))
    write_table(tmp_path / "areas.csv", pd.concat(tables))
    outputs = {"curves": "curves.csv", "errors": "errors.csv"}
    run_script("growth_curves.py", tmp_path, {0: "areas.csv"}, outputs)
    curves = read_table(tmp_path / "curves.csv").set_index(["series", "quantity"])
    for name, factor in (("mine", 1.0), ("atlas", 1.4)):
        for quantity, size in (("area_cm2", 2 * factor), ("volume_ml", factor)):
            curve = curves.loc[(name, quantity)]
            found = np.interp(WEEKS, curve["week"], curve["value"])
            assert found == pytest.approx(size * VOLUMES, rel=0.02)
            assert (curve["low"] < curve["value"]).all()
            assert (curve["value"] < curve["high"]).all()
    misfits = read_table(tmp_path / "errors.csv").set_index(
        ["series", "quantity", "week"]
    )
    for name in ("mine", "atlas"):
        leap = misfits.loc[(name, "volume_ml", 25.0), "error"]
        assert leap == pytest.approx(0.25, abs=0.03)
        assert abs(misfits.loc[(name, "area_cm2", 25.0), "error"]) < 0.02
