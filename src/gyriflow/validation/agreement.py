"""How much simulated brains are folded beside the real ones of their week, hemisphere by hemisphere."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

METRICS = ("gyrification_index", "gyrification_index_envelope", "mean_sulcal_depth", "mean_curvedness")
"""What is compared of the table of metrics."""
BAND = "spangy_share_B"
"""What the names of the spectrum's shares begin with: relative power of a band."""
COLUMNS = ["run", "subject", "week", "real", "hemisphere", "metric", "value", "real_value", "difference"]


def folding_agreement(
    metrics: pd.DataFrame, spectra: pd.DataFrame, pairs: Sequence[tuple[str, str, float, str]]
) -> pd.DataFrame:
    """Returns metrics of simulated brains beside those of the real ones, a row per brain, week, hemisphere and metric.

    Parameters
    ----------
    metrics
        Columns subject, run ("real" for real brains), week, hemisphere, metric, value.
    spectra
        Columns subject, run, week, hemisphere, band, relative_power.
    pairs
        (run, start brain, week, real brain) to compare.

    Returns
    -------
    DataFrame
        run, subject, week, real, hemisphere, metric (of `METRICS`, and `BAND` with a number), value, real_value,
        difference (value less real_value). Metrics that one of the two lacks are left out.
    """
    shares = spectra.dropna(subset="relative_power")
    shares = shares.assign(metric=BAND + shares["band"].astype(str), value=shares["relative_power"])
    wanted = metrics[metrics["metric"].isin(METRICS)]
    both = pd.concat([table[["subject", "run", "week", "hemisphere", "metric", "value"]] for table in (wanted, shares)])
    tables = [
        _side_by_side(both, {"run": run, "subject": brain, "week": week}, {"run": "real", "subject": real})
        for run, brain, week, real in pairs
    ]
    return pd.concat(tables, ignore_index=True)[COLUMNS] if tables else pd.DataFrame(columns=COLUMNS)


def _side_by_side(table: pd.DataFrame, simulated: Mapping[str, Any], real: Mapping[str, Any]) -> pd.DataFrame:
    keys = ["hemisphere", "metric"]
    one, other = (
        table.loc[(table[list(labels)] == pd.Series(labels)).all(axis=1), [*keys, "value"]]
        for labels in (simulated, real)
    )
    joined = one.merge(other.rename(columns={"value": "real_value"}), on=keys)
    return joined.assign(**simulated, real=real["subject"], difference=joined["value"] - joined["real_value"])
