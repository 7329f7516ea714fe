"""The largest errors of predictions in tests, their bias, and their words in the
report."""

import numpy as np
import pytest
from facts import Facts

from gyriflow.compare.accuracy import (
    atlas_advantage,
    error_in_tests,
    error_words,
    from_log,
    log_errors,
    log_value,
    prediction_facts,
)


def rows(
    start: str, start_week: float, errors: dict[float, float], **more
) -> list[dict]:
    """Return tests of a start by horizon, whose errors of volume have these
    logarithms."""
    common = {
        "start": start,
        "start_week": start_week,
        "protocol": "default",
        "model": "run",
    }
    return [
        common | {"horizon": h, "volume_difference": np.expm1(e)} | more
        for h, e in errors.items()
    ]


def volume_error(tests, week, horizon):
    return error_in_tests(log_errors(tests, "volume"), week, horizon)


A = rows("a", 22, {2.0: 0.05, 4.0: -0.10, 8.0: 0.02})
B = rows("b", 22, {2.0: -0.03, 4.0: 0.01, 8.0: -0.30})


def test_the_folding_and_not_the_index_has_a_logarithm():
    assert log_value("gyrification_index", 1.08) == pytest.approx(np.log(0.10))
    assert from_log("gyrification_index", np.log(0.10)) == pytest.approx(1.08)
    assert from_log("area", log_value("area", 250.0)) == pytest.approx(250.0)


def test_errors_are_those_of_runs_with_the_default_protocol():
    others = [
        *rows("c", 22, {2.0: 9.0}, protocol="stated weeks"),
        *rows("a", 22, {2.0: 9.0}, model="atlas"),
    ]
    found = log_errors(
        [*A, *others, {"start": "d", "model": "run", "protocol": "default"}], "volume"
    )
    assert found["week"].tolist() == [24.0, 26.0, 30.0]
    assert found["error"].tolist() == pytest.approx([0.05, -0.10, 0.02])
    folding = [A[0] | {"folding_difference": 0.2}]
    assert log_errors(folding, "gyrification_index")["error"].tolist() == pytest.approx(
        [np.log(1.2)]
    )
    assert log_errors(folding, "mean_sulcal_depth").empty
    assert error_in_tests(log_errors(folding, "mean_sulcal_depth"), 24.0, 2.0) is None


def test_the_largest_error_is_that_of_tests_as_near_and_no_longer():
    cases = (
        (24.0, 2.0, 2, 0.05),
        (26.0, 4.0, 4, 0.10),
        (25.0, 3.0, 4, 0.10),
        (30.0, 8.0, 6, 0.30),
    )
    for week, horizon, tests, largest in cases:
        found = volume_error([*A, *B], week, horizon)
        assert (found.tests, found.starts, found.largest) == (
            tests,
            2,
            pytest.approx(largest),
        ), week
        assert not found.is_beyond
    # tests of the same weeks over longer horizons do not count
    longer = [*A, *B, *rows("a", 20, {4.0: 0.5, 6.0: 0.5})]
    assert volume_error(longer, 24.0, 2.0).largest == pytest.approx(0.05)
    assert volume_error(longer, 26.0, 4.0).largest == pytest.approx(0.50)
    # 30 GW reached over a short horizon: only tests over a long one have reached this
    # week
    assert volume_error([*A, *B], 30.0, 2.0).largest == pytest.approx(0.30)
    # a test of another age over this horizon counts instead
    older = [*A, *B, *rows("a", 28, {2.0: 0.02}), *rows("b", 28, {2.0: -0.06})]
    assert volume_error(older, 30.0, 2.0).largest == pytest.approx(0.10)
    assert volume_error([*A, *B], 31.0, 9.0).is_beyond


