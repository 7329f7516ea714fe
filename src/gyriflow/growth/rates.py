"""Growth rates of the cortex and of the core between gestational weeks."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import InputError
from ..units import SECONDS_PER_GW

FOLDING_RATES = {
    "growth_rate_per_s": "compound_rate_per_s",
    "core_growth_rate_per_s": "core_compound_rate_per_s",
}
"""Parameters of the folding that can be estimated, and the columns they come from."""


def growth_rates(weeks: Sequence[float], areas_mm2: Sequence[float], volumes_mm3: Sequence[float]) -> pd.DataFrame:
    """Returns the growth rates between successive weeks.

    The cortex grows in its surface: α = (θ^(1/2) − 1)/Δt with the growth multiplier θ = A₂/A₁ (the paper's equation,
    dim = 2). The core grows in volume: ((V₂/V₁)^(1/3) − 1)/Δt, the same equation with dim = 3. Δt is the true time
    between the two weeks, so that a gap of several weeks gives the mean rate over it.

    These rates refer to the size at the start of the interval. The folding model grows by (1 + rate·dt) in every step,
    so that its growth compounds: rates for it are ln(θ)/(2Δt) and ln(V₂/V₁)/(3Δt), which reproduce the ratios as long
    as the steps are short.

    Parameters
    ----------
    weeks
        Gestational weeks, at least two, in any order.
    areas_mm2, volumes_mm3
        Cortical area and brain volume of each week.

    Returns
    -------
    DataFrame
        from_week, to_week, area_ratio (θ), rate_per_s, compound_rate_per_s, volume_ratio, core_rate_per_s,
        core_compound_rate_per_s, by ascending week.

    InputError where a week is there twice, or a number is missing or not positive.
    """
    columns = {"weeks": weeks, "areas_mm2": areas_mm2, "volumes_mm3": volumes_mm3}
    values = {name: np.asarray(column, dtype=float) for name, column in columns.items()}
    lengths = {name: len(column) for name, column in values.items()}
    if len(set(lengths.values())) > 1:
        raise InputError("each week needs an area and a volume", found=lengths)
    for name, column in values.items():
        if not (np.isfinite(column) & (column > 0)).all():
            raise InputError(f"{name} that are not positive numbers", found=column.tolist())
    if len(values["weeks"]) < 2:
        raise InputError(
            "a growth rate is between two ages",
            found=f"{len(values['weeks'])} brain(s)",
            expected="at least two",
            remedy="List brains of other weeks under `brains`",
        )
    order = np.argsort(values["weeks"], kind="stable")
    week, area, volume = (values[name][order] for name in columns)
    twice = week[1:][np.diff(week) == 0]
    if len(twice):
        raise InputError(
            "several brains of one week",
            found=f"week {twice[0]:g} more than once",
            expected="one brain per week",
            remedy="Leave all but one out of the growth rates",
        )
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


def rate_curve(
    rates: pd.DataFrame, column: str, *, allow_negative: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the weeks and the values (1/s) of a growth rate over time: each interval's rate stands at its middle.

    In between the rate is meant to be linear, before the first and after the last middle constant.

    Parameters
    ----------
    rates
        Table of `growth_rates`.
    column
        Name of the rate's column.
    allow_negative
        Whether a rate may be below 0.

    InputError where a rate is negative and must not be, all such intervals named.
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
