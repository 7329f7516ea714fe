"""The style of all figures: sizes for print, fonts, colour-blind-safe colours,
headings."""

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..quantities import DISTINCT_COLOURS
from ..settings.terms import OBSERVED, run_names

if TYPE_CHECKING:
    import pandas as pd

SINGLE_COLUMN_IN = 3.5
"""Width of one column of a journal page, in inches."""
FULL_WIDTH_IN = 7.2
"""Width of a journal page, in inches."""

RUN_COLOURS = DISTINCT_COLOURS[:-1]
"""Without yellow, which is too pale on white; black is for observed brains."""
TINTS = (0.0, 0.4, 0.7)
"""Shares of white in the colours of further regions."""
OBSERVED_COLOUR = "#000000"
MUTED_COLOUR = "#767676"
RIGHT_COLOUR = "#E0B400"
"""The right hemisphere and its contact: the paper's yellow, dark enough for lines on
white."""
SIMULATED_SURFACE_COLOUR = "#8FB4DC"
OBSERVED_SURFACE_COLOUR = "#EBD6B4"

NEUTRAL_COLOUR = "#D9D9D9"
"""Tissue without a value."""

MATPLOTLIB_SETTINGS: dict[Any, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.formatter.use_mathtext": True,
    "figure.titlesize": 9.0,
    "figure.dpi": 200.0,
    # text stays text in PDF files
    "pdf.fonttype": 42,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.0,
    # pale grid
    "axes.grid": True,
    "axes.grid.axis": "y",
    "grid.color": "#E2E2E2",
    "grid.linewidth": 0.5,
}


styled = mpl.rc_context(MATPLOTLIB_SETTINGS)
"""Decorator: draw a figure in the project's style, without changing global settings."""


