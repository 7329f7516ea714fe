"""Comparison with what the FetalFoldSim paper reports; its numbers are in `workflow/published/fetalfoldsim.yaml`."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..settings.terms import CARBON_INTENSITY_G_PER_KWH, CORE_POWER_W, FOLD_BANDS
from .sweeps import WEYL_NUMBER

AGREEMENT_TOL = 0.1
"""Largest relative difference at which displacements, or numbers of modes, agree with those of the paper."""
MAX_WEAK_SHARE = 0.05
"""Share of the spectrum's power below which a band counts as very weak."""
NOT_RUN, AGREES, NOT_COMPARABLE = "not run", "as in the paper", "another machine and mesh"
MISSING = "–"
REAL = "real "
"""Prefix of observed brains among the brains of a table."""


@dataclass(frozen=True, eq=False)
class SweepTables:
    """The varied keys and the week of a sweep, and its tables `members.csv`, `comparison.csv` and `nearest.csv`."""

    varied: Sequence[str]
    week: float
    members: pd.DataFrame
    comparison: pd.DataFrame
    nearest: pd.DataFrame

    def repeats(self, entry: Mapping[str, Any]) -> bool:
        """Return whether this sweep varies only the parameter of a published entry, and is compared at its week."""
        return list(self.varied) == [entry["parameter"]] and self.week == entry["week"]


def comparison_caption(sweep: str, week: float, comparison: pd.DataFrame) -> str:
    """Describe the observed brains that a sweep is compared with, and say whether they are of another population.

    The comparison has the columns real, real_population, same_population.
    """
    observed = comparison.drop_duplicates("real")
    if observed.empty:
        return f"No run of the sweep {sweep} has reached {week:g} GW."
    names = ", ".join(f"{row.real} ({row.real_population})" for row in observed.itertuples())
    text = f"The sweep {sweep} at {week:g} GW, compared with {names}."
    populations = sorted(set(observed.loc[~observed["same_population"].astype(bool), "real_population"]))
    if populations:
        text += f" Note that {' and '.join(populations)} is another population than that of the start brain."
    return text


def published_nearest(published: Mapping[str, Any], sweeps: Mapping[str, SweepTables]) -> pd.DataFrame:
    """Return the nearest runs by each measure for which the paper reports a nearest value too.

    The paper compares with other brains (a normal atlas). Its spectra are of the shape index, cut at Weyl's number.

    Returns
    -------
    DataFrame
        study (name of the sweep), subject, real, hemisphere, measure, parameter, nearest (value of the nearest run),
        run, distance, flag, paper (value that the paper reports), place (in the paper).
    """
    columns = ["subject", "real", "hemisphere", "measure", "parameter", "nearest", "run", "distance", "flag"]
    tables = [pd.DataFrame(columns=["study", *columns, "paper", "place"])]
    for entry in published["nearest"]:
        for name, sweep in sweeps.items():
            if sweep.repeats(entry):
                rows = sweep.nearest[sweep.nearest["measure"].str.removesuffix("_weyl") == entry["measure"]]
                rows = rows.assign(parameter=entry["parameter"], nearest=rows[entry["parameter"]])[columns]
                rows.insert(0, "study", name)
                tables.append(rows.assign(paper=entry["value"], place=entry["place"]))
    return pd.concat(tables[1:] or tables, ignore_index=True)


def replication_table(
    published: Mapping[str, Any],
    displacement: pd.DataFrame,
    sweeps: Sequence[SweepTables],
    summary: Mapping[str, Any],
) -> pd.DataFrame:
    """Compare each result of the paper with the same result here: result, place, paper, here, verdict.

    Parameters
    ----------
    published
        Content of `fetalfoldsim.yaml`.
    displacement
        Rows of one run, with the columns from_week, to_week, nodes, max_mm, mean_mm.
    sweeps
        If the sweep of a result is not among them, its verdict is `NOT_RUN`.
    summary
        `summary.json` of the same run as the displacement.

    Bands are of the shape index, cut at the largest Weyl number of all surfaces compared, per side, as in the paper.
    Values of whole bands are added.
    """
    modes = published["weyl_number"]
    rows = [*_displacements(published["displacement"], displacement), *_modes(modes, _sweep_of(modes, sweeps))]
    for entry in published["nearest"]:
        sweep = _sweep_of(entry, sweeps)
        here, verdict = _nearest(entry, sweep.nearest) if sweep else (MISSING, NOT_RUN)
        result = f"nearest {entry['parameter']} by {entry['measure']}, {entry['week']} GW"
        rows.append((result, entry["place"], f"{entry['value']:g}", here, verdict))
    for entry in published["findings"]:
        sweep = _sweep_of(entry, sweeps)
        here, verdict = _finding(entry["check"], sweep) if sweep else (MISSING, NOT_RUN)
        rows.append((entry["finding"], entry["place"], "stated", here, verdict))
    rows += _costs(published["cost"], summary)
    return pd.DataFrame(rows, columns=["result", "place", "paper", "here", "verdict"])


def _sweep_of(entry: Mapping[str, Any], sweeps: Sequence[SweepTables]) -> SweepTables | None:
    return next((sweep for sweep in sweeps if sweep.repeats(entry)), None)


