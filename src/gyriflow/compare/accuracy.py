"""Errors of predictions in tests, and the intervals that follow from them and from the members of an ensemble.

The unit of tests is the start brain.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import t

from ..geometry.alignment import rigid_fit
from ..geometry.deformations import transform_points
from ..geometry.triangles import Floats, TriangleMesh, vertex_areas
from ..quantities import Shown, metrics_shown

QUANTITIES = ("area", "volume", "gyrification_index", "mean_sulcal_depth")
"""The metrics of whole brains that have intervals."""
FOLDING, SMOOTH = "gyrification_index", 0.02
"""The metric whose logarithm is that of the folding, its value − 1 + `SMOOTH`: a smooth brain has about 1."""
LEVEL, MIN_STARTS = 0.9, 9
"""Coverage of intervals if at least this number of starts was tested."""
DEFAULT_PROTOCOL = "default"
"""The protocol of tests that count: the default settings."""
ATLAS_MARGIN = 0.02
"""Difference of the mean r of the shape index above which the atlas' own brain is reported as better."""
SULCUS, GYRUS = -0.375, 0.375
"""Largest shape index of a sulcus and smallest of a gyrus: the limits of rut and ridge of Koenderink & van Doorn
1992."""


@dataclass(frozen=True)
class ErrorInTests:
    """The error of a prediction by tests of `starts` start brains, as logarithm of predicted over observed.

    `largest` is half the width of the interval: the largest error of these starts, about `bias`, their mean error, if
    it is larger than its own error (`is_corrected`). `coverage` is the share of starts that such an interval contains
    at most, by counting: k/(k + 1) for the largest error of k starts, `LEVEL` from `MIN_STARTS` on. `is_beyond`: no
    test went as far, in weeks predicted or in horizon.
    """

    starts: int
    largest: float
    bias: float
    is_corrected: bool
    coverage: float
    is_beyond: bool

    def holds(self, error: float) -> bool:
        """Return whether the interval contains a brain that was predicted with an error, as logarithm."""
        return abs(error - self.bias * self.is_corrected) <= self.largest


def log_value(metric: str, value: Any) -> Any:
    """Return the logarithm of a metric, whose differences are errors; for `FOLDING` that of the folding."""
    return np.log(value - 1 + SMOOTH if metric == FOLDING else value)


def from_log(metric: str, value: Any) -> Any:
    """Return the metric of a logarithm of `log_value`."""
    return np.exp(value) + (1 - SMOOTH if metric == FOLDING else 0)


def log_errors(tests: Sequence[Mapping[str, Any]], metric: str) -> pd.DataFrame:
    """Return the errors of runs in tests with the default protocol: columns start, week, horizon, error.

    `tests` are the rows of `norms/predictions.yaml`: start, start_week, horizon, model, protocol, and of runs the
    differences of area, volume, folding and mean_sulcal_depth, as fractions of the observed brain's. Rows of another
    protocol, or without this difference, are left out. Errors are logarithms of predicted over observed.
    """
    difference = f"{'folding' if metric == FOLDING else metric}_difference"
    rows = pd.DataFrame(tests).reindex(columns=["start", "start_week", "horizon", "model", "protocol", difference])
    rows = rows[(rows["model"] == "run") & (rows["protocol"] == DEFAULT_PROTOCOL)].dropna(subset=difference)
    week, error = rows["start_week"] + rows["horizon"], np.log1p(rows[difference].astype(float))
    return pd.DataFrame({"start": rows["start"], "week": week, "horizon": rows["horizon"], "error": error})


