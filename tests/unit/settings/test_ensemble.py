"""Members of an ensemble: which inputs differ, by how much, and that none goes with
another."""

import numpy as np
import pytest

from gyriflow.settings.ensemble import (
    AGE_SD_GW,
    DIFFERENCE_RANGE_MM,
    FADING_RANGE_GW,
    SMOOTHING_RANGE,
    variations,
)

INPUTS = (
    "age_shift_gw",
    "registration_smoothing",
    "difference_smoothing_mm",
    "fading_gw",
    "lasting",
)


def values_of(members: int) -> np.ndarray:
    """Return the (members, inputs) values of the members of an ensemble."""
    return np.array(
        [[getattr(member, name) for name in INPUTS] for member in variations(members)]
    )


def test_members_differ_in_each_input_by_itself():
    values = values_of(64)
    ranks = values.argsort(axis=0).argsort(axis=0)
    correlations = np.corrcoef(ranks.T) - np.eye(len(INPUTS))
    assert np.abs(correlations).max() < 0.5
    members = variations(64)
    assert [member.number for member in members] == list(range(64))
    assert len({member.seed for member in members}) == 64


def test_each_input_fills_its_range():
    shifts, *factors, lasting = values_of(64).T
    assert np.sort(lasting) == pytest.approx((np.arange(64) + 0.5) / 64, abs=0.02)
    # quantiles of a normal distribution, to two decimals
    assert shifts.mean() == pytest.approx(0.0, abs=0.02)
    assert shifts.std() == pytest.approx(AGE_SD_GW, rel=0.06)
    for values, (low, high) in zip(
        factors, (SMOOTHING_RANGE, DIFFERENCE_RANGE_MM, FADING_RANGE_GW), strict=True
    ):
        # a quarter of the members in each quarter of the range, by its logarithm
        place = np.log(values / low) / np.log(high / low)
        counts, _ = np.histogram(place, np.linspace(0.0, 1.0, 5))
        assert counts == pytest.approx(16, abs=2)
