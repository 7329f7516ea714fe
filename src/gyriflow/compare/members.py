"""How near the runs of a study are to a real brain, and which of them is nearest by each measure."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..settings.terms import ELEMENTS_NEEDED, FOLD_BANDS, MEASURED

SIZES = ("area", "volume", "gyrification_index")
"""Metrics whose relative difference from the real brain's is a measure."""
MODES = "weyl_number"
"""The metric that says at how many modes the spectrum of a hemisphere is cut."""
DISTANCE_COLUMNS = ("hemisphere", "measure", "value", "real_value", "distance", "unit", "flag")
"""Columns of `distances_to`."""


def distances_to(
    real: str,
    metrics: pd.DataFrame,
    spectra: pd.DataFrame,
    spectral: pd.DataFrame,
    surfaces: Mapping[str, Mapping[str, float]],
) -> pd.DataFrame:
    """Tell how far one simulated brain is from a real one, a row per hemisphere and measure.

    Measures: `relative_power_B4` to `B6`, the share of the band in the power of the spectrum, and the same with
    `_weyl`, cut at Weyl's number as the paper's (distance: the absolute difference); `spectral_distance_…` of
    `metrics.spangy`; `surface_distance` and `surface_distance95`, distance_mm and distance95_mm of aligned surfaces;
    `area`, `volume`,
    `gyrification_index` (distance: the absolute relative difference); `weyl_number` (no distance).

    `real` is the id of the real brain. Metrics and spectra are rows of the simulated brain and of the real one, whose
    `run` is "real"; spectral those of the simulated brain, with the column `real`; surfaces by hemisphere the distances
    of `distances.aligned_distances`. The columns are `DISTANCE_COLUMNS`; `flag` is "ok" or says what is wrong with
    the value.
    """
    rows = [*_band_rows(real, spectra), *_size_rows(real, metrics)]
    for row in spectral[spectral["real"] == real].itertuples():
        rows.append((row.hemisphere, row.metric, np.nan, np.nan, row.value, "1", row.flag))
    for hemisphere, distances in surfaces.items():
        for name in ("distance", "distance95"):
            rows.append((hemisphere, f"surface_{name}", np.nan, np.nan, distances[f"{name}_mm"], "mm", "ok"))
    return pd.DataFrame(rows, columns=list(DISTANCE_COLUMNS))


def _band_rows(real: str, spectra: pd.DataFrame) -> Iterator[tuple]:
    pairs = _pairs(spectra[spectra["band"].isin(FOLD_BANDS)], real, ["hemisphere", "band"])
    for pair in pairs.sort_values("band", kind="stable").to_dict("records"):
        name = f"relative_power_B{pair['band']}"
        resolved = "ok" if pair["resolved"] and pair["resolved_real"] else "not resolved"
        whole = pair["relative_power"], pair["relative_power_real"]
        if not (pair["complete"] and pair["complete_real"]):
            whole = np.nan, np.nan
        cut = pair["relative_power_weyl"], pair["relative_power_weyl_real"]
        for measure, (value, of_real) in ((name, whole), (f"{name}_weyl", cut)):
            flag = "cut off" if np.isnan(value + of_real) else resolved
            yield pair["hemisphere"], measure, value, of_real, abs(value - of_real), "1", flag


def _size_rows(real: str, metrics: pd.DataFrame) -> Iterator[tuple]:
    pairs = _pairs(metrics[metrics["metric"].isin([*SIZES, MODES])], real, ["hemisphere", "metric"])
    for pair in pairs.to_dict("records"):
        # where spectra are cut is no likeness
        distance = np.nan if pair["metric"] == MODES else abs(pair["value"] / pair["value_real"] - 1)
        yield pair["hemisphere"], pair["metric"], pair["value"], pair["value_real"], distance, str(pair["unit"]), "ok"


def _pairs(table: pd.DataFrame, real: str, keys: list[str]) -> pd.DataFrame:
    measured = table["run"] == MEASURED
    of_real = table[measured & (table["subject"] == real)]
    return table[~measured].merge(of_real, on=keys, suffixes=("", "_real"))


def member_row(
    labels: Mapping[str, object], values: Mapping[str, object], params: Mapping, zones: Mapping, summary: Mapping
) -> dict[str, object]:
    """Return the row of a run in the table of a study's members: values, how it ended, and what it took.

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
        "resolution": "ok" if fine else "not resolved by the mesh",
        "outcome": "finished" if summary.get("diverged") is None else "diverged",
        "reached_week": summary.get("reached_week", params["end_week"]),
        "cause": summary.get("diverged") or "",
        "steps": summary["steps"],
        "cpu_s": summary["cpu_seconds"],
    }


def nearest(comparison: pd.DataFrame, members: pd.DataFrame, varied: Sequence[str]) -> pd.DataFrame:
    """Find the run that is nearest to each real brain by each measure, per hemisphere.

    The comparison has the columns subject, run, real and those of `DISTANCE_COLUMNS`; members are rows of `member_row`,
    varied their columns with the varied values.

    Returns
    -------
    DataFrame
        subject, real, hemisphere, measure, the varied values of the nearest run, run, distance, the next values
        (`next_…`) and their distance, flag: "ok", or that a value is at the end of the range, or not resolved.
    """
    keys, varied = ["subject", "real", "hemisphere", "measure"], list(varied)
    columns = [*keys, *varied, "run", "distance", *(f"next_{name}" for name in varied), "next_distance", "flag"]
    table = comparison.dropna(subset=["distance"]).merge(
        members[["subject", "run", *varied, "resolution"]], on=["subject", "run"]
    )
    rows = []
    for _, group in table.groupby(keys, sort=False):
        best, *others = group.sort_values("distance", kind="stable").to_dict("records")
        row = {name: best[name] for name in (*keys, *varied, "run", "distance")}
        if others:
            row |= {f"next_{name}": others[0][name] for name in (*varied, "distance")}
        rows.append(row | {"flag": _flags(best, members[members["subject"] == best["subject"]], varied)})
    return pd.DataFrame(rows).reindex(columns=columns)


def _flags(best: Mapping[Hashable, Any], members: pd.DataFrame, varied: Sequence[str]) -> str:
    flags = [] if best["flag"] == "ok" else [f"band {best['flag']}"]
    if best["resolution"] != "ok":
        flags.append(str(best["resolution"]))
    for name in varied:
        values = pd.to_numeric(members[name], errors="coerce")
        if values.min() < values.max() and best[name] in (values.min(), values.max()):
            flags.append("at the end of the range")
    return "; ".join(dict.fromkeys(flags)) or "ok"
