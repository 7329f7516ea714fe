"""What the FetalFoldSim paper reports, beside the same of this study; its numbers are in a file of the workflow."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..settings.terms import CARBON_INTENSITY_G_PER_KWH, CORE_POWER_W, FOLD_BANDS
from .members import MODES


def comparison_caption(study: str, week: float, comparison: pd.DataFrame) -> str:
    """Say what a reader has to know of a comparison: week, real brains, and whether they are another population.

    The comparison has the columns real, real_population, same_population.
    """
    reals = comparison.drop_duplicates("real")
    if reals.empty:
        return f"No run of the study {study} has come to {week:g} GW."
    names = ", ".join(f"{row.real} ({row.real_population})" for row in reals.itertuples())
    text = f"Study {study} at {week:g} GW against {names}."
    others = sorted(set(reals.loc[~reals["same_population"].astype(bool), "real_population"]))
    if others:
        text += f" Mind that {' and '.join(others)} is another population than that of the start brain."
    return text


def with_published_nearest(
    nearest: pd.DataFrame, published: Mapping[str, Any], varied: Sequence[str], week: float
) -> pd.DataFrame:
    """Add to the nearest runs what the paper finds nearest by the same measure, in column paper (NaN: not reported).

    The paper's brains are others (a normal atlas), and its spectra are cut at Weyl's number.
    """
    reported = {
        entry["measure"]: entry["value"]
        for entry in published["nearest"]
        if [entry["parameter"]] == list(varied) and entry["week"] == week
    }
    values = [reported.get(measure.removesuffix("_weyl"), float("nan")) for measure in nearest["measure"]]
    place = nearest.columns.get_loc("run")
    return pd.concat([nearest.iloc[:, :place], pd.DataFrame({"paper": values}), nearest.iloc[:, place:]], axis=1)


CLOSE = 0.1
"""Relative difference of displacements up to which they agree."""
WEAK = 0.05
"""Share of the spectrum's power below which a band is very weak."""
NOT_RUN, AGREES, NOT_ALIKE = "not run", "as in the paper", "another machine and mesh"
REAL = "real "


@dataclass(frozen=True, eq=False)
class StudyTables:
    """The varied keys of a study, its week, and the tables of the same names in its folder."""

    varied: Sequence[str]
    week: float
    members: pd.DataFrame
    comparison: pd.DataFrame
    nearest: pd.DataFrame


def replication(
    published: Mapping[str, Any],
    displacement: pd.DataFrame,
    studies: Sequence[StudyTables],
    summary: Mapping[str, Any],
) -> pd.DataFrame:
    """Return each result of the paper beside the same here: result, place, paper, here, verdict.

    Displacement has the rows of one run, in the columns from_week, to_week, nodes, max_mm, mean_mm; `summary` is that
    run's. Where the paper's study is not among `studies`,
    the verdict is `NOT_RUN`. Bands are cut at Weyl's number, here each surface's own and in the paper the largest of
    all compared, and stand in whole beside it.
    """
    modes = published["weyl_number"]
    rows = [*_displacements(published["displacement"], displacement), *_modes(modes, _study_of(modes, studies))]
    for entry in published["nearest"]:
        study = _study_of(entry, studies)
        here, verdict = _nearest(entry, study.nearest) if study else ("–", NOT_RUN)
        result = f"nearest {entry['parameter']} by {entry['measure']}, {entry['week']} GW"
        rows.append((result, entry["place"], f"{entry['value']:g}", here, verdict))
    for entry in published["findings"]:
        study = _study_of(entry, studies)
        here, verdict = _finding(entry["check"], study) if study else ("–", NOT_RUN)
        rows.append((entry["finding"], entry["place"], "stated", here, verdict))
    rows += _costs(published["cost"], summary)
    return pd.DataFrame(rows, columns=["result", "place", "paper", "here", "verdict"])


def _study_of(entry: Mapping[str, Any], studies: Sequence[StudyTables]) -> StudyTables | None:
    for study in studies:
        if list(study.varied) == [entry["parameter"]] and study.week == entry["week"]:
            return study
    return None


def _displacements(published: Mapping[str, Any], displacement: pd.DataFrame) -> Iterator[tuple[str, ...]]:
    simulated = published["rows"][0]
    table = displacement.set_index(["nodes", "from_week"])
    for column, name in (("max_mm", "largest"), ("mean_mm", "mean")):
        for week, paper in zip(published["from_weeks"], simulated[column], strict=True):
            values = [float(table[column].get((nodes, float(week)), "nan")) for nodes in ("all", "pial")]
            here, verdict = "–", NOT_RUN
            if np.isfinite(values[0]):
                here = f"all nodes {values[0]:.2f}, surface {values[1]:.2f}"
                away = [value / paper - 1 for value in values]
                verdict = AGREES if min(map(abs, away)) <= CLOSE else "{:+.0%}, {:+.0%}".format(*away)
            yield f"{name} displacement, {week}-{week + 1} GW (mm)", published["place"], f"{paper:.2f}", here, verdict