def _displacements(published: Mapping[str, Any], displacement: pd.DataFrame) -> Iterator[tuple[str, ...]]:
    simulated = published["rows"][0]
    table = displacement.set_index(["nodes", "from_week"])
    for column, name in (("max_mm", "largest"), ("mean_mm", "mean")):
        for week, paper in zip(published["from_weeks"], simulated[column], strict=True):
            values = [float(table[column].get((nodes, float(week)), "nan")) for nodes in ("all", "pial")]
            here, verdict = MISSING, NOT_RUN
            if np.isfinite(values[0]):
                here = f"all nodes {values[0]:.2f}, surface {values[1]:.2f}"
                errors = [value / paper - 1 for value in values]
                verdict = AGREES if min(map(abs, errors)) <= AGREEMENT_TOL else "{:+.0%}, {:+.0%}".format(*errors)
            yield f"{name} displacement, {week}-{week + 1} GW (mm)", published["place"], f"{paper:.2f}", here, verdict


def _costs(published: Mapping[str, Any], summary: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    weeks = (summary["reached_week"] - summary["weeks"][0]) or np.nan
    energy_wh = summary["cpu_seconds"] / 3600 * CORE_POWER_W / weeks
    values = (summary["seconds"] / 3600 / weeks, energy_wh, energy_wh / 1000 * CARBON_INTENSITY_G_PER_KWH)
    size = f"{summary['tets']} elements, {summary['ranks']} ranks"
    for entry, value in zip(published["rows"], values, strict=True):
        result = f"{entry['quantity']} per gestational week"
        paper = f"{entry['value']:g} ({published['machine']})"
        yield result, published["place"], paper, f"{value:.3g} ({size})", NOT_COMPARABLE


def _modes(published: Mapping[str, Any], sweep: SweepTables | None) -> Iterator[tuple[str, ...]]:
    for side in ("right", "left"):
        here, verdict = MISSING, NOT_RUN
        if sweep:
            is_number = (sweep.comparison["measure"] == WEYL_NUMBER) & (sweep.comparison["hemisphere"] == side)
            numbers = sweep.comparison.loc[is_number, ["value", "real_value"]].to_numpy(dtype=float)
            if numbers.size:
                error = numbers.max() / published[side] - 1
                here = f"{numbers.max():.0f}, the largest of {numbers.min():.0f} to {numbers.max():.0f}"
                verdict = AGREES if abs(error) <= AGREEMENT_TOL else f"{error:+.0%}"
        paper = f"{published[side]}, the largest of all surfaces"
        yield f"modes of the spectra, {side}", published["place"], paper, here, verdict


def _nearest(entry: Mapping[str, Any], nearest: pd.DataFrame) -> tuple[str, str]:
    texts, equal = [], []
    for measure, bands in ((f"{entry['measure']}_weyl", "cut"), (entry["measure"], "whole bands")):
        for row in nearest[nearest["measure"] == measure].to_dict("records"):
            flag = "" if row["flag"] == "ok" else f" ({row['flag']})"
            texts.append(f"{row['hemisphere']}, {bands}: {row[entry['parameter']]:g}{flag}")
            equal.append(row[entry["parameter"]] == entry["value"])
    return "; ".join(texts) or MISSING, _verdict(pd.Series(equal))


def _finding(check: str, sweep: SweepTables) -> tuple[str, str]:
    if check == "all_come":
        holds = sweep.members["outcome"].eq("finished")
        return f"{holds.sum()} of {len(holds)} runs", _verdict(holds)
    shares = _shares(sweep.comparison, "_weyl")
    shares = shares[shares["B4"].notna()]
    if check == "most_B4":
        holds = shares["B4"] > shares[["B5", "B6"]].max(axis=1)
    elif check == "little_B6":
        # a band without modes has no power
        holds = shares["B6"].fillna(0) < MAX_WEAK_SHARE
    elif check == "right_B4":
        sides = shares.pivot_table("B4", "brain", "hemisphere").reindex(columns=["right", "left"])
        holds = (sides["right"] - sides["left"]).dropna() > 0
    else:
        is_real = shares.index.get_level_values("brain").str.startswith(REAL)
        smallest_real = shares.loc[is_real, "B5"].groupby("hemisphere").min()
        holds = smallest_real > shares.loc[~is_real, "B5"].groupby("hemisphere").max()
    text, verdict = f"{holds.sum()} of {len(holds)} cases", _verdict(holds)
    whole = _shares(sweep.comparison, "")["B6"]
    if check == "little_B6" and whole.max() >= MAX_WEAK_SHARE:
        text = f"{text} when cut; in whole bands {whole.min():.2f} to {whole.max():.2f}"
        return text, f"{verdict}, but only with cut bands"
    return text, verdict


def _shares(comparison: pd.DataFrame, suffix: str) -> pd.DataFrame:
    """Return the share of each band in the power, with a row per brain (simulated or observed) and hemisphere."""
    bands = {f"shape_index_relative_power_B{band}{suffix}": f"B{band}" for band in FOLD_BANDS}
    rows = comparison[comparison["measure"].isin(bands)]
    simulated, observed = (
        rows.assign(brain=rows["run"]),
        rows.assign(brain=REAL + rows["real"], value=rows["real_value"]),
    )
    both = pd.concat([simulated, observed]).replace({"measure": bands})
    table = both.pivot_table("value", ["brain", "hemisphere"], "measure", aggfunc="first")
    return table.reindex(columns=list(bands.values()))


def _verdict(holds: pd.Series) -> str:
    if holds.empty:
        return NOT_RUN
    return AGREES if holds.all() else "in part" if holds.any() else "not as in the paper"
