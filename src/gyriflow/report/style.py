"""The style of all figures: sizes for print, fonts, colour-blind-safe colours,
headings."""

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from string import ascii_lowercase
from typing import Any

import matplotlib as mpl
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..quantities import DISTINCT_COLOURS
from ..settings.terms import OBSERVED, run_names

SINGLE_COLUMN_IN = 3.5
"""Width of one column of a journal page, in inches."""
FULL_WIDTH_IN = 7.2
"""Width of a journal page, in inches."""

RUN_COLOURS = DISTINCT_COLOURS[:-1]
"""Without yellow, which is too pale on white; black is for observed brains."""
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
            place: dict[str, Any] = {
                "xytext": (-12, 4),
                "xycoords": "axes fraction",
                "textcoords": "offset points",
            }
            axes.annotate(
                letter,
                (0.0, 1.0),
                ha="right",
                va="bottom",
                fontweight="bold",
                fontsize=9,
                **place,
            )


def wrap(text: str, letters: int) -> str:
    """Return text with lines broken between words to at most about so many letters."""
    return "\n".join(
        textwrap.fill(line, letters, break_long_words=False)
        for line in text.split("\n")
    )


def runs_by_name(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table with columns run and subject, with simulations named by
    `run_names`."""
    pairs = list(
        zip(
            table["run"],
            table["subject"],
            strict=True,
        )
    )
    simulated = []
    for run, subject in dict.fromkeys(pairs):
        if run != OBSERVED:
            simulated.append((run, subject))
    names = dict(zip(simulated, run_names(simulated), strict=True))
    named = []
    for run, subject in pairs:
        named.append(names.get((run, subject), run))
    return table.assign(run=named)


def run_colours(present: Iterable[str], runs: Sequence[str] = ()) -> dict[str, Any]:
    """Return a colour for each simulated run that is present: distinct ones, or a
    sequential scale for many runs.

    Figures of a study pass all of its `runs` in the same order, so that a run has the
    same colour in all figures.
    """
    present = list(present)
    names = list(dict.fromkeys([*runs, *present]))
    if OBSERVED in names:
        names.remove(OBSERVED)
    colours: dict[str, Any] = {}
    for i, name in enumerate(names):
        if name not in present:
            continue
        if len(names) <= len(RUN_COLOURS):
            colours[name] = RUN_COLOURS[i]
        else:
            place = 0.92 * i / (len(names) - 1)
            colours[name] = mpl.colormaps["viridis"](place)
    return colours


def week_axis(axes: Axes, weeks: Iterable[float]) -> None:
    """Label the horizontal axis as gestational weeks with whole weeks as ticks."""
    values = list(weeks)
    axes.set_xlabel("gestational age (GW)")
    axes.xaxis.set_major_locator(
        mpl.ticker.MaxNLocator(
            nbins=8,
            integer=True,
            steps=[1, 2, 5, 10],
            min_n_ticks=1,
        )
    )
    # a single week is in the middle of the axis
    margin = max(
        0.04 * (max(values) - min(values)), (1.08 - max(values) + min(values)) / 2
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


def star(
    label: str,
    colour: str = OBSERVED_COLOUR,
    **style: Any,
) -> Line2D:
    """Return the legend entry of observed brains."""
    usual: dict[str, Any] = {
        "marker": "*",
        "markersize": 7,
        "linestyle": "none",
    }
    return Line2D(
        [],
        [],
        color=colour,
        label=label,
        **{**usual, **style},
    )


def run_legend(
    figure: Figure,
    colours: Mapping[str, Any],
    *,
    observed_name: str = "",
    bars: bool = False,
    markers: Mapping[str, str] | None = None,
    extra: Sequence[Artist] = (),
) -> None:
    """Draw a legend below the panels: runs, observed brains if named, subjects, and
    `extra` entries.

    Runs have lines or `bars` of their `colours`; `markers` are by subject. The legend
    has as many columns as its longest label allows, and the figure grows by its rows.
    """
    handles: list[Artist] = [
        (
            Patch(color=colour, label=run)
            if bars
            else Line2D(
                [],
                [],
                color=colour,
                marker="o",
                label=run,
            )
        )
        for run, colour in colours.items()
    ]
    if observed_name:
        handles.append(star(observed_name))
    handles += [
        star(subject, marker=marker, markersize=5)
        for subject, marker in (markers or {}).items()
    ]
    handles.extend(extra)
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
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=columns,
    )
