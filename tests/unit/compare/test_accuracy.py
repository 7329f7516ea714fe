"""The largest errors of predictions in tests, their bias, and their words in the
report."""

import numpy as np
import pytest
from facts import Facts

from gyriflow.compare.accuracy import prediction_facts


def trials(start, start_week, errors, model="run", **more) -> list[dict]:
    """Return tests of a start by horizon, whose errors of volume have these
    logarithms."""
    common = {"start": start, "start_week": start_week, "protocol": "default"}
    common |= {"model": model, "r_shape_index": 0.8}
    rows = []
    for horizon, error in errors.items():
        row = {"horizon": horizon, "volume_difference": np.expm1(error)}
        rows.append(common | row | more)
    return rows


def words(tests, week, horizon, metric="volume") -> str:
    """Describe the tested error of a prediction of a week over a horizon."""
    return prediction_facts(tests, week - horizon, week)["errors"][metric]


A = trials("a", 22, {2.0: 0.05, 4.0: -0.10, 8.0: 0.02})
B = trials("b", 22, {2.0: -0.03, 4.0: 0.01, 8.0: -0.30})
LONGER = trials("a", 20, {4.0: 0.5, 6.0: 0.5})
OLDER = [*trials("a", 28, {2.0: 0.02}), *trials("b", 28, {2.0: -0.06})]


ERRORS = {
    "nearest": ([*A, *B], 24.0, 2.0),
    "and later": ([*A, *B], 26.0, 4.0),
    "between tested weeks and horizons": ([*A, *B], 25.0, 3.0),
    "longest": ([*A, *B], 30.0, 8.0),
    # tests of the same weeks over longer horizons do not count
    "not over longer ones": ([*A, *B, *LONGER], 24.0, 2.0),
    "over equal ones": ([*A, *B, *LONGER], 26.0, 4.0),
    # only tests over a long horizon have reached this week
    "a week reached by long ones": ([*A, *B], 30.0, 2.0),
    # a test of another age over this horizon counts instead
    "another age": ([*A, *B, *OLDER], 30.0, 2.0),
    "a later week": ([*A, *B], 31.0, 8.0),
    "a longer horizon": ([*A, *B], 30.0, 9.0),
    "one test": (A, 24.0, 2.0),
    "none": ([], 24.0, 2.0),
    "another protocol": ([*A, *trials("c", 22, {2.0: 9.0}, protocol="x")], 24.0, 2.0),
    "another model": ([*A, *trials("a", 22, {2.0: 9.0}, "atlas")], 24.0, 2.0),
}


def test_the_largest_error_is_that_of_tests_as_near_and_no_longer(recorded):
    others = trials("d", 22, {2.0: np.nan})
    recorded(
        {
            name: words([*tests, *others], week, horizon)
            for name, (tests, week, horizon) in ERRORS.items()
        }
    )


@pytest.mark.parametrize(
    ("errors", "facts"),
    [
        ((0.20, 0.22, 0.24), ("−21 to +27 %",)),
        ((0.20, 0.22, 0.24, 0.26), ("± 3 %", "mean error of +26 %")),
    ],
)
def test_the_mean_error_is_removed_from_four_starts_on(errors, facts):
    tests = []
    for number, error in enumerate(errors):
        # each start counts once, however often it was tested
        times = {1.5: error, 2.0: error} if number == 1 else {2.0: error}
        tests += trials(f"s{number}", 22, times)
    found = words(tests, 24.0, 2.0)
    assert found == Facts(*facts)
    assert ("mean error" in found) == (len(errors) > 3)


def compared(run, atlas, horizon=4.0, **more):
    """Return tests of two starts by the r of their runs and of the atlas' own brain."""
    rows = []
    for model, values in (("run", run), ("atlas", atlas)):
        for start, r in zip("ab", values, strict=False):
            rows += trials(start, 22, {horizon: 0.0}, model, r_shape_index=r, **more)
    return rows


BETTER = compared((0.80, 0.70), (0.84, 0.72))
LATER = compared((0.9, 0.9), (0.6, 0.6), horizon=8.0)


ADVANTAGES = {
    "better": (BETTER, 3.0),
    "no better by a fiftieth": (compared((0.80, 0.70), (0.82, 0.71)), 4.0),
    "worse": (compared((0.83, 0.72), (0.80, 0.70)), 4.0),
    "two tests of one start count once": ([*BETTER, *compared((0.80,), ()) * 5], 4.0),
    # the horizon tested next, or the longest
    "the next horizon": ([*BETTER, *LATER], 2.0),
    "the same horizon": ([*BETTER, *LATER], 4.0),
    "a later horizon": ([*BETTER, *LATER], 5.0),
    "the last horizon": ([*BETTER, *LATER], 20.0),
    "fused sulci": (compared((0.80, 0.70), (0.84, 0.72), protocol="fused"), 3.0),
}


def test_the_atlas_own_brain_is_said_to_be_better_by_more_than_a_fiftieth(recorded):
    found = {}
    for name, (tests, horizon) in ADVANTAGES.items():
        found[name] = prediction_facts(tests, 22.0, 22.0 + horizon)["advantage"]
    recorded(found)
