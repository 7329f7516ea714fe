"""Errors of predictions in tests, and intervals from these errors and the members of an
ensemble."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from ..geometry.alignment import align_points
from ..geometry.triangles import Floats, TriangleMesh, vertex_areas
from ..quantities import Shown, metrics_shown

QUANTITIES = ("area", "volume", "gyrification_index", "mean_sulcal_depth")
"""The metrics of whole brains that have intervals."""
FOLDING, SMOOTH = "gyrification_index", 0.02
"""The metric whose logarithm is that of the folding, its value − 1 + `SMOOTH`: a smooth
brain has about 1."""
LEVEL = 0.9
"""Share of further members of an ensemble that its interval contains."""
MIN_STARTS_FOR_BIAS = 4
"""Start brains from which on the mean error in tests is corrected: the mean of fewer is
mostly chance."""
DEFAULT_PROTOCOL = "default"
"""The protocol of tests that count: the default settings."""
ATLAS_MARGIN = 0.02
"""Difference of the mean r of the shape index above which the atlas' own brain is
reported as better."""
SULCUS, GYRUS = -0.375, 0.375
"""Largest shape index of a sulcus and smallest of a gyrus: the limits of rut and ridge
of Koenderink & van Doorn 1992."""


@dataclass(frozen=True)
class ErrorInTests:
    """The error of a prediction in tests, as logarithm of predicted over observed.

    `tests` is the number of tests, of `starts` start brains. `bias` is their mean
    error, each start brain counted once, and 0 for fewer than `MIN_STARTS_FOR_BIAS` of
    them; `largest` the largest error about it. `is_beyond`: no test went as far, in
    weeks predicted or in horizon.
    """

    tests: int
    starts: int
    largest: float
    bias: float
    is_beyond: bool


def log_value(metric: str, value: Any) -> Any:
    """Return the logarithm of a metric, whose differences are errors; for `FOLDING`
    that of the folding."""
    return np.log(value - 1 + SMOOTH if metric == FOLDING else value)


def _from_log(metric: str, value: Any) -> Any:
    """Return the metric of a logarithm of `log_value`."""
    return np.exp(value) + (1 - SMOOTH if metric == FOLDING else 0)


def _log_errors(tests: Sequence[Mapping[str, Any]], metric: str) -> pd.DataFrame:
    """Return the errors of runs in tests with the default protocol: columns start,
    week, horizon, error.

    `tests` are the rows of `norms/predictions.yaml`: start, start_week, horizon, model,
    protocol, and of runs the differences of area, volume, folding and
    mean_sulcal_depth, as fractions of the observed brain's. Rows of another protocol,
    or without this difference, are left out. Errors are logarithms of predicted over
    observed.
    """
    difference = f"{'folding' if metric == FOLDING else metric}_difference"
    rows = pd.DataFrame(tests).reindex(
        columns=["start", "start_week", "horizon", "model", "protocol", difference]
    )
    rows = rows[
        (rows["model"] == "run") & (rows["protocol"] == DEFAULT_PROTOCOL)
    ].dropna(subset=difference)
    week = rows["start_week"] + rows["horizon"]
    error = np.log1p(rows[difference].astype(float))
    return pd.DataFrame(
        {
            "start": rows["start"],
            "week": week,
            "horizon": rows["horizon"],
            "error": error,
        }
    )


def _error_in_tests(
    errors: pd.DataFrame,
    week: float,
    horizon: float,
) -> ErrorInTests | None:
    """Return the tested error of a prediction of a week over a horizon, from
    `_log_errors`; None without tests.

    The tests that count are those of this week and of earlier ones, over this horizon
    and shorter ones, or over the shortest horizon that a week was tested with; weeks
    between tested ones are rounded up.
    """
    if errors.empty:
        return None
    weeks = np.unique(errors["week"])
    horizons = np.unique(errors["horizon"])
    last_week = weeks[
        np.searchsorted(
            weeks[:-1],
            week - 1e-6,
        )
    ]
    longest = horizons[
        np.searchsorted(
            horizons[:-1],
            horizon - 1e-6,
        )
    ]
    shortest_of_week = errors.groupby("week")["horizon"].transform("min")
    is_earlier = errors["week"] <= last_week
    is_shorter = errors["horizon"] <= np.maximum(longest, shortest_of_week)
    counted = errors[is_earlier & is_shorter]
    means = counted.groupby("start")["error"].mean()
    bias = float(means.mean()) if len(means) >= MIN_STARTS_FOR_BIAS else 0.0
    return ErrorInTests(
        tests=len(counted),
        starts=len(means),
        largest=float((counted["error"] - bias).abs().max()),
        bias=bias,
        is_beyond=bool(week > weeks[-1] + 1e-6 or horizon > horizons[-1] + 1e-6),
    )


def _error_words(metric: str, tested: ErrorInTests) -> str:
    """Describe a tested error, such as "largest error in 6 tests of 2 start brains: −10
    to +11 %"."""
    low = _percent(-tested.largest)
    high = _percent(tested.largest)
    ends = f"± {high[1:]}" if low[1:] == high[1:] else f"{low} to {high}"
    plural = "s" if tested.starts > 1 else ""
    tests = "1 test" if tested.tests == 1 else f"{tested.tests} tests"
    words = f"largest error in {tests} of {tested.starts} start brain{plural}: {ends} %"
    if metric == FOLDING:
        words += " of the folding"
    if tested.bias:
        words += (
            f", about the prediction less the mean error of {_percent(tested.bias)} %"
        )
    if tested.is_beyond:
        words += "; no test went as far"
    return words