def error_in_tests(errors: pd.DataFrame, week: float, horizon: float) -> ErrorInTests | None:
    """Return the tested error of a prediction of a week over a horizon, from `log_errors`; None without tests.

    The tests that count are those of this week and of earlier ones, over this horizon and shorter ones, or over the
    shortest horizon that a week was tested with; weeks between tested ones are rounded up. The interval is never
    narrower for a later week or a longer horizon.
    """
    if errors.empty:
        return None
    weeks, horizons = (np.unique(errors[name]) for name in ("week", "horizon"))
    week_limit = weeks[np.searchsorted(weeks[:-1], week - 1e-6)]
    horizon_limit = horizons[np.searchsorted(horizons[:-1], horizon - 1e-6)]
    shortest = errors.groupby("week")["horizon"].transform("min")
    smaller = [
        _counted(
            errors[(errors["week"] <= earlier) & (errors["horizon"] <= np.maximum(shorter, shortest))], earlier, shorter
        )
        for earlier in weeks[weeks <= week_limit]
        for shorter in horizons[horizons <= horizon_limit]
    ]
    is_beyond = bool(week > weeks[-1] + 1e-6 or horizon > horizons[-1] + 1e-6)
    return replace(smaller[-1], largest=max(found.largest for found in smaller), is_beyond=is_beyond)


def _counted(counted: pd.DataFrame, week: float, horizon: float) -> ErrorInTests:
    starts, number_of = np.unique(counted["start"].to_numpy(dtype=str), return_inverse=True)
    errors = [counted["error"].to_numpy()[number_of == number] for number in range(len(starts))]
    means = np.array([values.mean() for values in errors])
    bias, is_corrected = _bias(means)
    # a start that was not tested as far does not count for the coverage
    is_as_far = (counted["week"] >= week) | (counted["horizon"] >= horizon)
    count = len(np.unique(number_of[is_as_far.to_numpy()]))
    # the largest error of each start, about the bias of the others if bias is corrected
    largest = []
    for number, values in enumerate(errors):
        others, others_corrected = _bias(np.delete(means, number))
        largest.append(np.abs(values - others * (is_corrected and others_corrected)).max())
    rank, coverage = len(largest), count / (count + 1)
    if count >= MIN_STARTS:
        rank, coverage = min(rank, int(np.ceil(round((rank + 1) * LEVEL, 6)))), LEVEL
    return ErrorInTests(count, float(np.sort(largest)[rank - 1]), bias, is_corrected, coverage, is_beyond=False)


def _bias(means: Floats) -> tuple[float, bool]:
    """Return the mean of the starts' errors, and whether it is larger than its standard error, of Student's t."""
    if len(means) < 2:
        return float(means.mean()) if len(means) else 0.0, False
    error = t.ppf(0.84, len(means) - 1) * means.std(ddof=1) / np.sqrt(len(means))
    return float(means.mean()), bool(abs(means.mean()) > error)


def error_words(metric: str, tested: ErrorInTests) -> str:
    """Describe a tested error, such as "largest error of 2 start brains, −10 to +11 %: holds for 2 of 3 at most"."""
    low, high = (f"{np.expm1(sign * tested.largest):+.0%}".replace("-", "−") for sign in (-1, 1))
    ends = f"± {high[1:-1]}" if low[1:] == high[1:] else f"{low[:-1]} to {high[:-1]}"
    is_few = tested.starts < MIN_STARTS
    words = "largest error" if is_few else f"{100 * LEVEL:.0f} %"
    words += f" of {tested.starts} start brain{'s' if tested.starts > 1 else ''}, {ends} %"
    words += " of the folding" if metric == FOLDING else ""
    words += f": holds for {tested.starts} of {tested.starts + 1} at most" if is_few else ""
    if tested.is_corrected:
        words += f", about the prediction less the mean error of {100 * np.expm1(tested.bias):+.0f} %".replace("-", "−")
    return words + ("; no test went as far" if tested.is_beyond else "")


