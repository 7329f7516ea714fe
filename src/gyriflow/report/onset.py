"""Chart of the weeks in which sulci begin, in real and in simulated brains."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from .style import (
    FULL_WIDTH_IN,
    MEASURED,
    MUTED_COLOUR,
    REAL_COLOUR,
    chosen_colours,
    light_grid,
    new_figure,
    run_legend,
    styled,
    week_axis,
)

ROW_IN = 0.22
"""Height of a sulcus's row."""


@styled
def onset_chart(onset: pd.DataFrame, *, runs: Sequence[str] = (), synthetic: bool = False) -> Figure:
    """Returns a row for each sulcus that the real brains do not have at the start, with the weeks in which it begins.

    A cross at the right edge says that it never begins. Sulci are those of a start brain; where there are several,
    their names have its name behind.

    Parameters
    ----------
    onset
        Columns run ("real" for the real brains), subject, region, there_at_start, onset_week.
    runs
        All runs of the study, which settle the colours.
    """
    several = len(onset["subject"].unique()) > 1
    table = onset.assign(row=onset["region"] + (" · " + onset["subject"] if several else ""))
    real = table[table["run"] == MEASURED].drop_duplicates("row")
    late = real[~real["there_at_start"].astype(bool)].sort_values("onset_week", ascending=False)
    places = {name: place for place, name in enumerate(late["row"])}
    figure = new_figure(FULL_WIDTH_IN, 1.2 + ROW_IN * max(len(places), 2), synthetic=synthetic)
    axes = figure.subplots()
    colours = chosen_colours(table["run"], runs)
    drawn = table[table["row"].isin(places) & ~table["there_at_start"].astype(bool)]
    weeks = drawn["onset_week"].dropna()
    beyond = np.ceil(weeks.max() + 0.5) if len(weeks) else 1.0
    for number, (run, colour) in enumerate({MEASURED: REAL_COLOUR, **colours}.items()):
        rows = drawn[drawn["run"] == run].drop_duplicates("row")
        # runs beside each other, the real brains in the middle
        shift = 0 if run == MEASURED else 0.5 * ((number - 0.5) / len(colours) - 0.5)
        heights = rows["row"].map(places) + shift
        begins = rows["onset_week"].notna()
        marker = "*" if run == MEASURED else "o"
        axes.plot(
            rows.loc[begins, "onset_week"], heights[begins], marker, color=colour, markersize=6 if shift == 0 else 4
        )
        axes.plot(np.full((~begins).sum(), beyond), heights[~begins], "x", color=colour, markersize=4)
    axes.set_yticks(list(places.values()), list(places))
    axes.set_ylim(-0.6, max(len(places), 1) - 0.4)
    if len(weeks):
        week_axis(axes, [weeks.min(), beyond])
    else:
        axes.text(
            0.5, 0.5, "no sulcus begins after the start", ha="center", transform=axes.transAxes, color=MUTED_COLOUR
        )
        axes.set_xticks([])
    light_grid(axes, "both")
    run_legend(figure, colours, measured="real brains")
    return figure
