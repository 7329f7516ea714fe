"""Charts of what simulations are worth beside real brains: gain over no folding, and how local growth must be known."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
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
    run_colours,
    run_legend,
    styled,
    week_axis,
)

MEASURES = {"shape_index": "shape index", "mean_curvature": "mean curvature"}
"""What is compared, as in the names of columns, and their titles."""
CEILING = "registration alone"
ONE_WEEK = np.array([-0.25, 0.25])
"""Ends in weeks of a line that stands for a single week."""


@styled
def validation_chart(
    validation: pd.DataFrame,
    ceiling: pd.DataFrame | None = None,
    *,
    runs: Sequence[str] = (),
    synthetic: bool = False,
) -> Figure:
    """Returns by week how much better a run's curvature correlates with the real brain's than the scaled start's does.

    Bars are 95 % intervals of the bootstrap; filled marks explain the week, open ones predict it. The adjacent real
    week, which skill is measured against, and the start carried by registration alone are drawn beside.

    Parameters
    ----------
    validation
        Columns run, start_week, week, kind, gain_…, gain_low_…, gain_high_…, r_start_…, r_adjacent_… of each of
        `MEASURES`.
    ceiling
        The same of the start carried by registration.
    runs
        All runs of the study, which settle the colours.
    """
    figure = new_figure(FULL_WIDTH_IN, 3.2, synthetic=synthetic)
    colours = chosen_colours(validation["run"], runs)
    panels = figure.subplots(1, 2)
    add_letters(panels)
    for axes, (measure, name) in zip(panels, MEASURES.items(), strict=True):
        for number, (run, start) in enumerate(
            dict.fromkeys(zip(validation["run"], validation["start_week"], strict=True))
        ):
            rows = validation[(validation["run"] == run) & (validation["start_week"] == start)].sort_values("week")
            _gain_line(axes, rows, measure, colours[run], shift=0.03 * (number - (len(colours) - 1) / 2))
        for _, rows in validation.groupby("start_week"):
            adjacent = (rows[f"r_adjacent_{measure}"] - rows[f"r_start_{measure}"]).groupby(rows["week"]).first()
            axes.plot(adjacent.index, adjacent, "*", color=REAL_COLOUR, markersize=6)
        if ceiling is not None and len(ceiling):
            for _, rows in ceiling.groupby("start_week"):
                gain = rows[f"gain_{measure}"]
                axes.plot(rows["week"], gain, ":", color=MUTED_COLOUR)
                if len(rows) == 1:  # a line through one point cannot be seen
                    axes.hlines(gain, *(rows["week"].iloc[0] + ONE_WEEK), colors=MUTED_COLOUR, linestyles=":")
        axes.axhline(0, color=MUTED_COLOUR, linewidth=0.8)
        axes.set_title(f"{name}: r less that of the scaled start")
        week_axis(axes, validation["week"])
        light_grid(axes)
    extra = [
        Line2D(
            [], [], color=REAL_COLOUR, marker="*", linestyle="none", markersize=6, label="real brain of the week before"
        )
    ]
    if ceiling is not None and len(ceiling):
        extra.append(Line2D([], [], color=MUTED_COLOUR, linestyle=":", label=CEILING))
    run_legend(figure, colours, extra=extra)
    return figure


@styled
def smoothing_chart(
    validation: pd.DataFrame,
    smoothing_mm: Mapping[str, float],
    ceiling: pd.DataFrame | None = None,
    *,
    synthetic: bool = False,
) -> Figure:
    """Returns the gain over no folding against the length that local growth is smoothed by, a line for each week.

    Parameters
    ----------
    validation
        Columns run, week, gain_… of each of `MEASURES`.
    smoothing_mm
        The runs that differ in nothing else, and their lengths; an infinite one is that of uniform growth.
    ceiling
        The same columns of the start carried by registration, drawn as dotted lines.
    """
    lengths = {run: length for run, length in smoothing_mm.items() if run in set(validation["run"])}
    finite = sorted({length for length in lengths.values() if np.isfinite(length)})
    beyond = 1.6 * max(finite, default=1.0)
    rows = validation[validation["run"].isin(lengths)].assign(length=lambda table: table["run"].map(lengths))
    rows["length"] = rows["length"].clip(upper=beyond)
    weeks = sorted(rows["week"].unique())
    colours = run_colours([f"{week:g} GW" for week in weeks])
    figure = new_figure(FULL_WIDTH_IN, 3.2, synthetic=synthetic)
    panels = figure.subplots(1, 2)
    add_letters(panels)
    for axes, (measure, name) in zip(panels, MEASURES.items(), strict=True):
        for week, colour in zip(weeks, colours.values(), strict=True):
            line = rows[rows["week"] == week].groupby("length")[f"gain_{measure}"].mean()
            axes.plot(line.index, line, "o-", color=colour)
            if ceiling is not None:
                for gain in ceiling.loc[ceiling["week"] == week, f"gain_{measure}"]:
                    axes.axhline(gain, color=colour, linestyle=":", linewidth=0.8)
        axes.axhline(0, color=MUTED_COLOUR, linewidth=0.8)
        axes.set_xscale("log")
        uniform = any(np.isinf(length) for length in lengths.values())
        axes.set_xticks([*finite, *([beyond] if uniform else [])])
        axes.set_xticklabels([f"{length:g}" for length in finite] + (["uniform"] if uniform else []))
        axes.minorticks_off()
        axes.set_xlabel("smoothing of measured growth, standard deviation (mm)")
        axes.set_title(f"{name}: r less that of the scaled start")
        light_grid(axes)
    extra = [Line2D([], [], color=MUTED_COLOUR, linestyle=":", label=CEILING)] if ceiling is not None else []
    run_legend(figure, colours, extra=extra)
    return figure


def _gain_line(axes: Axes, rows: pd.DataFrame, measure: str, colour: str, *, shift: float) -> None:
    weeks, gain = rows["week"] + shift, rows[f"gain_{measure}"]
    away = np.stack([gain - rows[f"gain_low_{measure}"], rows[f"gain_high_{measure}"] - gain])
    axes.errorbar(weeks, gain, yerr=away.clip(min=0), color=colour, linewidth=1.0, elinewidth=0.7)
    for kind, face in (("explained", colour), ("predicted", "white")):
        chosen = rows["kind"] == kind
        axes.plot(weeks[chosen], gain[chosen], "o", color=colour, markerfacecolor=face)