def _percent(error: float) -> str:
    return f"{100 * np.expm1(error):+.0f}".replace("-", "−")


def _atlas_advantage(
    tests: Sequence[Mapping[str, Any]], horizon: float
) -> tuple[float, float, float] | None:
    """Return by how much the atlas' own brain was nearer in tests than runs: mean r of
    the shape index of either.

    The tests are those of the default protocol over the horizon tested next, or the
    longest. Returns that horizon, r of runs and r of the atlas' own brain, or None
    unless the latter is larger by more than `ATLAS_MARGIN`.
    """
    rows = pd.DataFrame(tests)
    rows = rows[
        (rows["protocol"] == DEFAULT_PROTOCOL) & rows["model"].isin(["run", "atlas"])
    ]
    tested = min(
        (step for step in rows["horizon"] if step >= horizon - 1e-6),
        default=rows["horizon"].max(),
    )
    # the mean of each start counts once
    means = (
        rows[rows["horizon"] == tested]
        .groupby(["model", "start"])["r_shape_index"]
        .mean()
        .groupby("model")
        .mean()
    )
    if (
        not {"run", "atlas"} <= set(means.index)
        or means["atlas"] - means["run"] <= ATLAS_MARGIN
    ):
        return None
    return float(tested), float(means["run"]), float(means["atlas"])


def prediction_facts(
    tests: Sequence[Mapping[str, Any]],
    start_week: float,
    week: float,
) -> dict[str, Any]:
    """Describe the errors of tests for the report of a prediction of a week.

    Returns errors (by metric, the words of its tested error), advantage (a sentence
    where the atlas' own brain was better, or "") and starts (the tested brains).
    """
    horizon, errors = week - start_week, {}
    for metric in QUANTITIES:
        found = _error_in_tests(_log_errors(tests, metric), week, horizon)
        errors[metric] = "not tested" if found is None else _error_words(metric, found)
    advantage = ""
    if better := _atlas_advantage(tests, horizon):
        tested, run, atlas = better
        advantage = (
            f"In tests over {tested:g} weeks the atlas' own brain was more like the"
            " observed brain than the prediction (mean r of the shape index"
            f" {atlas:.2f} and {run:.2f}). The start's individual differences may have"
            " faded or changed by then, or the start, an average, had few of them. For"
            " the places of folds, use the atlas' own brain, which is stored with the"
            " prediction."
        )
    rows = pd.DataFrame(tests)
    counted = rows[rows["protocol"] == DEFAULT_PROTOCOL]
    tested_brains = counted[["start", "start_week"]].drop_duplicates()
    starts = [
        f"{brain} {at:g} GW" for brain, at in tested_brains.itertuples(index=False)
    ]
    return {"errors": errors, "advantage": advantage, "starts": starts}


UNTESTED = ErrorInTests(
    tests=0,
    starts=0,
    largest=0.0,
    bias=0.0,
    is_beyond=False,
)
"""The intervals of a run without tests are those of its members."""


