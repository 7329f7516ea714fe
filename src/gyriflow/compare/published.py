"""What the FetalFoldSim paper reports, beside the same of this study; its numbers are in a file of the workflow."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from .members import MODES


def comparison_caption(study: str, week: float, comparison: pd.DataFrame) -> str:
    """Returns what a reader has to know of a comparison: week, real brains, and whether they are another population.

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
    """Returns the table of the nearest runs with what the paper finds nearest by the same measure (NaN: not reported).

    The paper's brains are others (a normal atlas), and its spectra are cut at Weyl's number.
    """
    found = {
        entry["measure"]: entry["value"]
        for entry in published["nearest"]
        if [entry["parameter"]] == list(varied) and entry["week"] == week
    }
    values = [found.get(measure.removesuffix("_weyl"), float("nan")) for measure in nearest["measure"]]
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
    power: Mapping[str, float],
) -> pd.DataFrame:
    """Return each result of the paper beside the same here: result, place, paper, here, verdict.

    Displacement has the rows of one run, in the columns from_week, to_week, nodes, max_mm, mean_mm; `summary` is that
    run's, and `power` has core_power_w and carbon_intensity_g_per_kwh. Where the paper's study is not among `studies`,
    the verdict is `NOT_RUN`. Bands are cut at Weyl's number, here each surface's own and in the paper the largest of
    all compared, and stand in whole beside it.
    """
    rows = [*_displacements(published["displacement"], displacement), *_modes(published["weyl_number"], studies)]
    for entry in [*published["nearest"], *published["findings"]]:
        of_it = _studies_of(entry, studies)
        if "finding" in entry:
            result, paper = entry["finding"], "stated"
            here, verdict = _finding(entry["check"], of_it[0]) if of_it else ("–", NOT_RUN)
        else:
            result = f"nearest {entry['parameter']} by {entry['measure']}, {entry['week']} GW"
            paper = f"{entry['value']:g}"
            here, verdict = _nearest(entry, of_it[0].nearest) if of_it else ("–", NOT_RUN)
        rows.append((result, entry["place"], paper, here, verdict))
    rows += _costs(published["cost"], summary, **power)
    return pd.DataFrame(rows, columns=["result", "place", "paper", "here", "verdict"])


def _displacements(published: Mapping[str, Any], displacement: pd.DataFrame) -> Iterator[tuple[str, ...]]:
    own = published["rows"][0]
    table = displacement.set_index(["nodes", "from_week"])
    for column, name in (("max_mm", "largest"), ("mean_mm", "mean")):
        for week, paper in zip(published["from_weeks"], own[column], strict=True):
            found = [float(table[column].get((nodes, float(week)), "nan")) for nodes in ("all", "pial")]
            text, verdict = "–", NOT_RUN
            if np.isfinite(found[0]):
                text = f"all nodes {found[0]:.2f}, surface {found[1]:.2f}"
                away = [value / paper - 1 for value in found]
                verdict = AGREES if min(map(abs, away)) <= CLOSE else "{:+.0%}, {:+.0%}".format(*away)
            yield f"{name} displacement, {week}-{week + 1} GW (mm)", published["place"], f"{paper:.2f}", text, verdict


def _costs(
    published: Mapping[str, Any],
    summary: Mapping[str, Any],
    core_power_w: float,
    carbon_intensity_g_per_kwh: float,
) -> Iterator[tuple[str, ...]]:
    """Yield time, energy and emissions of a gestational week."""
    weeks = (summary["reached_week"] - summary["weeks"][0]) or np.nan
    energy_wh = summary["cpu_seconds"] / 3600 * core_power_w / weeks
    here = (summary["seconds"] / 3600 / weeks, energy_wh, energy_wh / 1000 * carbon_intensity_g_per_kwh)
    of_run = f"{summary['tets']} elements, {summary['ranks']} ranks"
    for entry, value in zip(published["rows"], here, strict=True):
        paper = f"{entry['value']:g} ({published['machine']})"
        yield f"{entry['quantity']} a gestational week", published["place"], paper, f"{value:.3g} ({of_run})", NOT_ALIKE