def panel_figure(
    count: int,
    *,
    per_row: int = 3,
    panel_in: float = 1.9,
    foot_in: float = 0.7,
    **grid: Any,
) -> tuple[Figure, list[Axes]]:
    """Return a figure and its panels, row by row, with letters.

    A full row of `per_row` panels is as wide as a page; `panel_in` and `foot_in` are
    the heights of a row and of the legend in inches. `grid` are further arguments of
    `Figure.subplots`.
    """
    columns = min(per_row, count)
    lines = -(-count // columns)
    width_in = FULL_WIDTH_IN * min(1.0, max(columns, 2) / per_row)
    figure = Figure(
        figsize=(width_in, foot_in + panel_in * lines), layout="constrained"
    )
    panels = list(
        figure.subplots(
            lines,
            columns,
            squeeze=False,
            **grid,
        ).flat
    )
    for spare in panels[count:]:
        spare.remove()
    add_letters(panels[:count])
    return figure, panels[:count]


def add_letters(panels: Iterable[Axes]) -> None:
    """Write a, b, c … at the upper left of panels, for the caption; nothing for a
    single panel."""
    panels = list(panels)
    if len(panels) > 1:
        for axes, letter in zip(panels, ascii_lowercase, strict=False):
            # left of the title, which may be as wide as the panel
            axes.annotate(
                letter,
                (0.0, 1.0),
                xytext=(-12, 4),
                xycoords="axes fraction",
                textcoords="offset points",
                ha="right",
                va="bottom",
                fontweight="bold",
                fontsize=9,
            )


def wrap(text: str, letters: int) -> str:
    """Return text with lines broken between words to at most about so many letters."""
    return "\n".join(
        textwrap.fill(line, letters, break_long_words=False)
        for line in text.split("\n")
    )


def runs_by_name(table: "pd.DataFrame") -> "pd.DataFrame":
    """Return a table with columns run and subject, with simulations named by
    `run_names`."""
    pairs = list(
        zip(
            table["run"],
            table["subject"],
            strict=True,
        )
    )
    simulated = [pair for pair in dict.fromkeys(pairs) if pair[0] != OBSERVED]
    names = dict(zip(simulated, run_names(simulated), strict=True))
    return table.assign(
        run=[
            names.get(
                pair,
                pair[0],
            )
            for pair in pairs
        ]
    )


def run_colours(
    present: Iterable[str],
    runs: Sequence[str] = (),
) -> dict[str, Any]:
    """Return a colour for each simulated run that is present: distinct ones, or a
    sequential scale for many runs.

    Figures of a study pass all of its `runs` in the same order, so that a run has the
    same colour in all figures.
    """
    present = list(present)
    names = [name for name in dict.fromkeys([*runs, *present]) if name != OBSERVED]
    colours: Sequence[Any] = RUN_COLOURS
    if len(names) > len(RUN_COLOURS):
        shades = mpl.colormaps["viridis"](
            np.linspace(
                0,
                0.92,
                len(names),
            )
        )
        colours = [tuple(shade) for shade in shades]
    by_name = zip(names, colours, strict=False)
    return {name: colour for name, colour in by_name if name in present}


def region_colours(names: Iterable[str]) -> dict[str, Any]:
    """Return a colour for each region in the given order: those of runs, then their
    tints.

    On a scale from dark to pale, neighbours would look similar, and dark regions like
    shade. Colours repeat from the 22nd region on.
    """
    pure = np.array([to_rgb(colour) for colour in RUN_COLOURS])
    shades: list[Any] = []
    for tint in TINTS:
        tinted = pure + tint * (1 - pure)
        shades += map(tuple, tinted.tolist())
    regions = dict.fromkeys(names)
    return dict(zip(regions, cycle(shades), strict=False))


def week_axis(axes: Axes, weeks: Iterable[float]) -> None:
    """Label the horizontal axis as gestational weeks with whole weeks as ticks."""
    values = list(weeks)
    axes.set_xlabel("gestational age (GW)")
    whole = mpl.ticker.MaxNLocator(
        8,
        integer=True,
        steps=[1, 2, 5, 10],
        min_n_ticks=1,
    )
    axes.xaxis.set_major_locator(whole)
    # a single week is in the middle of the axis
    margin = max(
        0.04 * np.ptp(values),
        (1.08 - np.ptp(values)) / 2,
    )
    axes.set_xlim(min(values) - margin, max(values) + margin)


def from_zero(axes: Axes) -> None:
    """Start the vertical axis at zero and end it slightly above the data of all panels
    that share it."""
    highest = 0.0
    for panel in axes.get_shared_y_axes().get_siblings(axes):
        top = panel.dataLim.ymax
        # panels without data have an infinite top
        if math.isfinite(top):
            highest = max(highest, top)
    axes.set_ylim(0, 1.07 * highest if highest > 0 else 1.0)


def entry(label: str, colour: Any = MUTED_COLOUR, **style: Any) -> Line2D:
    """Return a legend entry."""
    return Line2D(
        [],
        [],
        label=label,
        **{"color": colour} | style,
    )


def star(label: str, colour: Any = OBSERVED_COLOUR, **style: Any) -> Line2D:
    """Return the legend entry of observed brains."""
    usual = {"marker": "*", "markersize": 7, "linestyle": "none"}
    return entry(label, colour, **usual | style)


def run_entries(colours: Mapping[str, Any]) -> list[Artist]:
    """Return the legend entries of runs."""
    return [
        entry(
            run,
            colour,
            marker="o",
        )
        for run, colour in colours.items()
    ]


def legend_below(figure: Figure, handles: Sequence[Artist]) -> None:
    """Draw a legend below the panels.

    It has as many columns as its longest label allows, and the figure grows by its
    rows.
    """
    # a letter of the legend is about 0.065 in wide, the line before it and the gap
    # behind 0.5 in
    longest = 0.5 + 0.065 * max(len(str(handle.get_label())) for handle in handles)
    columns = max(
        1,
        min(
            len(handles),
            int(figure.get_figwidth() / longest),
        ),
    )
    lines = -(-len(handles) // columns)
    figure.set_figheight(figure.get_figheight() + 0.15 * (lines - 1))
    figure.legend(handles=handles, loc="outside lower center", ncols=columns)
