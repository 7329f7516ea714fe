"""Ages of brains whose metrics are written down by formula."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from gyriflow.config.metrics import LEAST_AGE_WEEKS
from gyriflow.errors import InputError
from gyriflow.metrics import age_profile as profiles
from gyriflow.metrics.age_metrics import comparable_metrics
from gyriflow.metrics.age_profile import LEAST_WEEKS, age_profile_check, week_similarity

WEEKS = np.arange(21.0, 29.0)
REFERENCE = [f"brain{week:g}" for week in WEEKS]

# what the week does to a brain of length 1: size, folds, a change of shape that does not follow age
METRICS: dict[str, tuple[str, Callable[[float], float]]] = {
    "volume": ("mL", lambda week: 0.1 * (week - 10) ** 3),
    "area": ("cm2", lambda week: (week - 10) ** 2),
    "gyrification_index": ("1", lambda week: 1 + 0.05 * (week - 20)),
    "mean_curvedness": ("1/mm", lambda week: 1 / (week - 10)),
    "sulcal_area_share": ("1", lambda week: 0.2 + 0.02 * (week % 2)),
    "spangy_modes": ("1", lambda week: 100 * week),
    **{
        f"spangy_B{band}_power": ("mm2", lambda week, band=band: (1 + (band == 4) * (week - 20)) * (week - 10) ** 2)
        for band in range(6)
    },
    "spangy_B4_relative_power": ("1", lambda week: week),
}
POWERS_OF_LENGTH = {"mL": 3, "cm2": 2, "1": 0, "1/mm": -1, "mm2": 2}


def age_profile(metrics: pd.DataFrame, spectra: pd.DataFrame, reference: list[str], **options) -> pd.DataFrame:
    check = age_profile_check(metrics, spectra, reference)
    return profiles.age_profile(metrics, spectra, reference, check, **options)


def brain(subject: str, run: str, week: float, *, like: float, scale: float = 1.0, bands: int = 4) -> tuple:
    """Returns the tables of a brain that looks like a week, scaled up; bands beyond `bands` are cut off."""
    sides = [(side, name, *METRICS[name]) for side in ("whole", "left", "right") for name in METRICS]
    rows = [
        (subject, run, week, side, name, scale ** POWERS_OF_LENGTH[unit] * value(like), unit)
        for side, name, unit, value in sides
        if side != "whole" or not name.startswith("spangy")
    ]
    spectra = [(subject, run, week, side, k, k <= bands, True) for side in ("left", "right") for k in range(7)]
    return (
        pd.DataFrame(rows, columns=["subject", "run", "week", "hemisphere", "metric", "value", "unit"]),
        pd.DataFrame(spectra, columns=["subject", "run", "week", "hemisphere", "band", "complete", "resolved"]),
    )


def study(*others: tuple, instead: dict[float, float] | None = None) -> tuple[pd.DataFrame, pd.DataFrame, list[str]]:
    """Returns the tables of the reference and of other brains; `instead` gives weeks that look like others."""
    known = [brain(f"brain{week:g}", "real", week, like=(instead or {}).get(week, week)) for week in WEEKS]
    metrics, spectra = zip(*known, *others, strict=True)
    return pd.concat(metrics, ignore_index=True), pd.concat(spectra, ignore_index=True), REFERENCE


def rows_of(table: pd.DataFrame, **values: object) -> pd.DataFrame:
    for name, value in values.items():
        table = table[table[name] == value]
    return table.set_index("metric")


def test_a_brain_is_given_the_week_that_it_looks_like() -> None:
    profile = age_profile(*study(brain("brain21", "slow", 27.0, like=24.5)))
    assert set(profile["run"]) == {"slow"}
    for side in ("whole", "left", "right"):
        found = rows_of(profile, hemisphere=side)
        together = found.loc[["all", "all without size", "size alone"]]
        assert together["estimated_week"].to_numpy() == pytest.approx(24.5, abs=0.1)
        assert (found.loc[["all", "volume", "gyrification_index"], "flag"] == "ok").all()
        assert together["weight"].to_numpy() == pytest.approx(1.0)


def test_metrics_free_of_size_do_not_see_a_scaled_brain() -> None:
    profile = age_profile(*study(brain("brain21", "large", 23.0, like=23.0, scale=1.3)))
    found = rows_of(profile, hemisphere="whole")
    assert found.loc["all without size", "estimated_week"] == pytest.approx(23.0, abs=0.1)
    free = found[found["kind"] == "size-free"]
    ages = free.loc[free["weight"] > 0.01, "estimated_week"]
    assert len(ages) > 3
    assert ages.to_numpy() == pytest.approx(23.0, abs=0.2)
    # 13 units of length times 1.3 are 16.9, the length of week 26.9
    assert found.loc["size alone", "estimated_week"] == pytest.approx(26.9, abs=0.2)


def test_metrics_that_disagree_are_flagged() -> None:
    # the folds of week 22 in a brain of the size of week 28
    profile = age_profile(*study(brain("brain21", "mixed", 25.0, like=22.0, scale=18 / 12)))
    found = rows_of(profile, hemisphere="left")
    assert found.loc["all", "flag"] == "metrics disagree"
    assert found.loc["all without size", "flag"] == "ok"
    assert found.loc["all", "spread_high"] - found.loc["all", "spread_low"] > 3.5
    # the range is how far reference brains left out are off, however the metrics agree
    assert found.loc["all", "high"] - found.loc["all", "low"] < 1.0


def test_metrics_without_age_have_no_weight() -> None:
    found = rows_of(age_profile(*study(brain("brain21", "reference", 23.0, like=23.0))), hemisphere="left")
    # a curvature that follows size only says nothing once size is taken out
    none = found.loc[["mean_curvedness_scaled", "sulcal_area_share", "area_scaled"]]
    assert none["weight"].tolist() == [0.0] * 3
    assert none["flag"].tolist() == ["no age signal"] * 3
    assert found.loc["mean_curvedness", "weight"] > 0.01
    assert "spangy_modes" not in found.index
    assert found.loc[found["kind"] != "together", "weight"].sum() == pytest.approx(1.0)


def test_brains_beyond_the_reference_are_flagged() -> None:
    others = brain("brain21", "young", 21.0, like=18.0), brain("brain21", "old", 36.0, like=36.0)
    found = age_profile(*study(*others)).query("hemisphere == 'whole' and metric == 'all'").set_index("run")
    assert found["flag"].to_dict() == {"young": "younger than 21", "old": "older than 28"}
    assert found["estimated_week"].to_dict() == {"young": 21.0, "old": 28.0}


def test_bands_that_are_cut_off_are_left_out() -> None:
    profile = age_profile(*study(brain("brain21", "coarse", 23.0, like=23.0, bands=3)))
    found = rows_of(profile, hemisphere="whole")
    # B5 is cut off in the reference, B4 in this brain: no shares, as their sum lacks it
    assert not [metric for metric in found.index if "B5" in metric or "B6" in metric or "relative" in metric]
    assert found.loc["spangy_B4_share", "flag"] == found.loc["spangy_B2_share", "flag"] == "not measured"
    assert found.loc["spangy_B2_power", "estimated_week"] == pytest.approx(23.0, abs=0.1)
    assert found.loc["all without size", "estimated_week"] == pytest.approx(23.0, abs=0.1)
    assert found.loc["all without size", "weight"] < 0.9


def test_shares_and_scaled_metrics() -> None:
    metrics, spectra, reference = study()
    values = comparable_metrics(metrics, spectra, reference).query("subject == 'brain23' and hemisphere == 'whole'")
    value = values.set_index("metric")["value"]
    # B1 to B4 have 1, 1, 1 and 1 + 3 parts
    assert value["spangy_B4_share"] == pytest.approx(4 / 7)
    assert value["spangy_B1_share"] == pytest.approx(1 / 7)
    # a volume of 0.1 · 13³ mL has a cube root of 13 · 100^(1/3) mm
    assert value["area_scaled"] == pytest.approx(1 / 100 ** (2 / 3))
    assert value["mean_curvedness_scaled"] == pytest.approx(100 ** (1 / 3))


def test_reference_weeks_left_out_in_turn() -> None:
    check = age_profile_check(*study())
    found = check.query("hemisphere == 'whole' and metric == 'all'").set_index("week")
    assert found.index.tolist() == WEEKS.tolist()
    assert found.loc[22.0:27.0, "error"].abs().max() < 0.15
    assert found["inside"].tolist() == [False, *[True] * 6, False]
    # without its own week the first brain can only be of the second
    assert found.loc[[21.0, 28.0], "estimated_week"].tolist() == pytest.approx([22.0, 27.0], abs=0.05)
    assert found.loc[[21.0, 28.0], "flag"].tolist() == ["younger than 22", "older than 27"]
    assert found["guess_error"].tolist() == pytest.approx([1.5] * 8)
    inside = found[found["inside"]]
    assert found["mean_absolute_error"].tolist() == pytest.approx([inside["error"].abs().mean()] * 8)


def test_a_brain_is_told_by_the_others_alone() -> None:
    check = age_profile_check(*study(instead={24.0: 26.0}))
    found = check.query("hemisphere == 'left' and metric == 'all'").set_index("week")
    assert found.loc[24.0, "error"] == pytest.approx(2.0, abs=0.15)


def test_metrics_that_growth_follows_take_no_part() -> None:
    # the size of week 28 was put in, the folds are those of week 23
    tables = study(brain("brain21", "steered", 28.0, like=23.0, scale=18 / 13))
    found = rows_of(age_profile(*tables, followed={"steered": ("area", "volume")}), hemisphere="whole")
    assert found.loc[["area", "volume", "area_scaled"], "flag"].tolist() == ["growth follows it"] * 3
    assert found.loc["all without size", "estimated_week"] == pytest.approx(23.0, abs=0.2)
    free = rows_of(age_profile(*tables), hemisphere="whole")
    assert (free.loc[["area", "volume"], "flag"] == "ok").all() or (free.loc["area", "estimated_week"] > 27.0)
    similar = week_similarity(*tables, followed={"steered": ("area", "volume")}).query("run == 'steered'")
    assert similar["metrics"].max() < week_similarity(*tables).query("run == 'steered'")["metrics"].max()


def test_ranges_that_reach_an_end_are_flagged() -> None:
    # a noisy metric of a brain of the last week: half of its range is beyond the reference
    tables = study(brain("brain21", "late", 28.0, like=28.0), instead={23.0: 24.0, 26.0: 25.0})
    found = rows_of(age_profile(*tables), hemisphere="whole")
    assert found.loc["volume", "flag"] == "range cut at the end"
    assert found.loc["all", "flag"] == "range cut at the end"


def test_one_brain_a_week_is_said() -> None:
    assert (age_profile(*study(brain("brain21", "slow", 27.0, like=24.5)))["brains_per_week"] == 1).all()


def test_many_metrics_of_one_family_count_as_one() -> None:
    # ten copies of a metric that says week 27 beside one family that says 23
    metrics, spectra, reference = study(brain("brain21", "odd", 25.0, like=23.0))
    rows = metrics[metrics["metric"] == "mean_curvedness"]
    copies = [rows.assign(metric=f"mean_sulcal_depth_{i}", value=1 / rows["value"], unit="mm") for i in range(10)]
    for copy in copies:
        copy.loc[copy["run"] == "odd", "value"] = 27.0 - 10.0
    found = rows_of(age_profile(pd.concat([metrics, *copies]), spectra, reference), hemisphere="whole")
    depth = found[found.index.str.startswith("mean_sulcal_depth") & ~found.index.str.endswith("_scaled")]
    assert len(depth) == 10
    assert depth["weight"].sum() < 0.35
    assert found.loc["all", "estimated_week"] == pytest.approx(23.0, abs=0.3)


def test_similarity_is_highest_at_the_week_it_looks_like() -> None:
    noisy = {22.0: 22.3, 24.0: 23.8, 26.0: 26.2}
    tables = study(brain("brain21", "slow", 27.0, like=25.0), brain("brain21", "alien", 25.0, like=60.0), instead=noisy)
    found = week_similarity(*tables)
    whole = found[found["hemisphere"] == "whole"].set_index(["run", "reference_week"])["similarity"]
    assert whole["slow"].idxmax() == 25.0
    assert whole["slow"].max() > 0.6
    # a brain that is like no week is near to none, though an age would name the nearest
    assert whole["alien"].max() < 0.1
    assert found["similarity"].between(0, 1).all()


def test_refused() -> None:
    metrics, spectra, reference = study()
    with pytest.raises(InputError, match=r"too few reference brains.*21, 22, 23, 24; expected 5"):
        age_profile(metrics, spectra, reference[:4])
    with pytest.raises(InputError, match=r"dimension.*found furlong"):
        age_profile(metrics.assign(unit="furlong"), spectra, reference)
    assert LEAST_WEEKS == LEAST_AGE_WEEKS
