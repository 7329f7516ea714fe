"""The picture of `convergence.py`: measures by week and resolution, where folds lie, and what accuracy costs."""

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from gyriflow.report.style import FULL_WIDTH_IN, MUTED_COLOUR, RUN_COLOURS, light_grid, new_figure, style

STYLES = {1: ("linear", "--", "o"), 2: ("quadratic", "-", "s")}
SHOWN = {
    "area": "area",
    "gyrification_index": "gyrification index",
    "sulcal_depth_95": "sulcal depth",
    "mean_curvedness": "curvedness",
}


def draw(runs: pd.DataFrame, weeks: pd.DataFrame, pairs: pd.DataFrame, finest: str, file: Path) -> None:
    """Writes the picture from the tables of runs, metrics by week, and differences of pairs of runs."""
    end = weeks["week"].max()
    runs = runs[runs["run"].isin(weeks["run"])]
    at_end = weeks[weeks["week"] == end].set_index("run")
    against = pairs[(pairs["week"] == end) & (pairs["other"] == finest)].merge(runs, on="run")
    with style():
        figure = new_figure(FULL_WIDTH_IN, 5.4, title="", synthetic=False)
        by_week, statistics, places, costs = figure.subplots(2, 2).ravel()
        _by_week(by_week, runs, weeks)
        for order, (name, line, mark) in STYLES.items():
            own = against[(against["order"] == order) & ~against["turned"]].sort_values("nodes_to_cortex")
            for colour, metric in zip(RUN_COLOURS, SHOWN, strict=False):
                error = np.abs(own[metric]) / abs(at_end.loc[finest, metric])
                statistics.plot(
                    own["nodes_to_cortex"], error, line + mark, color=colour, label=f"{SHOWN[metric]}, {name}"
                )
            for colour, value in zip(RUN_COLOURS, ("displacement_share", "r_mean_curvature"), strict=False):
                label = {"displacement_share": "displacement", "r_mean_curvature": "1 − r of mean curvature"}[value]
                shown = own[value] if value == "displacement_share" else 1 - own[value]
                places.plot(own["nodes_to_cortex"], shown, line + mark, color=colour, label=f"{label}, {name}")
            costs.plot(own["cpu_seconds"], own["displacement_rms_mm"], line + mark, color=RUN_COLOURS[0], label=name)
            costs.plot(own["cpu_seconds"], own["surface_distance_mm"], line + mark, color=RUN_COLOURS[1])
        chance = against[against["turned"]]
        for axes, value in ((places, chance["displacement_share"]), (places, 1 - chance["r_mean_curvature"])):
            axes.plot(chance["nodes_to_cortex"], value, "x", color=MUTED_COLOUR)
        costs.plot(chance["cpu_seconds"], chance["displacement_rms_mm"], "x", color=MUTED_COLOUR, label="second mesh")
        statistics.set(xlabel="node distances to H", ylabel=f"difference at {end:g} GW, of the value", yscale="log")
        places.set(xlabel="node distances to H", ylabel=f"difference at {end:g} GW", yscale="log")
        costs.set(xlabel="processor seconds", ylabel="difference (mm)", xscale="log", yscale="log")
        costs.set_title("places (blue) and distance of surfaces (orange), from the finest run")
        for axes in (statistics, places, costs):
            light_grid(axes, "both")
            axes.legend(fontsize=6)
        figure.savefig(file, dpi=200)


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
