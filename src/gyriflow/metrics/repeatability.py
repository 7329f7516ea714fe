"""The noise of measuring: how much numbers of one brain differ if it is turned and
voxelised again.

A `Repeatability` is the content of `norms/repeatability.yaml`, which
`benchmarks/repeatability.py` writes.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ..quantities import METRICS
from ..settings.terms import SPECTRUM_PREFIXES

type Repeatability = Mapping[str, Any]


def difference_noise(
    metric: str,
    value: float,
    record: Repeatability,
) -> float:
    """Return the standard deviation of the difference between two measurements of a
    value; NaN if it is not known.

    It is relative to the value, but for metrics that may be negative.
    """
    row = record["metrics"].get(metric, {})
    one = (
        row.get("sd", np.nan)
        if METRICS[metric].is_signed
        else row.get("cv", np.nan) * abs(value)
    )
    return float(np.sqrt(2.0) * one)


def with_change_noise(change: pd.DataFrame, record: Repeatability) -> pd.DataFrame:
    """Return a table of `tables.change_between_scans` with the column noise: the SD of
    `change` of an unchanged brain.

    It is NaN for regions, which are noisier than what they are parts of.
    """
    rows = zip(
        change["metric"],
        change["from_value"],
        change["region"],
        strict=True,
    )
    noise = [
        np.nan if region else difference_noise(metric, value, record)
        for metric, value, region in rows
    ]
    return change.assign(noise=np.array(noise, dtype=float))


def with_distance_noise(
    distances: pd.DataFrame,
    record: Repeatability,
    name: str,
) -> pd.DataFrame:
    """Return a table of distances with the column noise: the distance of a brain from
    itself, measured again.

    `name` is the column that names the distance: a metric of spectra, or a measure of
    `compare.sweeps`, which may be a relative difference of a metric or a difference of
    a band's share.
    """
    return distances.assign(
        noise=distances[name]
        .map(lambda measure: _distance_noise(measure, record))
        .astype(float)
    )


def _distance_noise(measure: str, record: Repeatability) -> float:
    if measure in record["distances"]:
        return float(record["distances"][measure])
    # the mean of |x| is √(2/π) of its standard deviation
    if "relative_power_B" in measure:
        prefix = (
            SPECTRUM_PREFIXES["shape_index"]
            if measure.startswith("shape_index")
            else ""
        )
        band = measure.removesuffix("_weyl")[-2:]
        spread = (
            record["metrics"]
            .get(f"spangy_{prefix}{band}_relative_power", {})
            .get("sd", np.nan)
        )
    else:
        spread = record["metrics"].get(measure, {}).get("cv", np.nan)
    return float(np.sqrt(2.0) * np.sqrt(2.0 / np.pi) * spread)


def score_noise(weights: Mapping[str, float], record: Repeatability) -> float:
    """Return the score of calibration that a brain has against itself, measured again;
    NaN if one part is not known."""
    return float(
        sum(
            weight * record["scores"].get(name, np.nan)
            for name, weight in weights.items()
        )
    )
