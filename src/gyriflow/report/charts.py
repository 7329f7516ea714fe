"""Charts of metrics, solver steps and mesh quality."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from ..errors import InputError
from ..parameters.terms import ELEMENTS_NEEDED, SIDES
from .style import (
    FULL_WIDTH_IN,
    MEASURED,
    MUTED_COLOUR,
    REAL_BRAIN,
    REAL_COLOUR,
    RUN_COLOURS,
    SINGLE_COLUMN_IN,
    add_letters,
    chosen_colours,
    from_zero,
    light_grid,
    new_figure,
    run_legend,
    shown_number,
    shown_unit,
    styled,
    week_axis,
)

METRIC_TITLES = {
    "volume": "volume",
    "area": "pial area",
    "gyrification_index": "gyrification index, hulls",
    "gyrification_index_envelope": "gyrification index, envelopes",
    "mean_curvedness": "mean curvedness",
    "mean_shape_index": "mean shape index",
    "mean_sulcal_depth": "mean depth below the hull",
    "folding_index": "folding index",
    "mean_thickness": "mean cortical thickness",
}
"""The metrics of the overview and their titles."""
HEMISPHERE_LINES: Mapping[str, Literal["-", "--", ":"]] = {"whole": "-", "left": "--", "right": ":"}
QUALITY_TITLES = {
    "radius_ratio": "radius ratio (1 = regular)",
    "min_dihedral_deg": "smallest dihedral angle (°)",
    "max_dihedral_deg": "largest dihedral angle (°)",
    "volume_mm3": "volume (mm³)",
}
QUALITY_GATES = {
    "radius_ratio": "min_radius_ratio",
    "min_dihedral_deg": "min_dihedral_deg",
    "max_dihedral_deg": "max_dihedral_deg",
    "volume_mm3": "min_volume_mm3",
}


def _metric_panel(axes: Axes, rows: pd.DataFrame, colours: Mapping[str, Any]) -> set[str]:
    """Draws one metric, of the whole brain where it is known, else per hemisphere; returns the hemispheres drawn."""
    drawn: set[str] = {"whole"} if (rows["hemisphere"] == "whole").any() else set(SIDES)
    for (run, hemisphere), group in rows[rows["hemisphere"].isin(drawn)].groupby(["run", "hemisphere"], sort=False):
        ordered = group.sort_values("week")
        if run == MEASURED:
            open_star = hemisphere == "right"
            axes.plot(
                ordered["week"],
                ordered["value"],
                "*",
                color=REAL_COLOUR,
                markersize=7,
                markerfacecolor="white" if open_star else REAL_COLOUR,
                zorder=3,
            )
        else:
            axes.plot(
                ordered["week"],
                ordered["value"],
                "o",
                linestyle=HEMISPHERE_LINES[str(hemisphere)],
                markersize=2.5,
                color=colours[str(run)],
            )
    return drawn


@styled
def metrics_chart(
    metrics: pd.DataFrame,
    *,
    names: Sequence[str] = tuple(METRIC_TITLES),
    runs: Sequence[str] = (),
    measured: str = REAL_BRAIN,
    synthetic: bool = False,
) -> Figure:
    """Returns a panel per metric over weeks: runs as lines, measured brains as black stars.

    A metric that is known for the hemispheres only has dashed lines and full stars for the left one, dotted lines and
    open stars for the right one.

    Parameters
    ----------
    metrics : columns subject, run, week, hemisphere, metric, value, unit
        `run` is "real" for measured brains.
    names
        Metrics to show, in this order; those that the table lacks are left out.
    runs
        All runs of the study, which settle the colours.

    Raises
    ------
    InputError
        If the table has none of the metrics.
    """
    present = [name for name in names if (metrics["metric"] == name).any()]
    if not present:
        raise InputError("no metric to draw", found=sorted(set(metrics["metric"])), expected=list(names))
    columns = min(3, len(present))
    lines = -(-len(present) // columns)
    width, height = FULL_WIDTH_IN * max(columns, 2) / 3, 0.7 + 1.9 * lines
    figure = new_figure(width, height, synthetic=synthetic, measured=measured)
    grid = figure.subplots(lines, columns, squeeze=False)
    colours = chosen_colours(metrics["run"], runs)
    hemispheres: set[str] = set()
    for axes, name in zip(grid.flat, present, strict=False):
        rows = metrics[metrics["metric"] == name]
        hemispheres |= _metric_panel(axes, rows, colours)
        unit = shown_unit(rows["unit"].iloc[0])
        axes.set_title(METRIC_TITLES.get(name, name.replace("_", " ")) + (f" ({unit})" if unit else ""))
        week_axis(axes, metrics["week"])
        light_grid(axes)
    for axes in grid.flat[len(present) :]:
        axes.remove()
    add_letters(grid.flat[: len(present)])
    extra = [
        Line2D([], [], color=MUTED_COLOUR, linestyle=HEMISPHERE_LINES[side], label=f"{side} hemisphere")
        for side in SIDES
        if side in hemispheres
    ]
    run_legend(figure, colours, measured=measured if MEASURED in set(metrics["run"]) else "", extra=extra)
    return figure


@styled
def steps_chart(steps: pd.DataFrame, *, order: int, synthetic: bool = False) -> Figure:
    """Returns what a folding solve did over its steps: iterations, smallest det F, displacement, resolution and time.

    Parameters
    ----------
    steps : columns week, newton, krylov, min_J, max_u_mm, mean_u_mm, elements_through_cortex, radius_ratio_01, rung,
        seconds
        One row per accepted step. Steps on another rung than the most frequent one are marked.
    order
        Of the elements: it says how many through the cortex are enough.
    """
    figure = new_figure(SINGLE_COLUMN_IN, 8.4, synthetic=synthetic)
    panels = figure.subplots(7, 1, sharex=True)
    week = steps["week"]
    dots = {"markersize": 2.0, "linewidth": 0.8, "marker": "o"}
    series: list[tuple[str, list[tuple[str, str]]]] = [
        ("Newton\niterations", [("newton", "")]),
        ("CG iterations", [("krylov", "")]),
        ("smallest\ndet F", [("min_J", "")]),
        ("|u| per step\n(mm)", [("max_u_mm", "max"), ("mean_u_mm", "mean")]),
        ("elements through\nthe cortex", [("elements_through_cortex", "")]),
        ("radius ratio,\n1 % quantile", [("radius_ratio_01", "")]),
        ("time per step\n(s)", [("seconds", "")]),
    ]
    for axes, (label, columns) in zip(panels, series, strict=True):
        for (column, name), colour in zip(columns, RUN_COLOURS, strict=False):
            axes.plot(week, steps[column], color=colour, label=name or None, **dots)
        axes.set_ylabel(label)
        light_grid(axes)
        if len(columns) > 1:
            from_zero(axes)
            axes.legend(loc="lower right", ncols=len(columns), bbox_to_anchor=(1.0, 0.98), borderaxespad=0)
    for axes in panels[:2]:
        from_zero(axes)
        axes.yaxis.get_major_locator().set_params(integer=True, nbins=5)
    panels[2].axhline(0, color=RUN_COLOURS[1], linestyle="--", linewidth=0.8)
    panels[4].axhline(ELEMENTS_NEEDED[order], color=RUN_COLOURS[1], linestyle="--", linewidth=0.8)
    for axes in panels[4:]:
        from_zero(axes)
    figure.align_ylabels(panels)
    add_letters(panels)
    week_axis(panels[-1], week)
    unusual = steps[steps["rung"] != steps["rung"].mode().iloc[0]]
    for colour, (rung, rows) in zip(RUN_COLOURS[1:], unusual.groupby("rung", sort=False), strict=False):
        panels[0].plot(rows["week"], rows["newton"], "D", color=colour, markersize=3.5, label=f"rung: {rung}")
    if len(unusual):
        panels[0].legend(loc="lower right", ncols=2, bbox_to_anchor=(1.0, 0.98), borderaxespad=0)
    return figure


@styled
def quality_histogram(
    quality: pd.DataFrame | Mapping[str, Mapping[str, ArrayLike]],
    *,
    gates: Mapping[str, float] | None = None,
    surface: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns histograms of the tetrahedra's radius ratio, dihedral angles and volumes.

    Parameters
    ----------
    quality : DataFrame with one row per element, or {column: {"edges": (k + 1,), "counts": (k,)}}
        Columns radius_ratio, min_dihedral_deg, max_dihedral_deg, volume_mm3; others are left out.
    gates : {min_radius_ratio, min_dihedral_deg, max_dihedral_deg, min_volume_mm3: limit}
        The gates of the configuration, drawn as lines; others are left out.
    surface
        What is to be said of the mesh's surface, under the histograms.
    """
    figure = new_figure(FULL_WIDTH_IN, 2.5, synthetic=synthetic)
    panels = figure.subplots(1, len(QUALITY_TITLES), sharey=False)
    for axes, (column, label) in zip(panels, QUALITY_TITLES.items(), strict=True):
        if isinstance(quality, pd.DataFrame):
            counts, edges = np.histogram(quality[column], bins=50)
        else:
            counts, edges = np.asarray(quality[column]["counts"]), np.asarray(quality[column]["edges"])
        axes.stairs(counts, edges, fill=True, color=RUN_COLOURS[0])
        # a few bad elements decide: a linear axis would hide them
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.7)
        axes.set_xlabel(label)
        filled = np.flatnonzero(counts)
        said = f"{edges[filled[0]]:.3g} to {edges[filled[-1] + 1]:.3g}"
        limit = (gates or {}).get(QUALITY_GATES.get(column, ""))
        if limit is not None:
            # a least volume far below all others would stretch their axis: it is only told
            if column != "volume_mm3" or limit >= edges[0]:
                axes.axvline(limit, color=RUN_COLOURS[1], linestyle="--")
            said += f", limit {shown_number(limit)}"
        axes.set_title(said, fontsize=7)
        light_grid(axes)
    panels[-1].set_xscale("log")
    add_letters(panels)
    count = f"{int(counts.sum()):,}".replace(",", "\u2009")
    panels[0].set_ylabel(f"elements (of {count})")
    if surface:
        figure.supxlabel(surface, fontsize=7)
    return figure
