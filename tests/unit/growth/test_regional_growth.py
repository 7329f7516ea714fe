"""Maps of regional growth: which weeks they know, what smooths them, and what randomises them."""

import numpy as np
import pytest

from gyriflow.errors import InputError
from gyriflow.growth.regional import known_weeks, regional_maps, smoothed_over_weeks

WEEKS = [21.0, 22.0, 23.0, 25.0]
FOLLOW = {"regional": 1.0, "directional": 0.0, "smoothing_gw": 0.0, "known_until_gw": None, "cortex": "volume"}
FOLLOW |= {"rotated": False, "noise": 0.0, "seed": 0}


def ball(count=400):
    points = np.random.default_rng(5).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None] * np.where(np.arange(count) < count // 2, 1.0, 2.0)[:, None]
    return points, points[:, 0] > 0


def maps(**changes):
    points, right = ball()
    rates = {"volume": 0.1 + 0.05 * np.outer([1, 2, 0], points[:, 1]), "area": np.full((3, len(points)), np.nan)}
    pial = np.linalg.norm(points, axis=1) > 0.9
    rates["area"][:, pial] = 0.1 + 0.05 * points[pial, 2]
    sizes = {"volume": np.ones(len(points)), "area": pial.astype(float)}
    return points, regional_maps(WEEKS, rates, sizes, points, right, FOLLOW | changes)


def test_a_prediction_knows_the_intervals_that_have_ended():
    assert known_weeks(WEEKS, None) == [21.0, 22.0, 23.0]
    assert known_weeks(WEEKS, 23.0) == [21.0, 22.0]
    assert list(maps(known_until_gw=22.0)[1]) == ["regional_growth_21.00"]
    with pytest.raises(InputError, match="no two brains"):
        known_weeks(WEEKS, 21.5)


def test_smoothing_over_weeks_gives_the_mean_by_length_in_the_limit():
    rates = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 3.0]])
    np.testing.assert_allclose(smoothed_over_weeks(rates, WEEKS, 1e6), np.tile([0.25, 1.5], (3, 1)))
    np.testing.assert_array_equal(smoothed_over_weeks(rates, WEEKS, 0.0), rates)
    some = smoothed_over_weeks(rates, WEEKS, 1.0)[:, 0]
    assert some[0] > some[1] > some[2] > 0


def test_the_cortex_may_grow_by_its_area_and_the_core_by_its_volume():
    points, found = maps(cortex="area")
    core, cortex = found["regional_growth_22.00"], found["regional_growth_cortex_22.00"]
    assert np.corrcoef(core, points[:, 1])[0, 1] > 0.99
    assert np.corrcoef(cortex, points[:, 2])[0, 1] > 0.9
    assert np.isfinite(cortex).all()


def test_strain_of_the_known_weeks_has_six_maps_each():
    points, right = ball()
    rates = {"volume": np.full((3, len(points)), 0.1), "strain": np.arange(3 * len(points) * 6.0).reshape(3, -1, 6)}
    sizes = {"volume": np.ones(len(points))}
    settings = FOLLOW | {"directional": 0.5, "known_until_gw": 23.0}
    found = regional_maps(WEEKS, rates, sizes, points, right, settings)
    names = sorted(name for name in found if "strain" in name)
    assert len(names) == 12
    np.testing.assert_allclose(found["regional_growth_strain_22.00_xy"], 0.5 * rates["strain"][1, :, 3])


def test_rotated_maps_keep_their_spread_and_lose_their_place():
    _, own = maps()
    _, turned = maps(rotated=True, seed=3)
    one, other = own["regional_growth_22.00"], turned["regional_growth_22.00"]
    assert np.std(other) == pytest.approx(np.std(one), rel=0.3)
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.9


def test_noise_is_that_of_its_seed_and_the_same_in_all_weeks():
    own, noisy = maps()[1], maps(noise=0.1, seed=2)[1]
    ratios = np.stack([noisy[name] / own[name] for name in own])
    np.testing.assert_allclose(ratios, np.tile(ratios[0], (3, 1)))
    assert np.std(ratios[0]) == pytest.approx(0.1, rel=0.15)
    assert not np.allclose(
        ratios[0], np.stack([*maps(noise=0.1, seed=4)[1].values()])[0] / own["regional_growth_21.00"]
    )
