"""Errors of predictions in tests, counted by start brain, and what they say of the next one."""

import numpy as np
import pytest
from facts import Facts

from gyriflow.compare.accuracy import (
    QUANTITIES,
    atlas_advantage,
    error_in_tests,
    error_words,
    from_log,
    held_intervals,
    log_errors,
    log_value,
    prediction_facts,
)
from gyriflow.io.yaml_files import read_keys
from gyriflow.study.paths import PREDICTION_TESTS


def rows(start: str, start_week: float, errors: dict[float, float], **more) -> list[dict]:
    """Return tests of a start by horizon, whose errors of volume have these logarithms."""
    common = {"start": start, "start_week": start_week, "protocol": "default", "model": "run"}
    return [common | {"horizon": h, "volume_difference": np.expm1(e)} | more for h, e in errors.items()]


def volume_error(tests, week, horizon):
    return error_in_tests(log_errors(tests, "volume"), week, horizon)


A = rows("a", 22, {2.0: 0.05, 4.0: -0.10, 8.0: 0.02})
B = rows("b", 22, {2.0: -0.03, 4.0: 0.01, 8.0: -0.30})


def test_the_folding_and_not_the_index_has_a_logarithm():
    assert log_value("gyrification_index", 1.08) == pytest.approx(np.log(0.10))
    assert from_log("gyrification_index", np.log(0.10)) == pytest.approx(1.08)
    assert from_log("area", log_value("area", 250.0)) == pytest.approx(250.0)


def test_errors_are_those_of_runs_with_the_default_protocol():
    others = [*rows("c", 22, {2.0: 9.0}, protocol="stated weeks"), *rows("a", 22, {2.0: 9.0}, model="atlas")]
    found = log_errors([*A, *others, {"start": "d", "model": "run", "protocol": "default"}], "volume")
    assert found["week"].tolist() == [24.0, 26.0, 30.0]
    assert found["error"].tolist() == pytest.approx([0.05, -0.10, 0.02])
    folding = [A[0] | {"folding_difference": 0.2}]
    assert log_errors(folding, "gyrification_index")["error"].tolist() == pytest.approx([np.log(1.2)])
    assert log_errors(folding, "mean_sulcal_depth").empty
    assert error_in_tests(log_errors(folding, "mean_sulcal_depth"), 24.0, 2.0) is None


def test_the_largest_error_of_k_starts_holds_k_of_k_plus_one():
    for week, horizon, largest in ((24.0, 2.0, 0.05), (26.0, 4.0, 0.10), (25.0, 3.0, 0.10), (30.0, 8.0, 0.30)):
        found = volume_error([*A, *B], week, horizon)
        assert (found.starts, found.largest) == (2, pytest.approx(largest)), week
        assert (found.coverage, found.is_beyond) == (pytest.approx(2 / 3), False)
    assert volume_error(A, 24.0, 2.0).coverage == 0.5
    # 30 GW reached over a short horizon: only tests over a long one have reached this week
    assert volume_error([*A, *B], 30.0, 2.0).largest == pytest.approx(0.30)
    # a test of another age over this horizon counts instead
    older = [*A, *B, *rows("a", 28, {2.0: 0.02}), *rows("b", 28, {2.0: -0.06})]
    assert volume_error(older, 30.0, 2.0).largest == pytest.approx(0.10)
    assert volume_error([*A, *B], 31.0, 9.0).is_beyond


def test_intervals_are_never_narrower_later_or_for_a_longer_horizon():
    generator = np.random.default_rng(0)
    tests = [
        row
        for start in "abcd"
        for age in (22, 26)
        for row in rows(start, age, {h: generator.normal(0.05, 0.1) for h in (2.0, 4.0, 6.0, 8.0)})
    ]
    for week in (24.0, 28.0, 32.0, 34.0):
        by_horizon = [volume_error(tests, week, h).largest for h in (1.0, 2.0, 4.0, 5.0, 8.0, 10.0)]
        assert by_horizon == sorted(by_horizon)
    for horizon in (2.0, 6.0):
        by_week = [volume_error(tests, week, horizon).largest for week in (24.0, 25.0, 28.0, 30.0, 33.0, 36.0)]
        assert by_week == sorted(by_week)


def test_a_start_that_was_not_tested_as_far_does_not_count_for_the_coverage():
    short = [*A, *B, *rows("c", 22, {2.0: 0.5})]
    assert volume_error(short, 24.0, 2.0).starts == 3
    far = volume_error(short, 30.0, 8.0)
    assert (far.starts, far.largest) == (2, pytest.approx(0.5))


def test_ninety_percent_need_nine_starts():
    generator = np.random.default_rng(3)
    for count, coverage in ((8, 8 / 9), (9, 0.9), (19, 0.9)):
        held = []
        for _ in range(60):
            errors = generator.normal(0.0, 0.1, count + 1)
            found = volume_error(
                [row for n, e in enumerate(errors[:-1]) for row in rows(f"s{n}", 22, {2.0: e})], 24.0, 2.0
            )
            held.append(abs(errors[-1] - found.bias * found.is_corrected) <= found.largest)
        assert found.coverage == pytest.approx(coverage)
        assert np.mean(held) == pytest.approx(coverage, abs=0.1), count
    assert "90 % of 19 start brains" in error_words("volume", found)
    # of 20 starts the 19th in size: ⌈21 · 0.9⌉
    errors = [0.01 * number * (-1) ** number for number in range(1, 21)]
    found = volume_error([row for n, e in enumerate(errors) for row in rows(f"s{n}", 22, {2.0: e})], 24.0, 2.0)
    assert (found.is_corrected, found.largest) == (False, pytest.approx(0.19))