def _modes(published: Mapping[str, Any], studies: Sequence[StudyTables]) -> Iterator[tuple[str, ...]]:
    """Yields for each hemisphere how many modes the paper takes, and Weyl's numbers of the surfaces compared here."""
    tables = [one.comparison for one in _studies_of(published, studies)]
    for side in ("right", "left"):
        numbers = np.array([])
        for table in tables:
            rows = table[(table["measure"] == MODES) & (table["hemisphere"] == side)]
            numbers = rows[["value", "real_value"]].to_numpy(dtype=float)
        text, verdict = "–", NOT_RUN
        if numbers.size:
            away = numbers.max() / published[side] - 1
            text = f"each its own, {numbers.min():.0f} to {numbers.max():.0f}"
            verdict = AGREES if abs(away) <= CLOSE else f"{away:+.0%}"
        paper = f"{published[side]}, the largest of all"
        yield f"modes of the spectra, {side}", published["place"], paper, text, verdict


def _studies_of(entry: Mapping[str, Any], studies: Sequence[StudyTables]) -> list[StudyTables]:
    """Returns the studies that vary what an entry of the paper is of, at its week."""
    return [one for one in studies if list(one.varied) == [entry["parameter"]] and one.week == entry["week"]]


def _nearest(entry: Mapping[str, Any], nearest: pd.DataFrame) -> tuple[str, str]:
    texts, same = [], []
    for measure, how in ((f"{entry['measure']}_weyl", "cut"), (entry["measure"], "whole bands")):
        for row in nearest[nearest["measure"] == measure].to_dict("records"):
            flag = "" if row["flag"] == "ok" else f" ({row['flag']})"
            texts.append(f"{row['hemisphere']}, {how}: {row[entry['parameter']]:g}{flag}")
            same.append(row[entry["parameter"]] == entry["value"])
    return "; ".join(texts) or "–", _verdict(sum(same), len(same))


def _finding(check: str, study: StudyTables) -> tuple[str, str]:
    """Returns what is found of a check in words, and the verdict."""
    if check == "all_come":
        fine = study.members["outcome"].eq("finished")
        return f"{fine.sum()} of {len(fine)} runs", _verdict(fine.sum(), len(fine))
    cut, whole = (_shares(study.comparison, end) for end in ("_weyl", ""))
    cut = cut[cut["B4"].notna()]
    if check == "most_B4":
        fine = cut["B4"] > cut[["B5", "B6"]].max(axis=1)
    elif check == "little_B6":
        # without a mode there is nothing
        fine = cut["B6"].fillna(0) < WEAK
    elif check == "right_B4":
        sides = cut.pivot_table("B4", "brain", "hemisphere").reindex(columns=["right", "left"])
        fine = (sides["right"] - sides["left"]).dropna() > 0
    else:
        real = cut.index.get_level_values("brain").str.startswith(REAL)
        least = cut.loc[real, "B5"].groupby("hemisphere").min()
        fine = least > cut.loc[~real, "B5"].groupby("hemisphere").max()
    text, verdict = f"{fine.sum()} of {len(fine)} cases", _verdict(fine.sum(), len(fine))
    if check == "little_B6" and whole["B6"].max() >= WEAK:
        return (
            f"{text} when cut; in whole bands {whole['B6'].min():.2f} to {whole['B6'].max():.2f}",
            f"{verdict}, by the cut alone",
        )
    return text, verdict


def _shares(comparison: pd.DataFrame, end: str) -> pd.DataFrame:
    """Returns the relative powers B4 to B6 of the simulated and the real hemispheres, by brain and hemisphere."""
    bands = {f"relative_power_B{band}{end}": f"B{band}" for band in (4, 5, 6)}
    rows = comparison[comparison["measure"].isin(bands)]
    simulated, real = rows.assign(brain=rows["run"]), rows.assign(brain=REAL + rows["real"], value=rows["real_value"])
    both = pd.concat([simulated, real]).replace({"measure": bands})
    table = both.pivot_table("value", ["brain", "hemisphere"], "measure", aggfunc="first")
    return table.reindex(columns=list(bands.values()))


def _verdict(fine: int, of: int) -> str:
    return NOT_RUN if of == 0 else AGREES if fine == of else "in part" if fine else "otherwise"
