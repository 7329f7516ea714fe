"""The key `ensemble`: further runs with uncertain inputs varied, and how each of them
differs."""

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

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
    `difference_smoothing_mm`, `fading_gw` and `lasting` see `growth.expected`; the
    last is from 0 to 1, since it was never measured how much lasts.
    """

    number: int
    seed: int
    registration_smoothing: float
    age_shift_gw: float
    difference_smoothing_mm: float
    fading_gw: float
    lasting: float


def variations(members: int) -> list[Variation]:
    """Return the variation of each member of an ensemble, by a Latin hypercube: one
    sample per stratum."""
    random = np.random.default_rng(0)
    ages, *shares, lasting = (_quantiles(random, members) for _ in range(5))
    age_shift_gw = [AGE_SD_GW * NormalDist().inv_cdf(age) for age in ages]
    smoothing = _between(*SMOOTHING_RANGE, shares[0])
    difference_mm = _between(*DIFFERENCE_RANGE_MM, shares[1])
    fading_gw = _between(*FADING_RANGE_GW, shares[2])
    return [
        Variation(
            number=number,
            seed=number + 1,
            registration_smoothing=round(float(smoothing[number]), 2),
            age_shift_gw=round(age_shift_gw[number], 2),
            difference_smoothing_mm=float(difference_mm[number]),
            fading_gw=float(fading_gw[number]),
            lasting=round(float(lasting[number]), 2),
        )
        for number in range(members)
    ]


def _quantiles(random: np.random.Generator, members: int) -> NDArray[np.float64]:
    strata = random.permutation(members)
    return (strata + random.uniform(size=members)) / members


def _between(
    low: float,
    high: float,
    share: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the values at shares of the logarithmic way between two."""
    log_low, log_high = np.log((low, high))
    return np.exp(log_low + share * (log_high - log_low))
