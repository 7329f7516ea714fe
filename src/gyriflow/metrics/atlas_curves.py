"""Metrics of the average brains of normal atlases over the weeks, and how far measured
brains are from them.

The atlases are the content of `norms/atlases.yaml`, which `benchmarks/atlas_curves.py`
writes.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ..quantities import METRICS
from ..settings.terms import SIDES
from .repeatability import Repeatability, difference_noise
from .tables import BRAIN

CURVES = ["atlas", "hemisphere", "metric", "week", "value"]
"""Columns of the curves."""
DIFFERENCES = [
    *BRAIN,
    "hemisphere",
    "metric",
    "value",
    "unit",
    "atlas",
    "expected",
    "difference",
    "relative_difference",
    "noise",
    "times_noise",
]
"""Columns of the differences."""


def atlas_curves(
    content: Mapping[str, Any], made_with: Mapping[str, Any]
) -> pd.DataFrame:
    """Return the metrics of the atlases' brains, a row per atlas, hemisphere, metric
    and week.

    `made_with` are the settings of a study that its metrics depend on
    (`study.checks.norm_settings`). If the atlases were measured with others, there are
    no rows.
    """
    rows: list[tuple[str, str, str, float, float]] = []
    for name, value in content["made_with"].items():
        if made_with.get(name) != value:
            return pd.DataFrame(rows, columns=CURVES)
    for atlas, facts in content["atlases"].items():
        for hemisphere, metrics in facts["values"].items():
            for metric, values in metrics.items():
                for week, value in zip(
                    facts["weeks"],
                    values,
                    strict=True,
                ):
                    rows.append((atlas, hemisphere, metric, week, value))
    return pd.DataFrame(rows, columns=CURVES)


def atlas_differences(
    metrics: pd.DataFrame,
    curves: pd.DataFrame,
    record: Repeatability,
) -> pd.DataFrame:
    """Return the differences of brains from the curves of atlases, linear between their
    weeks. Brains outside these weeks have no rows.

    `metrics` has the columns subject, run, week, hemisphere, metric, value, unit;
    `curves` are those of `atlas_curves`.

    Columns as `metrics`, and atlas, expected, difference, relative_difference (to what
    is expected; NaN for metrics that may be negative), noise (SD of the difference
    between two measurements of a brain), times_noise (difference / noise).
    """
    # the whole of a single hemisphere is half of a brain
    side = metrics["hemisphere"].where(metrics["hemisphere"].isin(SIDES))
    n_sides = side.groupby([metrics[name] for name in BRAIN]).transform("nunique")
    is_half = (metrics["hemisphere"] == "whole") & (n_sides < len(SIDES))
    comparable = metrics[~is_half]
    parts = []
    by_curve = curves.groupby(["atlas", "hemisphere", "metric"], sort=False)
    for names, curve in by_curve:
        atlas, hemisphere, metric = map(str, names)
        is_of_curve = (comparable["hemisphere"] == hemisphere) & (
            comparable["metric"] == metric
        )
        is_between = comparable["week"].between(*curve["week"].agg(["min", "max"]))
        rows = comparable[is_of_curve & is_between & comparable["value"].notna()]
        if rows.empty:
            continue
        expected = np.interp(
            rows["week"],
            curve["week"],
            curve["value"],
        )
        difference = rows["value"] - expected
        relative = np.nan if METRICS[metric].is_signed else difference / expected
        noise = np.array(
            [difference_noise(metric, value, record) for value in expected]
        )
        parts.append(
            rows.assign(
                atlas=atlas,
                expected=expected,
                difference=difference,
                relative_difference=relative,
                noise=noise,
                times_noise=difference / noise,
            )
        )
    if not parts:
        return pd.DataFrame(columns=DIFFERENCES)
    return pd.concat(parts, ignore_index=True)[DIFFERENCES]
