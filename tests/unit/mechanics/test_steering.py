import math
from dataclasses import replace

import pytest

from gyriflow.mechanics.steering import (
    FIRST_GAIN,
    Aim,
    GrowthRates,
    Response,
    free_response,
    steered_rates,
)

BRAIN = Response((1.09, 1.12), (1.25, 1.75), area_else=-0.02, volume_else=0.001)


def made_by(response: Response, aim: Aim, rates: GrowthRates) -> tuple[float, float]:
    """Returns area and volume after a step of a body with a response."""
    area, volume = response.rates(rates)
    return aim.area * math.exp(area * aim.duration), aim.volume * math.exp(volume * aim.duration)


@pytest.mark.parametrize("growth", [(0.02, 0.015), (-0.01, -0.02), (0.03, 0.0), (0.0, 0.02)])
def test_a_body_whose_response_is_known_meets_its_aim(growth):
    sizes = made_by(BRAIN, Aim(100.0, 50.0, 1.0, 1.0, 0.5), GrowthRates(*growth, limited=False))
    rates = steered_rates(Aim(100.0, 50.0, *sizes, 0.5), BRAIN)
    assert (rates.tangential, rates.core) == pytest.approx(growth)
    assert not rates.limited


def test_uniform_growth_is_asked_for_where_a_body_is_to_keep_its_shape():
    response = free_response(2.0, 1.2, 1.8)
    rates = steered_rates(Aim(100.0, 50.0, 100 * math.exp(0.02), 50 * math.exp(0.03), 1.0), response)
    assert (rates.tangential, rates.core) == pytest.approx((0.01, 0.01))
    # both add up to free growth, and the cortex has more of the area than of the volume
    assert sum(response.area) == pytest.approx(2.0)
    assert response.area[0] / 2.0 == pytest.approx(1.2 / 3.0 + FIRST_GAIN)


def test_bounds_leave_the_volume_on_its_curve():
    # more area than the core, which may not shrink, leaves room for
    aim = Aim(100.0, 50.0, 106.0, 53.0, 1.0)
    assert steered_rates(aim, BRAIN, (-1.0, 1.0)).core < 0
    cut = steered_rates(aim, BRAIN, (0.0, 1.0))
    assert (cut.core, cut.limited) == (0.0, True)
    area, volume = made_by(BRAIN, aim, cut)
    assert volume == pytest.approx(53.0)
    assert 100.0 < area < 106.0
    # less area than the volume makes: the core grows by itself
    cut = steered_rates(Aim(100.0, 50.0, 98.0, 52.0, 1.0), BRAIN, (0.0, 1.0))
    assert (cut.tangential, cut.limited) == (0.0, True)
    assert made_by(BRAIN, aim, cut)[1] == pytest.approx(52.0)
    # neither can be followed down
    assert steered_rates(Aim(100.0, 50.0, 99.0, 49.0, 1.0), BRAIN, (0.0, 1.0)) == GrowthRates(0.0, 0.0, True)


def test_a_ball_whose_area_follows_its_volume_is_not_torn():
    ball = Response((0.8, 1.2), (1.2, 1.8))
    rates = steered_rates(Aim(100.0, 50.0, 101.0, 50.5, 1.0), ball)
    assert made_by(ball, Aim(100.0, 50.0, 101.0, 50.5, 1.0), rates)[1] == pytest.approx(50.5)
    assert abs(rates.tangential - rates.core) < 0.1


def test_two_tries_of_a_step_tell_how_a_body_answers():
    aim = Aim(100.0, 50.0, 103.0, 52.0, 1.0)
    believed = free_response(2.2, 1.25, 1.75)
    first = steered_rates(aim, believed)
    found = BRAIN.rates(first)
    # the first try says how far it is off, the second by which slope
    known = believed.agreeing(first, found)
    assert known.rates(first) == pytest.approx(found)
    second = steered_rates(aim, known)
    taught = known.corrected(first, found, second, BRAIN.rates(second)).agreeing(second, BRAIN.rates(second))
    assert taught.rates(first) == pytest.approx(found)
    assert taught.rates(second) == pytest.approx(BRAIN.rates(second))
    errors = [abs(made_by(BRAIN, aim, rates)[0] / 103.0 - 1) for rates in (first, second, steered_rates(aim, taught))]
    assert errors[0] > 0.01
    assert errors[1] < errors[0] / 2
    assert errors[2] < 1e-5


def test_tries_that_hardly_differ_or_contradict_growth_teach_nothing():
    rates = GrowthRates(0.01, 0.01, limited=False)
    near = GrowthRates(0.01 + 1e-6, 0.01, limited=False)
    found = BRAIN.rates(rates)
    assert BRAIN.corrected(rates, found, near, (1.0, 1.0)) == BRAIN
    # a volume that falls with growth
    far = GrowthRates(0.02, 0.01, limited=False)
    assert BRAIN.corrected(rates, found, far, (found[0], found[1] - 0.1)) == BRAIN


def test_what_was_learnt_is_kept_as_numbers():
    free = free_response(2.0, 1.2, 1.8, area_else=0.01)
    kept = list((BRAIN - free).values)
    assert (free + Response.of(kept)).values == pytest.approx(BRAIN.values)


def test_sizes_that_are_none_are_refused():
    aim = Aim(100.0, 50.0, 101.0, 51.0, 1.0)
    for wrong in (replace(aim, area=0.0), replace(aim, duration=0.0), replace(aim, next_volume=-1.0)):
        with pytest.raises(ValueError, match="must be positive"):
            steered_rates(wrong, BRAIN)
    with pytest.raises(ValueError, match="must grow with both rates"):
        steered_rates(aim, replace(BRAIN, volume=(0.0, 3.0)))
