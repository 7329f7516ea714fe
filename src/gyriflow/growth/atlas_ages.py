"""Sizes and ages of an atlas: a smooth curve of its volume, and the week at which the curve has the size of each brain.

Stated ages of an atlas are imprecise: volume may jump between two weeks and then stagnate. Shape goes with volume more
than with the stated age, so a brain is used at the age of its size.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.optimize import isotonic_regression

from ..geometry.triangles import Floats
from .curves import Curve, fitted, rate, value

log = logging.getLogger(__name__)

MAX_AGE_ERROR_GW = 1.0
"""Difference between stated age and age by size above which it is warned of."""
MIN_AGE_SPACING_GW = 0.1
"""Smallest time between two brains of successive weeks."""


@dataclass(frozen=True, eq=False)
class AtlasAges:
    """The stated weeks (k,) of an atlas' brains, their volumes, the curve of volume, and their ages by size (k,)."""

    weeks: Floats
    volumes: Floats
    curve: Curve
    ages: Floats

    def volume(self, week: float) -> float:
        """Return the volume of the atlas at a week, in the unit of its brains' volumes."""
        return float(value(self.curve, week))

    def table(self) -> pd.DataFrame:
        """Return a row per brain: stated_week, age_by_size, volume_ml and curve_ml, the curve at the stated week."""
        curve = value(self.curve, self.weeks)
        return pd.DataFrame(
            {"stated_week": self.weeks, "age_by_size": self.ages, "volume_ml": self.volumes, "curve_ml": curve}
        )


def ages_by_size(
    weeks: Sequence[float], volumes_ml: Sequence[float], norm_ml: Sequence[float] | Floats = ()
) -> AtlasAges:
    """Return the ages by size of an atlas' brains with volumes in mL at two or more ascending weeks.

    The curve of volume is monotone and robust against single brains (`curves.fitted`). It is fitted to the atlas'
    volumes and, with the same weight, to the medians of a norm at these weeks, `norm_ml`, NaN where it has none. Each
    brain gets the week at which the curve has its volume; ages that do not ascend are replaced by their nearest
    ascending ones (isotonic regression). InputError if the atlas shrinks.
    """
    stated, volumes = np.asarray(weeks, dtype=float), np.asarray(volumes_ml, dtype=float)
    points = pd.DataFrame({"week": stated, "volume": volumes})
    if len(norm_ml):
        points = pd.concat([points, points.assign(volume=norm_ml).dropna()]).sort_values("week", kind="stable")
    curve = fitted(
        points["week"].tolist(), points["volume"].tolist(), name="volume of the atlas", keeps_first=True
    ).curve
    logs, sizes = np.log(curve.values), np.log(volumes)
    # the curve is flat where brains do not grow; beyond its ends ages follow its rate there, or its mean rate if higher
    inside = np.interp(sizes, logs + 1e-9 * np.arange(len(logs)), curve.weeks)
    mean_rate = (logs[-1] - logs[0]) / (curve.weeks[-1] - curve.weeks[0])
    end_rates = [max(float(rate(curve, curve.weeks[end])), mean_rate) for end in (0, -1)]
    ages = np.where(sizes < logs[0], curve.weeks[0] + (sizes - logs[0]) / end_rates[0], inside)
    ages = np.where(sizes > logs[-1], curve.weeks[-1] + (sizes - logs[-1]) / end_rates[1], ages)
    spacing = MIN_AGE_SPACING_GW * np.arange(len(ages))
    ages = isotonic_regression(ages - spacing).x + spacing
    for number in np.flatnonzero(np.abs(ages - stated) > MAX_AGE_ERROR_GW):
        text = "the brain of the atlas at %g GW has the size of %.1f GW, and its shape is used at that age"
        log.warning(text, stated[number], ages[number])
    return AtlasAges(stated, volumes, curve, ages)