def _spread_of_members(values: Floats, level: float) -> float:
    """Return half the width of the two-sided prediction interval for one further value
    of a normal sample (n,).

    It is t s √(1 + 1/n) with Student's t of n − 1 degrees of freedom; NaN for fewer
    than two values.
    """
    n = len(values)
    if n < 2:
        return np.nan
    quantile = stdtrit(n - 1, (1 + level) / 2)
    return float(quantile * np.std(values, ddof=1) * np.sqrt(1 + 1 / n))


def interval_table(
    run: pd.DataFrame,
    members: pd.DataFrame,
    observed: pd.DataFrame,
    tests: Sequence[Mapping[str, Any]] = (),
) -> pd.DataFrame:
    """Return the intervals of whole brains by week and metric.

    The tables have the metrics (week, hemisphere, metric, value, unit) of the run, of
    all its members, and of the observed brains of its weeks, which may be empty.
    `tests` are the rows of `norms/predictions.yaml`, empty unless the run is a
    prediction.

    The spread of the members, for `LEVEL` of further members, and the largest error of
    the tests are added in logarithms, as √(spread² + error²), about the mean of the
    members less the bias of the tests. Intervals of later weeks are never narrower.

    Columns week, metric, unit, run (its value), members (number of values; one that did
    not reach a week has none), mean, sd (NaN for one), tests, tested_starts,
    largest_error, bias (fractions; NaN without tests), low, high, observed_value (NaN
    without a brain) and contains_observed.
    """
    keys, names = ["week", "metric"], metrics_shown(Shown.INTERVALS)
    own, varied, brains = (
        table[(table["hemisphere"] == "whole") & table["metric"].isin(names)]
        for table in (run, members, observed)
    )
    rows = []
    start = own["week"].min()
    for metric, table in varied.groupby("metric"):
        errors = _log_errors(tests, str(metric))
        widest = 0.0
        for at, group in table.groupby("week")["value"]:
            week = float(str(at))
            tested = UNTESTED
            if week > start:
                tested = _error_in_tests(errors, week, week - start) or UNTESTED
            logs = log_value(str(metric), group.to_numpy(dtype=float))
            half = np.hypot(_spread_of_members(logs, LEVEL), tested.largest)
            widest = max(widest, half) if np.isfinite(half) else half
            middle = logs.mean() - tested.bias
            rows.append(
                {
                    "week": week,
                    "metric": metric,
                    "members": len(group),
                    "mean": group.mean(),
                    "sd": group.std(),
                    "tests": tested.tests,
                    "tested_starts": tested.starts,
                    "largest_error": (
                        np.expm1(tested.largest) if tested.tests else np.nan
                    ),
                    "bias": np.expm1(tested.bias) if tested.tests else np.nan,
                    "low": _from_log(str(metric), middle - widest),
                    "high": _from_log(str(metric), middle + widest),
                }
            )
    table = (
        own[[*keys, "unit", "value"]]
        .rename(columns={"value": "run"})
        .merge(pd.DataFrame(rows), "left", keys)
    )
    table = table.merge(
        brains.groupby(keys)["value"].first().rename("observed_value").reset_index(),
        "left",
        keys,
    )
    values = table["observed_value"]
    inside = values.between(table["low"], table["high"]).astype("boolean")
    return table.assign(
        members=table["members"].fillna(0).astype(int),
        contains_observed=inside.mask(values.isna() | table["low"].isna()),
    )


def ensemble_maps(
    run: TriangleMesh,
    members: Sequence[TriangleMesh],
    shape_indices: Sequence[Floats],
) -> dict[str, Floats]:
    """Return maps (n,) of the spread of an ensemble at the vertices of a run's
    hemisphere.

    Vertices of `members` correspond to those of the run; `shape_indices` (n,) are those
    of the run and of the members. position_sd_mm is the root mean square distance of
    the members, aligned rigidly with the run, from their mean position, with n − 1, NaN
    for fewer than two; sulcus_probability and gyrus_probability are the shares of run
    and members whose vertex is sulcus or gyrus.
    """
    areas = vertex_areas(run)
    shapes = [member.vertices for member in members]
    aligned = [align_points(shape, run.vertices, areas) for shape in shapes]
    values, spread = np.stack(shape_indices), np.full(run.vertices.shape, np.nan)
    if len(members) > 1:
        spread = np.var(aligned, axis=0, ddof=1)
    return {
        "position_sd_mm": np.sqrt(spread.sum(axis=1)),
        "sulcus_probability": (values <= SULCUS).mean(axis=0),
        "gyrus_probability": (values >= GYRUS).mean(axis=0),
    }
