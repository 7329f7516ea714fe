"""Growth rates of areas and volumes made with known rates."""

import numpy as np
import pandas as pd
import pytest
from scripts import run_script
from shapes import sphere

from gyriflow.growth.rates import growth_rates, rates_of_series
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import write_surface

WEEK_S = 604_800.0


def test_rates_are_those_the_areas_were_made_with() -> None:
    rate, core_rate = 2e-7, 1.2e-7
    areas = [9000.0, 9000.0 * (1 + rate * WEEK_S) ** 2]
    volumes = [45_000.0, 45_000.0 * (1 + core_rate * WEEK_S) ** 3]
    # in any order
    table = growth_rates([22, 21], areas[::-1], volumes[::-1])
    ends, area, volume = ("from_week", "to_week"), ("area_ratio", "rate_per_s"), ("volume_ratio", "core_rate_per_s")
    assert [*table] == [*ends, *area, "compound_rate_per_s", *volume, "core_compound_rate_per_s"]
    row = table.iloc[0]
    assert row["rate_per_s"] == pytest.approx(rate)
    assert row["core_rate_per_s"] == pytest.approx(core_rate)
    assert row["area_ratio"] == pytest.approx(areas[1] / areas[0])


@pytest.mark.parametrize("weeks", [1.0, 4.0])
def test_compound_rates_multiply_up_to_the_ratios(weeks: float) -> None:
    step_s = 600.0
    row = growth_rates([21, 21 + weeks], [9000.0, 14_000.0], [45_000.0, 80_000.0]).iloc[0]
    length = core_length = 1.0
    for _ in range(round(weeks * WEEK_S / step_s)):
        length *= 1 + row["compound_rate_per_s"] * step_s
        core_length *= 1 + row["core_compound_rate_per_s"] * step_s
    assert length**2 == pytest.approx(14 / 9, rel=1e-3)
    assert core_length**3 == pytest.approx(16 / 9, rel=1e-3)
    # the rates that refer to the start of the interval would overshoot
    assert row["rate_per_s"] > row["compound_rate_per_s"]
    assert row["core_rate_per_s"] > row["core_compound_rate_per_s"]


def brains(series: str, areas_cm2: dict[float, float], volumes_ml: dict[float, float]) -> pd.DataFrame:
    """Return areas and volumes by week as the workflow's table has them."""
    columns = {"week": list(areas_cm2), "area_cm2": list(areas_cm2.values()), "volume_ml": list(volumes_ml.values())}
    return pd.DataFrame({"series": series, "subject": "brain", **columns})


def test_each_series_has_rates_of_its_own_and_brains_of_one_week_are_their_mean() -> None:
    surface = brains("surface", {21: 100.0, 22: 121.0}, {21: 1000.0, 22: 1331.0})
    volume = pd.concat(
        [
            brains("volume", {21: 90.0, 23: 144.0}, {21: 1000.0, 23: 1728.0}),
            brains("volume", {21: 110.0}, {21: 1000.0}),
        ]
    )
    table = rates_of_series(pd.concat([surface, volume]))
    assert table["series"].tolist() == ["surface", "volume"]
    np.testing.assert_allclose(table["rate_per_s"], [0.1 / WEEK_S, 0.1 / WEEK_S])
    np.testing.assert_allclose(table["core_rate_per_s"], [0.1 / WEEK_S, 0.1 / WEEK_S])
    assert table["to_week"].tolist() == [22, 23]


def test_the_rule_writes_what_is_known_of_each_brain(tmp_path) -> None:
    for name, radius_mm, tissue_ml in zip("abcd", (20.0, 22.0, 20.0, 21.0), (30.0, 40.0, None, None), strict=True):
        write_surface(tmp_path / f"{name}.gii", sphere(radius_mm, 2))
        write_json(tmp_path / f"{name}.json", {"label_volumes_mL": {"tissue": tissue_ml}} if tissue_ml else {})
    write_json(tmp_path / "thickness.json", {"mean_mm": 1.8})
    inputs = {"whole": [f"{name}.gii" for name in "abcd"], "reports": [f"{name}.json" for name in "abcd"]}
    known = {"series": ["mine", "mine", "atlas", "atlas"], "brains": [*"abcd"], "weeks": [21, 22, 21, 22]}
    run_script(
        "growth_rates.py",
        tmp_path,
        inputs | {"thickness": ["thickness.json"]},
        {"areas": "areas.csv", "rates": "rates.csv"},
        known | {"with_thickness": ["b"]},
    )
    areas = pd.read_csv(tmp_path / "areas.csv")
    assert areas["subject"].tolist() == [*"abcd"]
    assert areas["thickness_mm"].isna().tolist() == [True, False, True, True]
    np.testing.assert_array_equal(areas["tissue_ml"], [30.0, 40.0, np.nan, np.nan])
    rates = pd.read_csv(tmp_path / "rates.csv").set_index("series")
    # radii grow as the square root of areas
    assert rates["rate_per_s"].tolist() == pytest.approx([0.1 / WEEK_S, 0.05 / WEEK_S], rel=1e-5)
    assert rates.loc["mine", "tissue_ratio"] == pytest.approx(4 / 3)
    assert rates.loc["mine", "tissue_compound_rate_per_s"] == pytest.approx(np.log(4 / 3) / (3 * WEEK_S))
    assert np.isnan(rates.loc["atlas", "tissue_ratio"])
    assert rates["cortex_ratio"].isna().all()