def held_intervals(tests: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Leave out each start in turn, and count how often intervals by the other starts contain its errors.

    Columns metric, start, tests (weeks with an observed brain), held (those within), at_most (share expected at most,
    by counting).
    """
    rows = []
    for metric in QUANTITIES:
        errors = log_errors(tests, metric)
        for start, own in errors.groupby("start"):
            others = errors[errors["start"] != start]
            tested = [
                (error, interval)
                for week, horizon, error in own[["week", "horizon", "error"]].to_numpy(dtype=float)
                if (interval := error_in_tests(others, week, horizon))
            ]
            held = sum(interval.holds(error) for error, interval in tested)
            if tested:
                rows.append((metric, start, len(tested), held, max(interval.coverage for _, interval in tested)))
    return pd.DataFrame(rows, columns=["metric", "start", "tests", "held", "at_most"])


def atlas_advantage(tests: Sequence[Mapping[str, Any]], horizon: float) -> tuple[float, float, float] | None:
    """Return by how much the atlas' own brain was nearer in tests than runs: mean r of the shape index of either.

    The tests are those of the default protocol over the horizon tested next, or the longest. Returns that horizon, r of
    runs and r of the atlas' own brain, or None unless the latter is larger by more than `ATLAS_MARGIN`.
    """
    rows = pd.DataFrame(tests)
    rows = rows[(rows["protocol"] == DEFAULT_PROTOCOL) & rows["model"].isin(["run", "atlas"])]
    tested = min((step for step in rows["horizon"] if step >= horizon - 1e-6), default=rows["horizon"].max())
    # the mean of each start counts once
    means = rows[rows["horizon"] == tested].groupby(["model", "start"])["r_shape_index"].mean().groupby("model").mean()
    if not {"run", "atlas"} <= set(means.index) or means["atlas"] - means["run"] <= ATLAS_MARGIN:
        return None
    return float(tested), float(means["run"]), float(means["atlas"])


def prediction_facts(tests: Sequence[Mapping[str, Any]], start_week: float, week: float) -> dict[str, Any]:
    """Describe the errors of tests for the report of a prediction of a week.

    Returns errors (by metric, the words of its tested error), held (by metric, how often intervals held when each start
    was left out), advantage (a sentence where the atlas' own brain was better, or "") and starts (the tested brains).
    """
    horizon, errors = week - start_week, {}
    for metric in QUANTITIES:
        found = error_in_tests(log_errors(tests, metric), week, horizon)
        errors[metric] = "not tested" if found is None else error_words(metric, found)
    held = held_intervals(tests).groupby("metric").agg(tests=("tests", "sum"), held=("held", "sum"))
    advantage = ""
    if better := atlas_advantage(tests, horizon):
        tested, run, atlas = better
        advantage = (
            f"In tests over {tested:g} weeks the atlas' own brain was more like the observed brain than the prediction "
            f"(mean r of the shape index {atlas:.2f} and {run:.2f}). The start's individual differences may have faded "
            "or changed by then, or the start, an average, had few of them. For the places of folds, use the atlas' "
            "own brain, which is stored with the prediction."
        )
    held_words = {str(row.Index).replace("_", " "): f"{row.held} of {row.tests}" for row in held.itertuples()}
    tested_brains = pd.DataFrame(tests)[["start", "start_week"]].drop_duplicates().itertuples(index=False)
    starts = [f"{brain} {at:g} GW" for brain, at in tested_brains]
    return {"errors": errors, "held": held_words, "advantage": advantage, "starts": starts}


UNTESTED = ErrorInTests(starts=0, largest=0.0, bias=0.0, is_corrected=False, coverage=LEVEL, is_beyond=False)
"""The intervals of a run without tests are those of its members."""


def spread_of_members(values: Floats, level: float) -> float:
    """Return half the width of the two-sided prediction interval for one further value of a normal sample (n,).

    It is t s √(1 + 1/n) with Student's t of n − 1 degrees of freedom; NaN for fewer than two values.
    """
    n = len(values)
    if n < 2:
        return np.nan
    return float(t.ppf((1 + level) / 2, n - 1) * np.std(values, ddof=1) * np.sqrt(1 + 1 / n))


def interval_table(
    run: pd.DataFrame,
    members: pd.DataFrame,
    observed: pd.DataFrame,
    tests: Sequence[Mapping[str, Any]] = (),
) -> pd.DataFrame:
    """Return the intervals of whole brains by week and metric.

    The tables have the metrics (week, hemisphere, metric, value, unit) of the run, of all its members, and of the
    observed brains of its weeks, which may be empty. `tests` are the rows of `norms/predictions.yaml`, empty unless the
    run is a prediction.

    The spread of the members and the largest error of the tests are added in logarithms, as √(spread² + error²), about
    the mean of the members less the bias of the tests if that is corrected. Those of later weeks are never narrower.

    Columns week, metric, unit, run (its value), members (number of values; one that did not reach a week has none),
    mean, sd (NaN for one), tested_starts, largest_error, bias (fractions, of `accuracy.error_in_tests`; NaN without
    tests), is_corrected, coverage (share of brains in the interval: at most this much by `tested_starts`, or `LEVEL` of
    further members without tests), low, high, observed (NaN without a brain) and contains_observed.
    """
    keys, names = ["week", "metric"], metrics_shown(Shown.INTERVALS)
    own, varied, brains = (
        table[(table["hemisphere"] == "whole") & table["metric"].isin(names)] for table in (run, members, observed)
    )
    rows, start = [], own["week"].min()
    for metric, table in varied.groupby("metric"):
        errors, widest = log_errors(tests, str(metric)), 0.0
        for at, group in table.groupby("week")["value"]:
            week = float(str(at))
            tested = (error_in_tests(errors, week, week - start) if week > start else None) or UNTESTED
            logs = log_value(str(metric), group.to_numpy(dtype=float))
            half = np.hypot(spread_of_members(logs, tested.coverage), tested.largest)
            widest = max(widest, half) if np.isfinite(half) else half
            middle = logs.mean() - tested.bias * tested.is_corrected
            row = {"week": week, "metric": metric, "members": len(group), "mean": group.mean(), "sd": group.std()}
            largest, bias = np.expm1([tested.largest, tested.bias]) if tested.starts else (np.nan, np.nan)
            row |= {"tested_starts": tested.starts, "largest_error": largest, "bias": bias}
            row |= {"is_corrected": tested.is_corrected, "coverage": tested.coverage}
            low, high = (from_log(str(metric), middle + sign * widest) for sign in (-1, 1))
            rows.append(row | {"low": low, "high": high})
    table = own[[*keys, "unit", "value"]].rename(columns={"value": "run"}).merge(pd.DataFrame(rows), "left", keys)
    table = table.merge(brains.groupby(keys)["value"].first().rename("observed").reset_index(), "left", keys)
    inside = table["observed"].between(table["low"], table["high"]).astype("boolean")
    return table.assign(
        members=table["members"].fillna(0).astype(int),
        contains_observed=inside.mask(table["observed"].isna() | table["low"].isna()),
    )


def ensemble_maps(
    run: TriangleMesh, members: Sequence[TriangleMesh], shape_indices: Sequence[Floats]
) -> dict[str, Floats]:
    """Return maps (n,) of the spread of an ensemble at the vertices of a run's hemisphere.

    Vertices of `members` correspond to those of the run; `shape_indices` (n,) are those of the run and of the members.
    position_sd_mm is the root mean square distance of the members, aligned rigidly with the run, from their mean
    position, with n − 1, NaN for fewer than two; sulcus_probability and gyrus_probability are the shares of run and
    members whose vertex is sulcus or gyrus.
    """
    areas = vertex_areas(run)
    shapes = [member.vertices for member in members]
    aligned = [transform_points(shape, rigid_fit(shape, run.vertices, areas)) for shape in shapes]
    values, spread = np.stack(shape_indices), np.full(run.vertices.shape, np.nan)
    if len(members) > 1:
        spread = np.var(aligned, axis=0, ddof=1)
    return {
        "position_sd_mm": np.sqrt(spread.sum(axis=1)),
        "sulcus_probability": (values <= SULCUS).mean(axis=0),
        "gyrus_probability": (values >= GYRUS).mean(axis=0),
    }