def _costs(published: Mapping[str, Any], summary: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    weeks = (summary["reached_week"] - summary["weeks"][0]) or np.nan
    energy_wh = summary["cpu_seconds"] / 3600 * CORE_POWER_W / weeks
    here = (summary["seconds"] / 3600 / weeks, energy_wh, energy_wh / 1000 * CARBON_INTENSITY_G_PER_KWH)
    of_run = f"{summary['tets']} elements, {summary['ranks']} ranks"
    for entry, value in zip(published["rows"], here, strict=True):
        paper = f"{entry['value']:g} ({published['machine']})"
        yield f"{entry['quantity']} a gestational week", published["place"], paper, f"{value:.3g} ({of_run})", NOT_ALIKE


def _modes(published: Mapping[str, Any], study: StudyTables | None) -> Iterator[tuple[str, ...]]:
    for side in ("right", "left"):
        here, verdict = "–", NOT_RUN
        if study:
            of_side = (study.comparison["measure"] == MODES) & (study.comparison["hemisphere"] == side)
            numbers = study.comparison.loc[of_side, ["value", "real_value"]].to_numpy(dtype=float)
            if numbers.size:
                away = numbers.max() / published[side] - 1
                here = f"each its own, {numbers.min():.0f} to {numbers.max():.0f}"
                verdict = AGREES if abs(away) <= CLOSE else f"{away:+.0%}"
        paper = f"{published[side]}, the largest of all"
        yield f"modes of the spectra, {side}", published["place"], paper, here, verdict


def _nearest(entry: Mapping[str, Any], nearest: pd.DataFrame) -> tuple[str, str]:
    texts, same = [], []
    for measure, how in ((f"{entry['measure']}_weyl", "cut"), (entry["measure"], "whole bands")):
        for row in nearest[nearest["measure"] == measure].to_dict("records"):
            flag = "" if row["flag"] == "ok" else f" ({row['flag']})"
            texts.append(f"{row['hemisphere']}, {how}: {row[entry['parameter']]:g}{flag}")
            same.append(row[entry["parameter"]] == entry["value"])
    return "; ".join(texts) or "–", _verdict(pd.Series(same))


def _finding(check: str, study: StudyTables) -> tuple[str, str]:
    if check == "all_come":
        holds = study.members["outcome"].eq("finished")
        return f"{holds.sum()} of {len(holds)} runs", _verdict(holds)
    shares = _shares(study.comparison, "_weyl")
    shares = shares[shares["B4"].notna()]
    if check == "most_B4":
        holds = shares["B4"] > shares[["B5", "B6"]].max(axis=1)
    elif check == "little_B6":
        # without a mode there is nothing
        holds = shares["B6"].fillna(0) < WEAK
    elif check == "right_B4":
        sides = shares.pivot_table("B4", "brain", "hemisphere").reindex(columns=["right", "left"])
        holds = (sides["right"] - sides["left"]).dropna() > 0
    else:
        real = shares.index.get_level_values("brain").str.startswith(REAL)
        least = shares.loc[real, "B5"].groupby("hemisphere").min()
        holds = least > shares.loc[~real, "B5"].groupby("hemisphere").max()
    text, verdict = f"{holds.sum()} of {len(holds)} cases", _verdict(holds)
    whole = _shares(study.comparison, "")["B6"]
    if check == "little_B6" and whole.max() >= WEAK:
        text = f"{text} when cut; in whole bands {whole.min():.2f} to {whole.max():.2f}"
        return text, f"{verdict}, by the cut alone"
    return text, verdict


def _shares(comparison: pd.DataFrame, end: str) -> pd.DataFrame:
    bands = {f"relative_power_B{band}{end}": f"B{band}" for band in FOLD_BANDS}
    rows = comparison[comparison["measure"].isin(bands)]
    simulated, real = rows.assign(brain=rows["run"]), rows.assign(brain=REAL + rows["real"], value=rows["real_value"])
    both = pd.concat([simulated, real]).replace({"measure": bands})
    table = both.pivot_table("value", ["brain", "hemisphere"], "measure", aggfunc="first")
    return table.reindex(columns=list(bands.values()))


def _verdict(holds: pd.Series) -> str:
    if holds.empty:
        return NOT_RUN
    return AGREES if holds.all() else "in part" if holds.any() else "otherwise"
