"""How near the runs of a study are to a real brain, and which of them is nearest by each measure."""

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..parameters.terms import ELEMENTS_NEEDED, FOLD_BANDS

SIZES = ("area", "volume", "gyrification_index")
"""Metrics of whole brains whose relative difference from the real one is a measure."""
MODES = "weyl_number"
"""The metric that says at how many modes the spectrum of a hemisphere is cut."""
SURFACE_DISTANCES = ("symmetric_mean", "hausdorff95")
COLUMNS = ("hemisphere", "measure", "value", "real_value", "distance", "unit", "flag")
"""Columns of `distances_to`."""
NOT_RESOLVED = "not resolved by the mesh"
ENDS = "at the end of the range"


def distances_to(
    real: str,
    metrics: pd.DataFrame,
    spectra: pd.DataFrame,
    spectral: pd.DataFrame,
    similarity: pd.DataFrame,
) -> pd.DataFrame:
    """Returns how far one simulated brain is from a real one, a row per hemisphere and measure.

    Measures: `relative_power_B4` to `B6`, the share of the band in the power of the spectrum, and the same with
    `_weyl`, cut at Weyl's number as the paper's (distance: the absolute difference); `spectral_distance_…` of
    `metrics.spangy`; `surface_symmetric_mean` and `surface_hausdorff95` of `metrics.similarity`; `area`, `volume`,
    `gyrification_index` (distance: the absolute relative difference); `weyl_number` (no distance).

    `real` is the id of the real brain. Metrics and spectra are rows of the simulated brain and of the real one, whose
    `run` is "real"; spectral and similarity those of the simulated brain, with the column `real`. The columns are
    `COLUMNS`; `flag` is "ok" or says what is wrong with the value.
    """
    rows = [*_band_rows(real, spectra), *_size_rows(real, metrics)]
    for row in spectral[spectral["real"] == real].itertuples():
        rows.append((row.hemisphere, row.metric, np.nan, np.nan, row.value, "1", row.flag))
    for row in similarity[(similarity["real"] == real) & similarity["metric"].isin(SURFACE_DISTANCES)].itertuples():
        rows.append((row.hemisphere, f"surface_{row.metric}", np.nan, np.nan, row.value, row.unit, "ok"))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _band_rows(real: str, spectra: pd.DataFrame) -> list[tuple]:
    rows = []
    pairs = _pairs(spectra[spectra["band"].isin(FOLD_BANDS)], real, ["hemisphere", "band"])
    for pair in pairs.sort_values("band", kind="stable").to_dict("records"):
        whole, fine = (pair[name] and pair[f"{name}_real"] for name in ("complete", "resolved"))
        values = (pair["relative_power"], pair["relative_power_real"]) if whole else (np.nan, np.nan)
        flag = "ok" if whole and fine else "not resolved" if whole else "cut off"
        distance = abs(values[0] - values[1])
        name = f"relative_power_B{pair['band']}"
        rows.append((pair["hemisphere"], name, *values, distance, "1", flag))
        cut = pair["relative_power_weyl"], pair["relative_power_weyl_real"]
        flag = "cut off" if np.isnan(sum(cut)) else "ok" if fine else "not resolved"
        rows.append((pair["hemisphere"], f"{name}_weyl", *cut, abs(cut[0] - cut[1]), "1", flag))
    return rows


def _size_rows(real: str, metrics: pd.DataFrame) -> list[tuple]:
    pairs = _pairs(metrics[metrics["metric"].isin([*SIZES, MODES])], real, ["hemisphere", "metric"])
    # where spectra are cut is no likeness
    distances = (pairs["value"] / pairs["value_real"] - 1).abs().where(pairs["metric"] != MODES)
    columns = (pairs[name] for name in ("hemisphere", "metric", "value", "value_real"))
    return [(*row, "ok") for row in zip(*columns, distances, pairs["unit"].astype(str), strict=True)]


def _pairs(table: pd.DataFrame, real: str, keys: list[str]) -> pd.DataFrame:
    """Returns the rows of the simulated brain beside those of the real one, whose columns end in _real."""
    measured = table["run"] == "real"
    of_real = table[measured & (table["subject"] == real)]
    return table[~measured].merge(of_real, on=keys, suffixes=("", "_real"))


def member_row(
    labels: Mapping[str, object], values: Mapping[str, object], params: Mapping, zones: Mapping, summary: Mapping
) -> dict[str, object]:
    """Returns the row of a run in the table of a study's members: values, how it ended, and what it took.

    Labels are study, run, subject and week, with `population`; values the varied ones, by their keys; params, zones and
    summary the content of the files of the run.
    """
    through = zones["elements_through_cortex"]
    fine = through is not None and through >= ELEMENTS_NEEDED[zones["order"]]
    return {
        **labels,
        **values,
        "thickness_mm": params["thickness_mm"],
        "shear_modulus_cortex_pa": params["shear_modulus_cortex_pa"],
        "elements_through_cortex": through,
        "resolution": "ok" if fine else NOT_RESOLVED,
        "outcome": "finished" if summary.get("diverged") is None else "diverged",
        "reached_week": summary.get("reached_week", params["end_week"]),
        "cause": summary.get("diverged") or "",
        "steps": summary["steps"],
        "cpu_s": summary["cpu_seconds"],
    }


def nearest(comparison: pd.DataFrame, members: pd.DataFrame, varied: Sequence[str]) -> pd.DataFrame:
    """Returns which run is nearest to each real brain by each measure, per hemisphere.

    The comparison has the columns subject, run, real and those of `COLUMNS`; members are rows of `member_row`, varied
    their columns with the varied values.

    Returns
    -------
    DataFrame
        subject, real, hemisphere, measure, the varied values of the nearest run, run, distance, the next values
        (`next_…`) and their distance, flag: "ok", or that a value is at the end of the range, or not resolved.
    """
    values = {(row["subject"], row["run"]): row for row in members.to_dict("records")}
    rows = []
    compared = comparison.dropna(subset=["distance"])
    for keys, group in compared.groupby(["subject", "real", "hemisphere", "measure"], sort=False):
        ranked = group.sort_values("distance", kind="stable")
        best = ranked.iloc[0]
        subject = str(keys[0])
        of_best = values[(subject, best["run"])]
        row = dict(zip(("subject", "real", "hemisphere", "measure"), keys, strict=True))
        row |= {name: of_best[name] for name in varied}
        row |= {"run": best["run"], "distance": best["distance"]}
        if len(ranked) > 1:
            second = ranked.iloc[1]
            row |= {f"next_{name}": values[(subject, second["run"])][name] for name in varied}
            row["next_distance"] = second["distance"]
        row["flag"] = _flags(best, of_best, members[members["subject"] == subject], varied)
        rows.append(row)
    columns = ["subject", "real", "hemisphere", "measure", *varied, "run", "distance"]
    columns += [*(f"next_{name}" for name in varied), "next_distance", "flag"]
    return pd.DataFrame(rows).reindex(columns=columns)


def _flags(best: pd.Series, of_best: Mapping[Hashable, Any], members: pd.DataFrame, varied: Sequence[str]) -> str:
    flags = [] if best["flag"] == "ok" else [f"band {best['flag']}"]
    if of_best["resolution"] != "ok":
        flags.append(str(of_best["resolution"]))
    for name in varied:
        known = pd.to_numeric(members[name], errors="coerce")
        if known.min() < known.max() and of_best[name] in (known.min(), known.max()):
            flags.append(ENDS)
    return "; ".join(dict.fromkeys(flags)) or "ok"
