"""Intervals and spread of an ensemble: the members of a run, with uncertain inputs varied."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import norm, t

from ..geometry.alignment import rigid_fit
from ..geometry.deformations import transform_points
from ..geometry.triangles import Floats, TriangleMesh, vertex_areas
from ..quantities import Shown, metrics_shown

LEVEL = 0.9
"""Coverage of the prediction interval for one further member."""
SULCUS, GYRUS = -0.375, 0.375
"""Largest shape index of a sulcus and smallest of a gyrus: the limits of rut and ridge of Koenderink & van Doorn
1992."""


def prediction_interval(
    values: Sequence[float] | Floats, level: float = LEVEL, method_sd: float = 0.0
) -> tuple[float, float]:
    """Return the two-sided prediction interval for one further value of a normal sample.

    It is mean ± √(t² s² (1 + 1/n) + z² m²) with Student's t of n − 1 degrees of freedom, the normal quantile z, and the
    standard deviation m of an error that all values share, `method_sd`; NaN for fewer than two values.
    """
    n = len(values)
    if n < 2:
        return np.nan, np.nan
    upper = (1 + level) / 2
    half = np.hypot(t.ppf(upper, n - 1) * np.std(values, ddof=1) * np.sqrt(1 + 1 / n), norm.ppf(upper) * method_sd)
    return float(np.mean(values) - half), float(np.mean(values) + half)


def method_errors(tests: Sequence[Mapping[str, Any]], horizon_gw: float) -> dict[str, float]:
    """Return the root mean square error of predictions at a horizon for each metric that was tested, as a fraction.

    `tests` are the rows of `norms/predictions.yaml`. The error is linear between tested horizons, from none at 0, and
    constant beyond the last.
    """
    rows = pd.DataFrame(tests).query("model == 'run'")
    errors = {}
    for metric in metrics_shown(Shown.INTERVALS):
        if f"{metric}_error" not in rows:
            continue
        squares = (rows[f"{metric}_error"] ** 2).groupby(rows["horizon"]).mean().dropna()
        errors[metric] = float(np.interp(horizon_gw, [0.0, *squares.index], [0.0, *np.sqrt(squares)]))
    return errors


def interval_table(
    run: pd.DataFrame,
    members: pd.DataFrame,
    observed: pd.DataFrame,
    tests: Sequence[Mapping[str, Any]] = (),
) -> pd.DataFrame:
    """Return the intervals of whole brains by week and metric.

    Parameters
    ----------
    run, members, observed
        Metrics with columns week, hemisphere, metric, value, unit; of the run, of all its members, and of the observed
        brains of its weeks. `observed` may be empty.
    tests
        Of a prediction, the tests of `method_errors`.

    Returns
    -------
    DataFrame
        Columns week, metric, unit, run (its value), members (number of values), mean, sd, method_sd (of `tests`, NaN if
        the metric was not tested), low, high, observed (NaN without a brain) and contains_observed. A member that did
        not reach a week has no value there.
    """
    keys, names = ["week", "metric"], metrics_shown(Shown.INTERVALS)
    own, varied, brains = (
        table[(table["hemisphere"] == "whole") & table["metric"].isin(names)] for table in (run, members, observed)
    )
    rows, start = [], own["week"].min()
    errors = {week: method_errors(tests, week - start) if tests else {} for week in own["week"].unique()}
    for (week, metric), group in varied.groupby(keys)["value"]:
        method_sd = errors[week].get(str(metric), np.nan) * group.mean()
        low, high = prediction_interval(group.to_numpy(), method_sd=np.nan_to_num(method_sd))
        statistics = {"members": len(group), "mean": group.mean(), "sd": group.std(), "method_sd": method_sd}
        rows.append({"week": week, "metric": metric, **statistics, "low": low, "high": high})
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

    Vertices of `members` correspond to those of the run. Positions are compared after a rigid alignment with the run.
    `shape_indices` (n,) are those of the run and of the members.

    Returns
    -------
    dict
        position_sd_mm, the root mean square distance of the members from their mean position, with n − 1, NaN for
        fewer than two; and sulcus_probability and gyrus_probability, the shares of run and members in which the
        vertex is sulcus or gyrus.
    """
    areas = vertex_areas(run)
    motions = [rigid_fit(member.vertices, run.vertices, areas) for member in members]
    aligned = [transform_points(member.vertices, motion) for member, motion in zip(members, motions, strict=True)]
    values, spread = np.stack(shape_indices), np.full(run.vertices.shape, np.nan)
    if len(members) > 1:
        spread = np.var(aligned, axis=0, ddof=1)
    return {
        "position_sd_mm": np.sqrt(spread.sum(axis=1)),
        "sulcus_probability": (values <= SULCUS).mean(axis=0),
        "gyrus_probability": (values >= GYRUS).mean(axis=0),
    }
