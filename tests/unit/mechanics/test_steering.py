import math

import pytest

from gyriflow.mechanics.steering import (
    FIRST_SHARE,
    Aim,
    GrowthRates,
    realised_share,
    steered_rates,
    volume_gain,
)

NU = 0.45


def area_aim(week: float) -> float:
    return 99.0 * math.exp(0.10 * (week - 21) - 0.002 * (week - 21) ** 2)


def volume_aim(week: float) -> float:
    return 51.0 * math.exp(0.16 * (week - 21) - 0.004 * (week - 21) ** 2)


def follow(realised: float, thickness: float = 0.15, days: float = 1.0) -> list[tuple[float, float, float]]:
    """Returns week by step, and errors of area and volume, of a body with a known realised part of its growth.

    The body is a thin elastic layer on a core: the area takes the realised part of what the layer grows, what is held
    back thickens the layer by Poisson's effect, and the core's volume grows freely.
    """
    area, volume, share = area_aim(21), volume_aim(21), FIRST_SHARE
    cortex, step, rows = area * thickness, days / 7, []
    core = volume - cortex
    for number in range(round(5 / step)):
        week = 21 + (number + 1) * step
        aim = Aim(area, volume, area_aim(week), volume_aim(week), step)
        rates = steered_rates(aim, cortex / volume, share, poisson_ratio=NU)
        grown = area * math.exp(2 * realised * rates.tangential * step)
        cortex *= math.exp(2 * rates.tangential * (realised + (1 - realised) * NU / (1 - NU)) * step)
        core *= math.exp(3 * rates.core * step)
        share = realised_share(share, rates.tangential, area, grown, step)
        area, volume = grown, cortex + core
        rows.append((week, area / area_aim(week) - 1, volume / volume_aim(week) - 1))
    return rows


@pytest.mark.parametrize("realised", [0.35, 0.6, 0.9])
def test_both_curves_are_met_whatever_is_realised(realised):
    rows = follow(realised)
    assert max(abs(area) for week, area, _ in rows if week > 22) < 1e-3
    assert max(abs(volume) for week, _, volume in rows if week > 22) < 2e-3
    # even while the realised part is being learned, a step's error is made good by the next
    assert max(abs(area) for _, area, _ in rows) < 0.02


def test_without_steering_the_curve_is_missed():
    area = area_aim(21)
    for day in range(35):
        wanted = math.log(area_aim(21 + (day + 1) / 7) / area_aim(21 + day / 7))
        area *= math.exp(0.35 * wanted)
    assert area / area_aim(26) - 1 < -0.2


def test_rates_of_a_known_step():
    aim = Aim(100.0, 50.0, 101.0, 51.0, 0.5)
    rates = steered_rates(aim, 0.3, 0.5, poisson_ratio=1 / 3)
    # c = 0.5 + 0.5·0.5
    assert rates.tangential == pytest.approx(math.log(1.01) / 0.5)
    assert rates.core == pytest.approx((math.log(1.02) / 0.5 - 2 * rates.tangential * 0.75 * 0.3) / 2.1)
    assert not rates.limited
    assert volume_gain(1.0, NU) == 1.0
    assert volume_gain(0.0, 0.5) == 1.0
    assert volume_gain(0.25, 0.0) == 0.25


def test_ventricles_and_thickness_take_their_part():
    aim = Aim(100.0, 50.0, 100.0, 51.0, 1.0)
    rates = steered_rates(aim, 0.3, 0.6, poisson_ratio=NU, radial=0.02, ventricle_share=0.1, ventricle=0.05)
    assert rates.tangential == 0
    assert 0.3 * 0.02 + 0.1 * 3 * 0.05 + 0.6 * 3 * rates.core == pytest.approx(math.log(51 / 50))


def test_shrinking_bodies_are_followed():
    rates = steered_rates(Aim(100.0, 50.0, 99.0, 49.0, 1.0), 0.3, 0.6, poisson_ratio=NU)
    assert rates.tangential < 0
    assert rates.core < 0
    assert realised_share(0.6, -0.1, 100.0, 100 * math.exp(-0.2 * 0.9), 1.0) == pytest.approx(0.7 * 0.6 + 0.3 * 0.9)


def test_what_cannot_be_followed_is_told_and_the_core_makes_up_for_it():
    aim = Aim(100.0, 50.0, 120.0, 51.0, 1.0)
    free, cut = (steered_rates(aim, 0.3, 0.6, poisson_ratio=NU, bounds=bounds) for bounds in ((-1, 1), (0.0, 0.05)))
    assert cut == GrowthRates(0.05, cut.core, limited=True)
    assert not free.limited
    assert cut.core > free.core


def test_realised_share_is_learned_within_bounds_and_not_from_nothing():
    assert realised_share(0.6, 1e-6, 100.0, 105.0, 1.0) == 0.6
    assert realised_share(0.6, 0.1, 100.0, 200.0, 1.0) == 1.2
    assert realised_share(0.2, 0.1, 100.0, 90.0, 1.0) == 0.2


def test_sizes_that_are_none_are_refused():
    with pytest.raises(ValueError, match="must be positive"):
        steered_rates(Aim(100.0, 50.0, 101.0, 51.0, 1.0), 1.0, 0.6, poisson_ratio=NU)
