"""Change between scans of one subject, measured and simulated, and tables of a group with one row a brain."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from .age_metrics import BRAIN, MEASURED

SAME_WEEK_GW = 0.005
"""Weeks in file names have two decimals."""


def change_between_scans(metrics: pd.DataFrame, scans: Mapping[str, Sequence[str]]) -> pd.DataFrame:
    """Returns how metrics change between successive scans of a subject, and between the same weeks of simulations.

    Parameters
    ----------
    metrics
        Columns subject (the brain), run, week, hemisphere, metric, value, unit, and region where they are of regions.
    scans
        The brains of each subject, by week.

    Returns
    -------
    DataFrame
        subject, run ("real", or a run that began at the earlier scan), from_brain, to_brain, from_week, to_week,
        hemisphere, region ("" for whole hemispheres), metric, unit, from_value, to_value, change, change_per_week,
        relative_change (change/abs(from_value)), measured_change (between the scans), difference (to_value less that of
        the later scan; 0 for the scans themselves).
    """
    table = metrics.assign(region=metrics["region"].fillna("") if "region" in metrics else "")
    what = ["hemisphere", "region", "metric", "unit"]
    parts = []
    for subject, brains in scans.items():
        for first, second in pairwise(brains):
            scan = table[(table["subject"] == second) & (table["run"] == MEASURED)]
            later = scan.set_index(what)["value"]
            to_week = float(scan["week"].iloc[0])
            began = table[table["subject"] == first]
            from_week = float(began.loc[began["run"] == MEASURED, "week"].iloc[0])
            starts = began[(began["week"] - from_week).abs() < SAME_WEEK_GW]
            ends = {MEASURED: later} | {
                str(run): rows.set_index(what)["value"]
                for run, rows in began[
                    (began["run"] != MEASURED) & ((began["week"] - to_week).abs() < SAME_WEEK_GW)
                ].groupby("run", sort=False)
            }
            measured = starts[starts["run"] == MEASURED].set_index(what)["value"]
            for run, end in ends.items():
                begin = starts[starts["run"] == run].set_index(what)["value"]
                part = pd.DataFrame({"from_value": begin, "to_value": end}).dropna()
                part["change"] = part["to_value"] - part["from_value"]
                part["change_per_week"] = part["change"] / (to_week - from_week)
                part["relative_change"] = part["change"] / part["from_value"].abs().replace(0.0, np.nan)
                part["measured_change"] = (later - measured).reindex(part.index)
                part["difference"] = part["to_value"] - later.reindex(part.index)
                part = part.reset_index().assign(subject=subject, run=run, from_brain=first, to_brain=second)
                parts.append(part.assign(from_week=from_week, to_week=to_week))
    values = ["from_value", "to_value", "change", "change_per_week", "relative_change", "measured_change", "difference"]
    columns = ["subject", "run", "from_brain", "to_brain", "from_week", "to_week", *what, *values]
    return pd.concat(parts, ignore_index=True)[columns] if parts else pd.DataFrame(columns=columns)


def long_table(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Returns tables of metrics, of whole hemispheres and of regions, as one, a row per number.

    Columns subject, run, week, hemisphere, region ("" for whole hemispheres), metric, value, unit.
    """
    both = pd.concat([table.assign(region=table.get("region", "")) for table in tables])
    columns = [*BRAIN, "hemisphere", "region", "metric", "value", "unit"]
    return both[columns].reset_index(drop=True)


def wide_table(table: pd.DataFrame) -> pd.DataFrame:
    """Returns a table as of `long_table` with a row per brain, run and week.

    The columns are named by hemisphere, region, metric and unit, such as `left_frontal_area_cm2`; numbers without a
    unit have none in their name.
    """
    unit = table["unit"].astype(str).replace({"1": "", "nan": ""}).str.replace("/", "_per_")
    parts = [table["hemisphere"], table["region"].fillna(""), table["metric"], unit]
    names = ["_".join(part for part in row if part).replace(" ", "-") for row in zip(*parts, strict=True)]
    wide = table.assign(column=names).pivot_table("value", BRAIN, "column", aggfunc="first")
    brains = pd.MultiIndex.from_frame(table[BRAIN].drop_duplicates())
    return wide.reindex(index=brains, columns=list(dict.fromkeys(names))).reset_index().rename_axis(columns=None)
