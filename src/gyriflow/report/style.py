"""The look that all figures share: sizes for print, fonts, colour-blind-safe colours, headings."""

import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import wraps
from string import ascii_lowercase
from typing import Any, TypedDict

import matplotlib as mpl
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..parameters.terms import MEASURED, run_names

SINGLE_COLUMN_IN = 3.5
"""Width of one column of a journal page, in inches."""
FULL_WIDTH_IN = 7.2
"""Width of a journal page, in inches."""

RUN_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C6D31")
"""Okabe and Ito's colour-blind-safe colours, without black (measured brains) and yellow (too pale on white)."""
REAL_COLOUR = "#000000"
MUTED_COLOUR = "#767676"
RIGHT_COLOUR = "#E0B400"
"""The right hemisphere and what it touches: the paper's yellow, dark enough for lines on white."""
SIMULATED_SURFACE_COLOUR = "#8FB4DC"
REAL_SURFACE_COLOUR = "#EBD6B4"

MAGNITUDES = "YlGnBu"
"""Colour map of quantities from zero up: pale at zero, so that dark colours are values and not shade."""
NEUTRAL_COLOUR = "#D9D9D9"
"""Tissue without a value: outside, not measured, or exactly zero where only what is above counts."""

REAL_BRAIN, SIMPLE_SHAPE = "real brain", "simple shape"
"""What brains that were not simulated are called where their population is not known."""
SYNTHETIC_NAMES = frozenset((SIMPLE_SHAPE, "sphere", "ellipsoid"))
"""What shapes in place of brains are called."""

_SETTINGS: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
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
    "legend.title_fontsize": 7.0,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.0,
    "grid.color": "#E2E2E2",
    "grid.linewidth": 0.5,
}


class Shown(TypedDict, total=False):
    """What charts are told besides their data.

    Attributes
    ----------
    runs : all runs of the study, which settle the colours
    measured : what the measured brains are called, "real brain" unless it is said
    synthetic : whether the folded brains are shapes in their place
    """

    runs: Sequence[str]
    measured: str
    synthetic: bool


def style() -> AbstractContextManager[None]:
    """Returns a context in which matplotlib draws in the project's style; the settings outside stay as they are."""
    return mpl.rc_context(_SETTINGS)


def styled[**P](chart: Callable[P, Figure]) -> Callable[P, Figure]:
    """Returns `chart` made to draw its figure in the project's style."""

    @wraps(chart)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with style():
            return chart(*args, **kwargs)

    return drawn


def new_figure(width_in: float, height_in: float, *, synthetic: bool, measured: str = SIMPLE_SHAPE) -> Figure:
    """Returns an empty figure. What it shows is said by its caption; that brains are synthetic, by the figure too.

    Parameters
    ----------
    synthetic
        Whether the folded brain is a shape in its place.
    measured
        What the brains that it is shown beside are called.
    """
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    if synthetic:
        figure.suptitle(synthetic_note(measured))
    return figure


