"""What the FetalFoldSim paper reports, beside the same of this study; its numbers are in a file of the workflow."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import getitem
from typing import Any

import numpy as np
import pandas as pd

from .members import MODES

PAPER = "FetalFoldSim paper"


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


def parameters_table(published: Mapping[str, Any], runs: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Returns the parameters that the paper prints, a row each: its values, then those of each run's `params.yaml`."""
    keys = list(dict.fromkeys(key for entry in published["parameters"] for key in entry["values"]))
    columns: dict[str, list[Any]] = {"parameter": keys}
    for entry in published["parameters"]:
        columns[f"paper, {entry['run']}"] = [entry["values"].get(key, "varied") for key in keys]
    for name, params in runs.items():
        values = [reduce(getitem, key.split("."), params) for key in keys]
        columns[name] = ["a curve or map" if isinstance(value, dict) else value for value in values]
    return pd.DataFrame(columns)


def displacement_table(published: Mapping[str, Any], displacement: pd.DataFrame) -> pd.DataFrame:
    """Returns largest and mean norm of the displacement in mm, a row per quantity and source, a column per interval.

    Displacement has the columns run, from_week, to_week, nodes, max_mm, mean_mm. The paper does not say whether its
    numbers are of all nodes or of the surface, so both stand here.
    """
    rows = displacement.replace({"nodes": {"all": "all nodes", "pial": "surface"}})
    groups = rows.groupby(["run", "nodes"], sort=False)
    sources = {f"{run} (simulated, {nodes})": of_run.set_index("from_week") for (run, nodes), of_run in groups}
    for entry in published["displacement"]["rows"]:
        paper = pd.DataFrame(entry, index=published["displacement"]["from_weeks"])
        sources[f"{PAPER}: {entry['source']}"] = paper
    weeks = sorted({*published["displacement"]["from_weeks"], *rows["from_week"]})
    table = []
    for column, name in (("max_mm", "largest displacement (mm)"), ("mean_mm", "mean displacement (mm)")):
        for source, values in sources.items():
            intervals = {f"{week:g}-{week + 1:g} GW": values[column].get(week, float("nan")) for week in weeks}
            table.append({"quantity": name, "source": source, **intervals})
    return pd.DataFrame(table)


def growth_table(published: Mapping[str, Any], rates: pd.DataFrame) -> pd.DataFrame:
    """Returns growth rates from the brains' areas and volumes by interval and series, the paper's two in the last rows.

    Rates have the columns series, from_week, to_week, rate_per_s, core_rate_per_s.
    """
    own = pd.DataFrame(
        {
            "source": rates["series"],
            "interval": [f"{a:g}-{b:g} GW" for a, b in zip(rates["from_week"], rates["to_week"], strict=True)],
            "tangential rate (1e-7 1/s)": 1e7 * rates["rate_per_s"],
            "core rate (1e-7 1/s)": 1e7 * rates["core_rate_per_s"],
        }
    )
    rate = published["growth_rate"]
    paper = pd.DataFrame(
        {
            "source": [f"{PAPER}: least, from surfaces", f"{PAPER}: used"],
            "interval": ["21-29 GW", "all"],
            "tangential rate (1e-7 1/s)": [1e7 * rate["least_per_s"], 1e7 * rate["used_per_s"]],
        }
    )
    return pd.concat([own, paper], ignore_index=True)


def cost_table(published: Mapping[str, Any], summaries: Mapping[str, tuple[float, Mapping[str, Any]]]) -> pd.DataFrame:
    """Returns what each run took, by its name the weeks that it folds over and its summary; and the paper's own."""
    rows: list[dict[str, Any]] = []
    for name, (weeks, summary) in summaries.items():
        wall, processor = summary["seconds"] / 3600, summary["cpu_seconds"] / 3600
        for quantity, value in (
            (f"hours ({summary['ranks']} ranks, {summary['tets']} elements)", wall),
            ("processor hours", processor),
            ("hours per gestational week", wall / weeks),
        ):
            rows.append({"source": name, "quantity": quantity, "value": value})
    rows += [{"source": PAPER, **row} for row in published["cost"]["rows"]]
    return pd.DataFrame(rows)


CLOSE = 0.1
"""Relative difference of displacements up to which they agree."""
WEAK = 0.05
"""Share of the spectrum's power below which a band is very weak."""
NOT_RUN, AGREES = "not run", "as in the paper"
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
    published: Mapping[str, Any], displacement: pd.DataFrame, studies: Sequence[StudyTables]
) -> pd.DataFrame:
    """Returns each result of the paper beside the same here: result, place, paper, here, verdict.

    Displacement has the rows of one run, in the columns of `displacement_table`. Where the paper's study is not among
    `studies`, the verdict is `NOT_RUN`. Bands are cut at Weyl's number, here each surface's own and in the paper the
    largest of all compared, and stand in whole beside it.
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
