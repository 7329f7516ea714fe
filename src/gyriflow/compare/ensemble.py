"""Intervals and spread of an ensemble: the members of a run, with uncertain inputs varied."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import t

from ..geometry.alignment import rigid_fit
from ..geometry.deformations import transform_points
from ..geometry.triangles import Floats, TriangleMesh, vertex_areas
from ..quantities import Shown, metrics_shown
from .accuracy import LEVEL, ErrorInTests, error_in_tests, from_log, log_errors, log_value

SULCUS, GYRUS = -0.375, 0.375
"""Largest shape index of a sulcus and smallest of a gyrus: the limits of rut and ridge of Koenderink & van Doorn
1992."""
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