def panel_figure(
    count: int,
    *,
    per_row: int = 3,
    panel_in: float = 1.9,
    foot_in: float = 0.7,
    synthetic: bool = False,
    measured: str = SIMPLE_SHAPE,
    **grid: Any,
) -> tuple[Figure, list[Axes]]:
    """Returns a figure with so many panels, row after row, and the panels, with their letters.

    Parameters
    ----------
    per_row
        Panels of a full row, which is as wide as a page.
    panel_in, foot_in
        Height of a row, and what is left for the legend, in inches.
    synthetic, measured : as for `new_figure`
    grid
        What else `Figure.subplots` takes.
    """
    columns = min(per_row, count)
    lines = -(-count // columns)
    width = FULL_WIDTH_IN * min(1.0, max(columns, 2) / per_row)
    figure = new_figure(width, foot_in + panel_in * lines, synthetic=synthetic, measured=measured)
    panels = list(figure.subplots(lines, columns, squeeze=False, **grid).flat)
    for spare in panels[count:]:
        spare.remove()
    add_letters(panels[:count])
    return figure, panels[:count]


def run_panels(
    count: int, present: Iterable[str], shown: Shown, **layout: Any
) -> tuple[Figure, list[Axes], dict[str, Any]]:
    """Returns `panel_figure` for runs that are present, and the colours of these."""
    told: dict[str, Any] = {"synthetic": shown.get("synthetic", False), "measured": shown.get("measured", SIMPLE_SHAPE)}
    figure, panels = panel_figure(count, **told, **layout)
    return figure, panels, chosen_colours(present, shown.get("runs", ()))


def add_letters(panels: Iterable[Axes]) -> None:
    """Writes a, b, c … at the upper left of panels, by which a caption calls them; nothing for a single panel."""
    panels = list(panels)
    if len(panels) > 1:
        for axes, letter in zip(panels, ascii_lowercase, strict=False):
            # beside the title, which may be as wide as the panel
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


def synthetic_note(measured: str = SIMPLE_SHAPE) -> str:
    """Returns the words under which a synthetic brain is shown, alone or beside brains that are called `measured`."""
    return "a simple shape, not a real brain" if all_synthetic(measured) else "simulated from a simple shape"


def all_synthetic(measured: str) -> bool:
    """Returns whether brains called `measured`, several names joined by "or", were all made by the workflow."""
    return set(measured.split(" or ")) <= SYNTHETIC_NAMES


def wrap(text: str, letters: int) -> str:
    """Returns text with each of its lines broken between words so that it has about so many letters at most."""
    return "\n".join(textwrap.fill(line, letters, break_long_words=False) for line in text.split("\n"))


def simulated_runs(runs: Iterable[str]) -> list[str]:
    """Returns the names of the simulated runs, each once, in the order given."""
    return [run for run in dict.fromkeys(runs) if run != MEASURED]


def chosen_colours(present: Iterable[str], runs: Sequence[str] = ()) -> dict[str, Any]:
    """Returns the colours of the simulated runs that are present, in the order of all `runs` of the study."""
    simulated = simulated_runs(present)
    colours = run_colours([*runs, *simulated])
    return {run: colour for run, colour in colours.items() if run in simulated}


def runs_by_name(table: pd.DataFrame) -> pd.DataFrame:
    """Returns a table with columns run and subject in which simulated brains go by the names of `run_names`."""
    pairs = list(dict.fromkeys(zip(table["run"], table["subject"], strict=True)))
    pairs = [pair for pair in pairs if pair[0] != MEASURED]
    names = dict(zip(pairs, run_names(pairs), strict=True))
    shown = [names.get(pair, pair[0]) for pair in zip(table["run"], table["subject"], strict=True)]
    return table.assign(run=shown)


def run_colours(runs: Iterable[str]) -> dict[str, Any]:
    """Returns a colour for each run in the order given: distinct ones, or a sequential scale for a long list.

    All figures of a study name all of its runs, in the same order: so a run keeps its colour from figure to figure.
    """
    names = list(dict.fromkeys(runs))
    if len(names) <= len(RUN_COLOURS):
        return dict(zip(names, RUN_COLOURS, strict=False))
    scale = mpl.colormaps["viridis"]
    return {name: scale(0.92 * i / (len(names) - 1)) for i, name in enumerate(names)}


def week_axis(axes: Axes, weeks: Iterable[float] | None = None) -> None:
    """Labels the horizontal axis as gestational weeks with whole weeks as ticks."""
    axes.set_xlabel("gestational age (GW)")
    axes.xaxis.set_major_locator(mpl.ticker.MaxNLocator(nbins=8, integer=True, steps=[1, 2, 5, 10], min_n_ticks=1))
    if weeks is not None:
        values = list(weeks)
        # a single week stands in the middle of one
        margin = max(0.04 * (max(values) - min(values)), (1.08 - max(values) + min(values)) / 2)
        axes.set_xlim(min(values) - margin, max(values) + margin)


def from_zero(axes: Axes) -> None:
    """Makes the vertical axis begin at zero and end a little above the data of all panels that share it."""
    tops = [panel.dataLim.ymax for panel in axes.get_shared_y_axes().get_siblings(axes)]
    # panels without data have an infinite top
    top = max((top for top in tops if math.isfinite(top)), default=0.0)
    axes.set_ylim(0, 1.07 * top if top > 0 else 1.0)


def light_grid(axes: Axes, axis: str = "y") -> None:
    """Draws pale grid lines behind the data."""
    axes.grid(visible=True, axis=axis)  # type: ignore[arg-type]


def star(label: str, colour: str = REAL_COLOUR, **look: Any) -> Line2D:
    """Returns the entry of a legend for measured brains."""
    usual: dict[str, Any] = {"marker": "*", "markersize": 7, "linestyle": "none"}
    return Line2D([], [], color=colour, label=label, **{**usual, **look})


def run_legend(
    figure: Figure,
    colours: Mapping[str, Any],
    *,
    measured: str = "",
    bars: bool = False,
    extra: Sequence[Artist] = (),
) -> None:
    """Draws below the panels a legend of the runs, of the measured brains where they have a name, and of what else.

    Runs are keyed as they are drawn, as lines or as `bars`. The legend has as many columns as its longest label allows,
    and the figure grows by its lines.

    Parameters
    ----------
    colours : {run: colour}
    """
    handles: list[Artist] = [
        Patch(color=colour, label=run) if bars else Line2D([], [], color=colour, marker="o", label=run)
        for run, colour in colours.items()
    ]
    if measured:
        handles.append(star(measured))
    handles.extend(extra)
    # a letter of the legend is about 0.065 in wide, the line before it and the gap behind 0.5 in
    longest = 0.5 + 0.065 * max(len(str(handle.get_label())) for handle in handles)
    columns = max(1, min(len(handles), int(figure.get_figwidth() / longest)))
    lines = -(-len(handles) // columns)
    figure.set_figheight(figure.get_figheight() + 0.15 * (lines - 1))
    figure.legend(handles=handles, loc="outside lower center", ncols=columns)
