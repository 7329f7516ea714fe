"""Curves of metrics over age that are known, and the ages read from them."""

import numpy as np
import pytest

from gyriflow.metrics.age_curve import LEAST_ERROR_GW, LeftOut, age_curve, estimate_age, leave_one_week_out, weights

WEEKS = np.arange(21.0, 30.0)


@pytest.mark.parametrize(
    "metric",
    [lambda w: 10 * w, lambda w: 1e-6 * (w - 20) ** 2, lambda w: 500 - 3 * w, lambda w: -((w - 20.0) ** 2)],
    ids=["line", "bent", "falling", "falling, bent"],
)
def test_age_is_read_back_from_a_smooth_metric(metric) -> None:
    curve = age_curve(WEEKS, metric(WEEKS))
    for week in (21.0, 23.4, 28.9):
        found = estimate_age(curve, metric(week), 0.0)
        assert (found.week, found.outside) == (pytest.approx(week, abs=0.02), "")


def test_noise_gives_the_range() -> None:
    found = estimate_age(age_curve(WEEKS, 500 - 10 * WEEKS), 500 - 10 * 25.0, noise=5.0)
    assert (found.low, found.week, found.high) == pytest.approx((24.5, 25.0, 25.5), abs=0.02)


@pytest.mark.parametrize(("sign", "first"), [(1.0, "younger"), (-1.0, "older")])
def test_values_beyond_the_ends(sign: float, first: str) -> None:
    curve = age_curve(WEEKS, sign * 10 * WEEKS)
    below, above = estimate_age(curve, 200.0 * sign, 5.0), estimate_age(curve, 300.0 * sign, 5.0)
    assert (below.week, below.outside) == (21.0, "younger")
    assert (above.week, above.outside) == (29.0, "older")
    # by less than the noise
    assert estimate_age(curve, sign * 294.0, 5.0).outside == ""


def test_curve_never_turns_back() -> None:
    noisy = np.array([1.0, 3.0, 2.0, 4.0, 3.5, 6.0, 9.0, 7.0, 10.0])
    curve = age_curve(WEEKS, noisy)
    assert (np.diff(curve.values) >= 0).all()
    assert np.abs(np.interp(WEEKS, curve.weeks, curve.values) - noisy).max() < 2.0
    assert (np.diff(age_curve(WEEKS, -noisy).values) >= 0).all()


def test_constant_metric_says_nothing() -> None:
    found = estimate_age(age_curve(WEEKS, np.full(9, 3.0)), 3.0, 0.0)
    assert (found.low, found.week, found.high) == pytest.approx((21.0, 25.0, 29.0))
    # neither is rounding a signal
    level = leave_one_week_out(WEEKS, np.full(9, 3.0)), leave_one_week_out(WEEKS, 3.0 + 1e-15 * WEEKS)
    assert weights(level).tolist() == [0.0, 0.0]


def test_no_value_no_age() -> None:
    assert np.isnan(estimate_age(age_curve(WEEKS, WEEKS), np.nan, 1.0).week)


def test_weight_of_a_perfect_metric_and_of_noise() -> None:
    perfect = leave_one_week_out(WEEKS, 3 * WEEKS)
    assert perfect.error_gw == LEAST_ERROR_GW
    assert perfect.noise == pytest.approx(0.0, abs=0.01)
    # from week 25: 3, 2, 1, 0, 1, 2 and 3 weeks
    assert perfect.guess_gw == pytest.approx(2.0)
    assert perfect.number == 7
    useless = leave_one_week_out(WEEKS, np.array([1.0, -1, 1, -1, 1, -1, 1, -1, 1]))
    assert weights([perfect, useless]) == pytest.approx([LEAST_ERROR_GW**-2 - perfect.guess_gw**-2, 0.0])


def test_weights_of_metrics_of_equal_skill_are_nearly_equal() -> None:
    # the errors of seven weeks scatter by luck alone: mean squares of seven normal numbers
    random = np.random.default_rng(3)
    ratios = {"raw": [], "shrunk": []}
    for _ in range(50):
        errors = np.sqrt(np.mean(random.standard_normal((20, 7)) ** 2, axis=1))
        skills = [LeftOut(error, 3.0, 1.0, 7) for error in errors]
        raw, shrunk = errors**-2.0 - 3.0**-2, weights(skills)
        for name, values in (("raw", raw), ("shrunk", shrunk)):
            low, high = np.quantile(values, [0.05, 0.95])
            ratios[name].append(high / low)
    assert np.mean(ratios["raw"]) > 5.0
    assert np.mean(ratios["shrunk"]) < 1.7


def test_weights_of_metrics_of_unequal_skill_stay_unequal() -> None:
    random = np.random.default_rng(4)
    skill = np.repeat([0.2, 2.0], 10)
    errors = skill * np.sqrt(np.mean(random.standard_normal((20, 7)) ** 2, axis=1))
    found = weights([LeftOut(error, 5.0, 1.0, 7) for error in errors])
    assert found[:10].mean() > 30 * found[10:].mean()


def test_range_beyond_an_end_is_clipped() -> None:
    curve = age_curve(WEEKS, 10 * WEEKS)
    assert not estimate_age(curve, 250.0, 30.0).clipped
    found = estimate_age(curve, 280.0, 30.0)
    assert (found.outside, found.clipped, found.high) == ("", True, 29.0)
    assert found.low == pytest.approx(25.0, abs=0.02)


def test_one_deviant_week_is_seen_as_error_and_noise() -> None:
    values = 10 * WEEKS
    values[4] += 20.0
    found = leave_one_week_out(WEEKS, values)
    # left out, week 25 is taken for 27 by a curve that is right
    assert found.error_gw * np.sqrt(7) > 2.0
    assert found.noise * np.sqrt(7) > 20.0


def test_several_brains_of_a_week_are_left_out_together() -> None:
    # the second brains are alike, and unlike the first ones: were one left in, it would give the other's age away
    weeks, values = np.repeat(np.arange(21.0, 27.0), 2), np.repeat([1.0, 2.0, 9.0, 4.0, 5.0, 6.0], 2)
    found = leave_one_week_out(weeks, values)
    single = leave_one_week_out(weeks[::2], values[::2])
    assert found.error_gw == pytest.approx(single.error_gw, abs=0.02)
