"""What the FetalFoldSim paper reports, beside the same of this study; its numbers are in a file of the workflow."""

from collections.abc import Mapping, Sequence
from functools import reduce
from operator import getitem
from typing import Any

import pandas as pd

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
