"""The key `ensemble`: further runs with uncertain inputs varied, and how each of them
differs."""

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from pydantic import ConfigDict, Field

from .base import Settings

SMOOTHING_RANGE = (0.7, 1.5)
"""Factors of the smoothing in registrations."""
DIFFERENCE_RANGE_MM = (4.0, 16.0)
"""Smoothing (SD) of the individual difference."""
FADING_RANGE_GW = (1.0, 16.0)
"""Time constants with which finer individual differences fade."""


AGE_SD_GW = 0.3
"""Error of the start brain's age (SD): two days, as of dating by ultrasound in the
first trimester."""


@dataclass(frozen=True)
class Variation:
    """The inputs of a member of an ensemble that differ from those of its run.

    `number` counts the members from 0, `seed` is the random seed of the label
    perturbation, `registration_smoothing` a factor of the registration's smoothing.
    Predictions only: `age_shift_gw` is added to the start brain's age; for
    `difference_smoothing_mm` and `fading_gw` see `growth.expected`.
    """

    number: int
    seed: int
    registration_smoothing: float
    age_shift_gw: float
    difference_smoothing_mm: float
    fading_gw: float


class Ensemble(Settings):
    """Repeat a run with perturbed inputs to get prediction intervals. `ensemble: 8` is
    short for `{members: 8}`.

    Members differ in registrations (smoothing; label boundaries), and in predictions
    also in the age of the start brain, the atlas, if several atlases cover the run, and
    the individual differences that persist.
    """

    model_config = ConfigDict(json_schema_extra={"type": ["object", "integer", "null"]})
    short_key = ("members", int)

    members: int = Field(8, ge=3, le=64)
    """Number of members."""
    seed: int = Field(0, ge=0)
    """Seed of the variations."""

    @property
    def variations(self) -> list[Variation]:
        """The variation of each member, by a Latin hypercube: one sample per
        stratum."""
        random, n = np.random.default_rng(self.seed), self.members
        quantiles = [
            (random.permutation(n) + random.uniform(size=n)) / n for _ in range(4)
        ]
        log_ranges = [
            np.log(ends)
            for ends in (SMOOTHING_RANGE, DIFFERENCE_RANGE_MM, FADING_RANGE_GW)
        ]
        scaled = [
            np.exp(low + q * (high - low))
            for q, (low, high) in zip(quantiles[1:], log_ranges, strict=True)
        ]
        return [
            Variation(
                number=number,
                seed=self.seed * n + number + 1,
                registration_smoothing=round(float(smoothing), 2),
                age_shift_gw=round(AGE_SD_GW * NormalDist().inv_cdf(float(age)), 2),
                difference_smoothing_mm=float(difference),
                fading_gw=float(fading),
            )
            for number, (age, smoothing, difference, fading) in enumerate(
                zip(quantiles[0], *scaled, strict=True)
            )
        ]
