"""The picture of `convergence.py`: measures by week and resolution, where folds lie, and what accuracy costs."""

from pathlib import Path

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter

from gyriflow.report.style import FULL_WIDTH_IN, MUTED_COLOUR, RUN_COLOURS, light_grid, new_figure, style

STYLES = {1: ("linear", "--", "o"), 2: ("quadratic", "-", "s")}
SHOWN = {
    "area": "area",
    "gyrification_index": "gyrification index",
    "mean_sulcal_depth": "mean sulcal depth",
    "mean_curvedness": "curvedness",
}


def draw(runs: pd.DataFrame, weeks: pd.DataFrame, pairs: pd.DataFrame, finest: str, file: Path) -> None:
    """Writes the picture from the tables of runs, metrics by week, and differences of pairs of runs."""
    end = weeks["week"].max()
    runs = runs[runs["run"].isin(weeks["run"])]
    at_end = weeks[weeks["week"] == end].set_index("run")
    against = pairs[(pairs["week"] == end) & (pairs["other"] == finest)].merge(runs, on="run")
    against["uncorrelated"] = 1 - against["r_mean_curvature"]
    for metric in SHOWN:
        against[metric] = against[metric].abs() / abs(at_end.loc[finest, metric])
    with style():
        figure = new_figure(FULL_WIDTH_IN, 5.6, synthetic=False)
        by_week, statistics, places, costs = figure.subplots(2, 2).ravel()
        _by_week(by_week, runs, weeks)
        _against(statistics, against, "nodes_to_cortex", SHOWN)
        placed = {"displacement_share": "displacement", "uncorrelated": "1 − r of curvature"}
        _against(places, against, "nodes_to_cortex", placed)
        distances = {"displacement_rms_mm": "displacement", "surface_distance_mm": "surface"}
        _against(costs, against, "cpu_seconds", distances)
        for axes in (statistics, places):
            axes.set_xlabel("node distances to the cortical thickness")
            axes.set_xticks(sorted(against["nodes_to_cortex"].unique()), minor=False)
        statistics.set(ylabel=f"difference at {end:g} GW, of the value")
        places.set(ylabel=f"difference at {end:g} GW, of 1")
        costs.set(xlabel="processor seconds", ylabel=f"difference at {end:g} GW (mm)", xscale="log")
        costs.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        costs.xaxis.set_major_formatter("{x:g}")
        costs.xaxis.set_minor_formatter(NullFormatter())
        figure.savefig(file, dpi=200)


def _against(axes: Axes, against: pd.DataFrame, across: str, values: dict[str, str]) -> None:
    """Draws the differences from the finest run: solid for quadratic elements, crosses for the second mesh."""
    for colour, (value, label) in zip(RUN_COLOURS, values.items(), strict=False):
        for order, (_, line, mark) in STYLES.items():
            own = against[(against["order"] == order) & ~against["turned"]].sort_values(across)
            axes.plot(own[across], own[value], line + mark, color=colour, label=label if order == 2 else None)
        chance = against[against["turned"]]
        axes.plot(chance[across], chance[value], "x", color=MUTED_COLOUR, zorder=5)
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    light_grid(axes, "both")
    axes.legend(fontsize=6, loc="lower left")


def _by_week(axes: Axes, runs: pd.DataFrame, weeks: pd.DataFrame) -> None:
    """Draws the gyrification index of each run by week, finer ones darker."""
    resolutions = sorted(runs["nodes_to_cortex"].unique())
    for _, run in runs[~runs["turned"]].iterrows():
        name, line, _ = STYLES[run["order"]]
        own = weeks[weeks["run"] == run["run"]]
        strength = 0.3 + 0.7 * resolutions.index(run["nodes_to_cortex"]) / max(len(resolutions) - 1, 1)
        colour = RUN_COLOURS[run["order"] - 1]
        label = f"{name}, {run['nodes_to_cortex']:g} to H"
        axes.plot(own["week"], own["gyrification_index"], line, color=colour, alpha=strength, label=label)
    axes.set(xlabel="gestational age (weeks)", ylabel="gyrification index")
    axes.legend(fontsize=6)
    light_grid(axes, "both")
