"""The chart of what simulations are worth, week by week."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .style import (
    FULL_WIDTH_IN,
    MUTED_COLOUR,
    REAL_COLOUR,
    add_letters,
    chosen_colours,
    light_grid,
    new_figure,
    run_legend,
    styled,
    week_axis,
)

_APART_GW = 0.06


@styled
def scores_chart(
    validation: pd.DataFrame, *, runs: Sequence[str] = (), measured: str = "", synthetic: bool = False
) -> Figure:
    """Returns how near runs are to the real brains of their weeks, in four panels.

    Correlation of the shape index with the real brain, beside that of the scaled start and of the real brain of the
    week before; the gain over the scaled start with its 95 % interval; differences of area and of volume in %.

    Parameters
    ----------
    validation : the study's table of validation
    runs
        All runs of the study, which settle the colours.
    """
    colours = chosen_colours(validation["run"], runs)
    figure = new_figure(FULL_WIDTH_IN, 4.6, synthetic=synthetic, measured=measured or "real brain")
    panels = figure.subplots(2, 2)
    fold, gain, area, volume = panels.flat
    look: dict[str, Any] = {"markersize": 3}
    any_run = validation.drop_duplicates(["start_week", "week"]).sort_values("week")
    fold.plot(any_run["week"], any_run["r_start_shape_index"], "s--", color=MUTED_COLOUR, **look)
    before = any_run[any_run["horizon"] > 1]
    fold.plot(before["week"], before["r_adjacent_shape_index"], "^:", color=REAL_COLOUR, **look)
    for index, (run, colour) in enumerate(colours.items()):
        rows = validation[validation["run"] == run].sort_values("week")
        fold.plot(rows["week"], rows["r_shape_index"], "o-", color=colour, **look)
        aside = _APART_GW * (index - (len(colours) - 1) / 2)
        error = np.abs(
            [
                rows["gain_shape_index"] - rows["gain_low_shape_index"],
                rows["gain_high_shape_index"] - rows["gain_shape_index"],
            ]
        )
        gain.errorbar(
            rows["week"] + aside, rows["gain_shape_index"], yerr=error, fmt="o", color=colour, capsize=2, **look
        )
        for axes, column in ((area, "area_difference"), (volume, "volume_difference")):
            axes.plot(rows["week"], 100 * rows[column], "o-", color=colour, **look)
    labels = {
        fold: "shape index, r with the real brain",
        gain: "gain over the scaled start",
        area: "area, difference (%)",
        volume: "volume, difference (%)",
    }
    for axes, label in labels.items():
        axes.set_ylabel(label)
        week_axis(axes, validation["week"])
        light_grid(axes)
        if axes is not fold:
            axes.axhline(0, color="black", linewidth=0.6)
    add_letters(panels.flat)
    extra = [
        Line2D([], [], color=MUTED_COLOUR, marker="s", linestyle="--", markersize=3, label="scaled start"),
        Line2D(
            [], [], color=REAL_COLOUR, marker="^", linestyle=":", markersize=3, label="real brain of the week before"
        ),
    ]
    run_legend(figure, colours, extra=extra)
    return figure
