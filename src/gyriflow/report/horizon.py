"""Chart of what simulations are worth by how long after their start."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from .style import FULL_WIDTH_IN, MUTED_COLOUR, add_letters, chosen_colours, light_grid, new_figure, run_legend, styled
from .validation import CEILING, MEASURES

KINDS = ("explained", "predicted")
"""Rows of panels, never drawn together: weeks whose growth was known, and those whose growth was not."""


@styled
def horizon_chart(
    horizons: pd.DataFrame,
    ceiling: pd.DataFrame | None = None,
    *,
    runs: Sequence[str] = (),
    synthetic: bool = False,
) -> Figure:
    """Returns gain over no folding by weeks after the start, explained weeks above and predicted ones below.

    Lines are of one start, whose week stands at their end; bars are 95 % intervals.

    Parameters
    ----------
    horizons
        Rows of the study's horizon.csv.
    ceiling
        Columns start_week, horizon and gain_… of the start carried by registration, drawn as dotted lines.
    runs
        All runs of the study, which settle the colours.
    """
    kinds = [kind for kind in KINDS if (horizons["kind"] == kind).any()]
    figure = new_figure(FULL_WIDTH_IN, 0.4 + 2.6 * len(kinds), synthetic=synthetic)
    colours = chosen_colours(horizons["model"], runs)
    panels = figure.subplots(len(kinds), len(MEASURES), squeeze=False, sharex=True)
    add_letters(panels.ravel())
    for row, kind in zip(panels, kinds, strict=True):
        of_kind = horizons[horizons["kind"] == kind]
        for axes, (measure, name) in zip(row, MEASURES.items(), strict=True):
            for (model, _, start), rows in of_kind.groupby(["model", "known_gw", "start_week"], dropna=False):
                line = rows.sort_values("horizon")
                gain, colour = line[f"gain_{measure}"], colours[str(model)]
                away = np.stack([gain - line[f"gain_low_{measure}"], line[f"gain_high_{measure}"] - gain])
                axes.errorbar(
                    line["horizon"],
                    gain,
                    yerr=away.clip(min=0),
                    fmt="o-",
                    color=colour,
                    markerfacecolor=colour if kind == "explained" else "white",
                    elinewidth=0.7,
                )
                axes.annotate(
                    f"{start:g}",
                    (line["horizon"].iloc[-1], gain.iloc[-1]),
                    xytext=(4, 0),
                    textcoords="offset points",
                    va="center",
                    fontsize=6,
                )
            # growth that is known is all that the ceiling knows
            if ceiling is not None and kind == "explained":
                for _, rows in ceiling.groupby("start_week"):
                    line = rows.sort_values("horizon")
                    axes.plot(line["horizon"], line[f"gain_{measure}"], ":", color=MUTED_COLOUR)
            axes.axhline(0, color=MUTED_COLOUR, linewidth=0.8)
            axes.set_title(f"{name}, {kind}")
            axes.margins(x=0.1)
            axes.xaxis.set_major_locator(MaxNLocator(nbins=8, integer=True))
            light_grid(axes)
    for axes in panels[:, 0]:
        axes.set_ylabel("r less that of the scaled start")
    for axes in panels[-1]:
        axes.set_xlabel("weeks after the start (its week stands at the line's end)")
    extra = [Line2D([], [], color=MUTED_COLOUR, linestyle=":", label=CEILING)] if ceiling is not None else []
    run_legend(figure, colours, extra=extra)
    return figure
