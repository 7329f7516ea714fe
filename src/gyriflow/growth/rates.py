"""Growth rates of the cortex and of the core between gestational weeks."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import InputError
from ..units import CM2_PER_MM2, ML_PER_MM3, SECONDS_PER_GW

FOLDING_RATES = {
    "growth_rate_per_s": "compound_rate_per_s",
    "core_growth_rate_per_s": "core_compound_rate_per_s",
}
"""Parameters of the folding that can be estimated, and the columns they come from."""


TISSUES = ("tissue", "ventricles", "cortex")
"""What labels know of the volume inside the pial surface; the volume itself contains the ventricles."""


def growth_rates(weeks: Sequence[float], areas_mm2: Sequence[float], volumes_mm3: Sequence[float]) -> pd.DataFrame:
    """Returns the growth rates between successive weeks, at least two different ones in any order, with positive sizes.

    The cortex grows in its surface: α = (θ^(1/2) − 1)/Δt with the growth multiplier θ = A₂/A₁ (the paper's equation,
    dim = 2), the core in volume: ((V₂/V₁)^(1/3) − 1)/Δt (dim = 3), with Δt the true time between the two weeks. These
    rates refer to the size at the start of the interval. The folding model grows by (1 + rate·dt) in every step: rates
    for it, which reproduce the ratios as long as steps are short, are ln(θ)/(2Δt) and ln(V₂/V₁)/(3Δt).

    Returns
    -------
    DataFrame
        from_week, to_week, area_ratio (θ), rate_per_s, compound_rate_per_s, volume_ratio, core_rate_per_s,
        core_compound_rate_per_s, by ascending week.
    """
    order = np.argsort(weeks)
    week, area, volume = (np.asarray(column, dtype=float)[order] for column in (weeks, areas_mm2, volumes_mm3))
    seconds = np.diff(week) * SECONDS_PER_GW
    area_ratio, volume_ratio = area[1:] / area[:-1], volume[1:] / volume[:-1]
    return pd.DataFrame(
        {
            "from_week": week[:-1],
            "to_week": week[1:],
            "area_ratio": area_ratio,
            "rate_per_s": (area_ratio ** (1 / 2) - 1) / seconds,
            "compound_rate_per_s": np.log(area_ratio) / (2 * seconds),
            "volume_ratio": volume_ratio,
            "core_rate_per_s": (volume_ratio ** (1 / 3) - 1) / seconds,
            "core_compound_rate_per_s": np.log(volume_ratio) / (3 * seconds),
        }
    )


def rates_of_series(areas: pd.DataFrame) -> pd.DataFrame:
    """Returns the growth rates of each series of brains: the table of `growth_rates` under its name, in `series`.

    Areas have the columns series, week, area_cm2, volume_ml; brains of one week and series count as their mean. Where
    they have tissue_ml, ventricles_ml and cortex_ml, from labels, the table has tissue_ratio, … and
    tissue_compound_rate_per_s, …, ln(V₂/V₁)/(3Δt), too; NaN where they are not known.
    """
    tables = []
    for name, brains in areas.groupby("series", sort=False):
        weekly = brains.groupby("week")[["area_cm2", "volume_ml"]].mean()
        areas_mm2, volumes_mm3 = weekly["area_cm2"] / CM2_PER_MM2, weekly["volume_ml"] / ML_PER_MM3
        rates = growth_rates(weekly.index.tolist(), areas_mm2.tolist(), volumes_mm3.tolist())
        rates.insert(0, "series", name)
        seconds = (rates["to_week"] - rates["from_week"]) * SECONDS_PER_GW
        for tissue in TISSUES:
            if f"{tissue}_ml" in brains:
                known = brains.groupby("week")[f"{tissue}_ml"].mean().to_numpy(dtype=float)
                rates[f"{tissue}_ratio"] = known[1:] / known[:-1]
                rates[f"{tissue}_compound_rate_per_s"] = np.log(rates[f"{tissue}_ratio"]) / (3 * seconds)
        tables.append(rates)
    return pd.concat(tables, ignore_index=True)


def agreement(areas: pd.DataFrame) -> pd.DataFrame:
    """Returns how far series of brains agree with the first one: differences of their rates between common weeks.

    Rates are taken between the successive weeks that both series have, so that the intervals are the same. Areas are as
    for `rates_of_series`.

    Returns
    -------
    DataFrame
        series, reference (the first series), from_week, to_week, rate_per_s, reference_rate_per_s, difference_per_s
        (the series' rate less the reference's), and the same three with core_ in front. No row where series have no two
        common weeks.
    """
    names = list(dict.fromkeys(areas["series"]))
    columns = ["series", "reference", "from_week", "to_week"]
    columns += [f"{kind}{of}_per_s" for kind in ("", "core_") for of in ("rate", "reference_rate", "difference")]
    tables = [pd.DataFrame(columns=columns)]
    for name in names[1:]:
        pair = [areas[areas["series"] == series] for series in (name, names[0])]
        weeks = set(pair[0]["week"]) & set(pair[1]["week"])
        if len(weeks) > 1:
            table, others = (rates_of_series(brains[brains["week"].isin(weeks)]) for brains in pair)
            for kind in ("", "core_"):
                table[f"{kind}reference_rate_per_s"] = other = others[f"{kind}rate_per_s"]
                table[f"{kind}difference_per_s"] = table[f"{kind}rate_per_s"] - other
            tables.append(table.assign(reference=names[0])[columns])
    return pd.concat(tables[1:] or tables, ignore_index=True)


def rate_curve(
    rates: pd.DataFrame, column: str, *, allow_negative: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the weeks and the values (1/s) of a column of `growth_rates`, each rate in the middle of its interval.

    The rate is linear in between and constant outside. InputError where rates are negative and must not be, all such
    intervals named.
    """
    below = rates[rates[column] < 0]
    if len(below) and not allow_negative:
        intervals = [
            f"{rate:.3g} 1/s from week {start:g} to {end:g}"
            for start, end, rate in zip(below["from_week"], below["to_week"], below[column], strict=True)
        ]
        raise InputError(
            f"the estimated growth is negative ({column})",
            found=", ".join(intervals),
            expected="0 or more",
            remedy="Leave the brain that does not fit out of growth.brains, or set allow_negative_growth: true.",
        )
    middle = (rates["from_week"] + rates["to_week"]) / 2
    return middle.to_numpy(dtype=float), rates[column].to_numpy(dtype=float)