def test_largest_errors_are_never_smaller_later_or_for_a_longer_horizon():
    generator = np.random.default_rng(0)
    tests = [
        row
        for start in "abc"
        for age in (22, 26)
        for row in rows(
            start, age, {h: generator.normal(0.05, 0.1) for h in (2.0, 4.0, 6.0, 8.0)}
        )
    ]
    for week in (24.0, 28.0, 32.0, 34.0):
        by_horizon = [
            volume_error(tests, week, h).largest
            for h in (1.0, 2.0, 4.0, 5.0, 8.0, 10.0)
        ]
        assert by_horizon == sorted(by_horizon)
    for horizon in (2.0, 6.0):
        by_week = [
            volume_error(tests, week, horizon).largest
            for week in (24.0, 25.0, 28.0, 30.0, 33.0, 36.0)
        ]
        assert by_week == sorted(by_week)


def test_the_mean_error_is_removed_from_four_starts_on():
    def tested(*errors):
        tests = []
        for number, error in enumerate(errors):
            tests += rows(f"s{number}", 22, {2.0: error})
        return volume_error(tests, 24.0, 2.0)

    three = tested(0.20, 0.22, 0.24)
    assert (three.bias, three.largest) == (0.0, pytest.approx(0.24))
    four = tested(0.20, 0.22, 0.24, 0.26)
    assert (four.bias, four.largest) == (pytest.approx(0.23), pytest.approx(0.03))
    # each start counts once, however often it was tested
    more = [*rows("s0", 22, {1.0: 0.0, 2.0: 0.0}), *rows("s1", 22, {2.0: 0.1})]
    more += [*rows("s2", 22, {2.0: 0.1}), *rows("s3", 22, {2.0: 0.2})]
    assert volume_error(more, 24.0, 2.0).bias == pytest.approx(0.1)


def test_words_say_how_many_tests_there_were():
    three = [*A, *B, *rows("c", 22, {2.0: 0.0, 4.0: 0.26, 8.0: 0.0})]
    words = error_words("volume", volume_error(three, 26.0, 4.0))
    assert words == "largest error in 6 tests of 3 start brains: −23 to +30 %"
    assert (
        error_words("volume", volume_error(A, 24.0, 2.0))
        == "largest error in 1 test of 1 start brain: ± 5 %"
    )
    assert "of the folding" in error_words(
        "gyrification_index", volume_error(A, 24.0, 2.0)
    )
    assert "no test went as far" in error_words("volume", volume_error(A, 40.0, 2.0))
    biased = []
    for start, error in zip("abcd", (-0.2, -0.22, -0.24, -0.22), strict=True):
        biased += rows(start, 22, {2.0: error})
    assert "mean error of −20 %" in error_words(
        "volume", volume_error(biased, 24.0, 2.0)
    )


def test_the_atlas_own_brain_is_said_to_be_better_by_more_than_a_fiftieth():
    def brains(run, atlas, horizon=4.0):
        return [
            {
                "start": start,
                "start_week": 22,
                "protocol": "default",
                "horizon": horizon,
                "model": model,
            }
            | {"r_shape_index": r}
            for model, values in (("run", run), ("atlas", atlas))
            for start, r in zip("ab", values, strict=False)
        ]

    better = brains((0.80, 0.70), (0.84, 0.72))
    assert atlas_advantage(better, 3.0) == (
        4.0,
        pytest.approx(0.75),
        pytest.approx(0.78),
    )
    assert atlas_advantage(brains((0.80, 0.70), (0.82, 0.71)), 4.0) is None
    assert atlas_advantage(brains((0.83, 0.72), (0.80, 0.70)), 4.0) is None
    # two tests of one start count once
    assert atlas_advantage([*better, *(brains((0.80,), ()) * 5)], 4.0)[
        1
    ] == pytest.approx(0.75)
    # the horizon tested next, or the longest
    two = [*better, *brains((0.9, 0.9), (0.6, 0.6), horizon=8.0)]
    assert [atlas_advantage(two, h) is None for h in (2.0, 4.0, 5.0, 20.0)] == [
        False,
        False,
        True,
        True,
    ]
    assert (
        atlas_advantage([row | {"protocol": "fused sulci"} for row in better], 3.0)
        is None
    )
    facts = prediction_facts([*better, *A], 22.0, 25.0)
    assert facts["advantage"] == Facts("4 weeks", "0.78", "0.75", "atlas' own brain")
    assert facts["errors"]["area"] == "not tested"
    assert facts["starts"] == ["a 22 GW", "b 22 GW"]
