"""What runs are worth by how long after their start: gain and skill by start week and horizon."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from .placement import MEASURES

KEYS = ["model", "kind", "known_gw", "start_week", "horizon"]
GAINS = [f"{name}_{measure}" for name in ("gain", "gain_low", "gain_high", "skill") for measure in MEASURES]
MOVES = ["displacement_r", "displacement_slope", "displacement_r_scaling"]


def horizon_table(
    validation: pd.DataFrame,
    displacement: pd.DataFrame,
    models: Mapping[str, str],
    known_until_gw: Mapping[str, float | None],
) -> pd.DataFrame:
    """Returns what each model is worth by start week and by horizon, explained and predicted weeks apart.

    Parameters
    ----------
    validation
        Rows of `tables.validation_row`.
    displacement
        Rows of `displacement.displacement_table` with the columns run, start_week and seed; may be empty.
    models
        What runs are called that differ in their start, their seed or in what is known only, by run.
    known_until_gw
        The week up to which the brains of a run's growth are known, by run; None for all.

    Returns
    -------
    DataFrame
        model, kind, known_gw (weeks after the start that growth is known for, NaN for all), start_week, horizon, week,
        runs (how many rows are averaged: seeds and starts of one week); gain_…, gain_low_…, gain_high_… and skill_… of
        each measure; displacement_r, displacement_slope and displacement_r_scaling of the interval that ends there.
    """
    rows = validation.assign(
        model=validation["run"].map(models).fillna(validation["run"]),
        known_gw=validation["run"].map({run: week for run, week in known_until_gw.items() if week is not None}),
    )
    rows["known_gw"] = (rows["known_gw"].astype(float) - rows["start_week"]).clip(lower=0)
    if len(displacement):
        ends = displacement.rename(columns={"to_week": "week"})
        same = ["run", "start_week", "seed", "week"]
        rows = rows.merge(ends[[*same, *MOVES]].groupby(same, as_index=False).mean(), on=same, how="left")
    else:
        rows = rows.assign(**dict.fromkeys(MOVES, np.nan))
    groups = rows.groupby([*KEYS, "week"], dropna=False, sort=True)
    table = groups[[*GAINS, *MOVES]].mean().reset_index()
    table.insert(len(KEYS) + 1, "runs", groups.size().to_numpy())
    return table


def over_starts(horizons: pd.DataFrame) -> pd.DataFrame:
    """Returns the means over the start weeks of a table of `horizon_table`, with how many there are in `starts`."""
    groups = horizons.groupby(["model", "kind", "known_gw", "horizon"], dropna=False, sort=True)
    table = groups[[*(name for name in GAINS if "low" not in name and "high" not in name), *MOVES]].mean().reset_index()
    table.insert(4, "starts", groups["start_week"].nunique().to_numpy())
    return table


def by_kind(rows: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Returns {kind: {measure: {horizon: gain, skill and number of starts}}} of rows of one run's validation."""
    return {
        str(kind): {
            measure: {
                f"{horizon:g}": {
                    "gain": _number(at[f"gain_{measure}"].mean()),
                    "skill": _number(at[f"skill_{measure}"].mean()),
                    "starts": len(at["start_week"].unique()),
                }
                for horizon, at in of_kind.groupby("horizon")
            }
            for measure in MEASURES
        }
        for kind, of_kind in rows.groupby("kind")
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
