"""The chart of what a study took: time and energy by stage."""

import pandas as pd
from matplotlib.figure import Figure

from .resources import KWH_PER_WH, SECONDS_PER_MINUTE
from .style import FULL_WIDTH_IN, RUN_COLOURS, add_letters, light_grid, new_figure, styled

MOST_STAGES = 14
"""Stages with bars of their own; the others are one bar."""


@styled
def cost_chart(stages: pd.DataFrame) -> Figure:
    """Returns wall time, CPU time and energy of the stages as bars, the longest first.

    Parameters
    ----------
    stages : what `stage_resources` returns
    """
    named = stages.assign(run=stages["run"].fillna(""))
    names = named["stage"].str.replace("_", " ") + named["run"].map(lambda run: f" · {run}" if run else "")
    values = named.assign(name=names)[["name", "wall_s", "cpu_s", "energy_kWh"]]
    values = values.sort_values("cpu_s", ascending=False, kind="stable")
    rest = values.iloc[MOST_STAGES:]
    shown = values.iloc[:MOST_STAGES]
    if len(rest):
        last = {"name": f"{len(rest)} other stages", **rest[["wall_s", "cpu_s", "energy_kWh"]].sum()}
        shown = pd.concat([shown, pd.DataFrame([last])], ignore_index=True)
    figure = new_figure(FULL_WIDTH_IN, 0.8 + 0.2 * len(shown), synthetic=False)
    times, energy = figure.subplots(1, 2, sharey=True, width_ratios=[1.4, 1.0])
    places = range(len(shown))
    for offset, column, colour, label in (
        (-0.2, "wall_s", RUN_COLOURS[5], "wall time"),
        (0.2, "cpu_s", RUN_COLOURS[0], "CPU time"),
    ):
        at = [place + offset for place in places]
        times.barh(at, shown[column] / SECONDS_PER_MINUTE, height=0.4, color=colour, label=label)
    energy.barh(list(places), shown["energy_kWh"] / KWH_PER_WH, height=0.6, color=RUN_COLOURS[2])
    times.set_yticks(list(places), list(shown["name"]))
    times.invert_yaxis()
    times.set_xlabel("time, summed over jobs (min)")
    energy.set_xlabel("energy, estimated (Wh)")
    figure.legend(handles=times.get_legend_handles_labels()[0], loc="outside lower left", ncols=2)
    for axes in (times, energy):
        light_grid(axes, "x")
    add_letters([times, energy])
    return figure