def test_more_starts_over_a_longer_horizon_do_not_make_an_interval_narrower():
    near = [row for n in range(9) for row in rows(f"near{n}", 22, {2.0: 0.5 if n == 0 else 0.01 * (-1) ** n})]
    far = [row for n in range(10) for row in rows(f"far{n}", 22, {4.0: 0.01 * (-1) ** n})]
    found = volume_error([*near, *far], 26.0, 4.0)
    assert found.largest == pytest.approx(volume_error(near, 24.0, 2.0).largest)
    assert found.largest > 0.4


def test_a_bias_is_corrected_where_it_exceeds_its_error():
    clear = [row for start, e in zip("abc", (0.20, 0.22, 0.24), strict=True) for row in rows(start, 22, {2.0: e})]
    found = volume_error(clear, 24.0, 2.0)
    assert (found.is_corrected, found.bias) == (True, pytest.approx(0.22))
    # each start's error about the bias of the other two
    assert found.largest == pytest.approx(0.03)
    unclear = [row for start, e in zip("abc", (0.20, -0.22, 0.10), strict=True) for row in rows(start, 22, {2.0: e})]
    found = volume_error(unclear, 24.0, 2.0)
    assert (found.is_corrected, found.largest) == (False, pytest.approx(0.22))
    assert found.bias == pytest.approx(0.08 / 3)


def test_words_say_by_how_many_tests_and_for_how_many_brains_at_most():
    three = [*A, *B, *rows("c", 22, {2.0: 0.0, 4.0: 0.26, 8.0: 0.0})]
    words = error_words("volume", volume_error(three, 26.0, 4.0))
    assert words == Facts("largest error of 3 start brains", "−23 to +30 %", "holds for 3 of 4 at most")
    assert "90 %" not in words
    assert (
        error_words("volume", volume_error(A, 24.0, 2.0))
        == "largest error of 1 start brain, ± 5 %: holds for 1 of 2 at most"
    )
    assert "of the folding" in error_words("gyrification_index", volume_error(A, 24.0, 2.0))
    assert "no test went as far" in error_words("volume", volume_error(A, 40.0, 2.0))
    biased = [row for start, e in zip("abc", (-0.2, -0.22, -0.24), strict=True) for row in rows(start, 22, {2.0: e})]
    assert "mean error of −20 %" in error_words("volume", volume_error(biased, 24.0, 2.0))


def test_each_start_left_out_is_held_by_the_others_or_not():
    # a: its errors of 5 and 2 % are within those of b, 10 % is not within 3 %
    found = held_intervals([*A, *B]).set_index("start")
    assert found.loc["a", ["metric", "tests", "held"]].tolist() == ["volume", 3, 1]
    # b: 3 and 1 % are within 5 and 10 %, 30 % is not
    assert found.loc["b", ["tests", "held"]].tolist() == [3, 2]
    assert found["at_most"].tolist() == [0.5, 0.5]


def test_shipped_tests_hold_as_often_as_counting_expects():
    tests = read_keys(PREDICTION_TESTS)["rows"]
    found = held_intervals(tests)
    assert set(found["metric"]) == set(QUANTITIES)
    shares = found.groupby("metric")[["held", "tests", "at_most"]].agg(
        {"held": "sum", "tests": "sum", "at_most": "max"}
    )
    # of averages, each start is one observation: far fewer than expected would be a fault
    assert (shares["held"] / shares["tests"] >= shares["at_most"] - 0.35).all()


def test_the_atlas_own_brain_is_said_to_be_better_by_more_than_a_fiftieth():
    def brains(run, atlas, horizon=4.0):
        return [
            {"start": start, "start_week": 22, "protocol": "default", "horizon": horizon, "model": model}
            | {"r_shape_index": r}
            for model, values in (("run", run), ("atlas", atlas))
            for start, r in zip("ab", values, strict=False)
        ]

    better = brains((0.80, 0.70), (0.84, 0.72))
    assert atlas_advantage(better, 3.0) == (4.0, pytest.approx(0.75), pytest.approx(0.78))
    assert atlas_advantage(brains((0.80, 0.70), (0.82, 0.71)), 4.0) is None
    assert atlas_advantage(brains((0.83, 0.72), (0.80, 0.70)), 4.0) is None
    # two tests of one start count once
    assert atlas_advantage([*better, *(brains((0.80,), ()) * 5)], 4.0)[1] == pytest.approx(0.75)
    # the horizon tested next, or the longest
    two = [*better, *brains((0.9, 0.9), (0.6, 0.6), horizon=8.0)]
    assert [atlas_advantage(two, h) is None for h in (2.0, 4.0, 5.0, 20.0)] == [False, False, True, True]
    assert atlas_advantage([row | {"protocol": "fused sulci"} for row in better], 3.0) is None
    facts = prediction_facts([*better, *A], 22.0, 25.0)
    assert facts["advantage"] == Facts("4 weeks", "0.78", "0.75", "atlas' own brain")
    assert facts["errors"]["area"] == "not tested"
    assert facts["starts"] == ["a 22 GW", "b 22 GW"]
