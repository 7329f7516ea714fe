"""Charts of growth, metrics, solver steps and mesh quality."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from ..errors import InputError
from .style import (
    FULL_WIDTH_IN,
    MEASURED,
    MUTED_COLOUR,
    REAL_BRAIN,
    REAL_COLOUR,
    RUN_COLOURS,
    SINGLE_COLUMN_IN,
    column_label,
    from_zero,
    light_grid,
    new_figure,
    run_colours,
    run_legend,
    shown_unit,
    simulated_runs,
    styled,
    week_axis,
)

METRIC_TITLES = {
    "volume": "volume",
    "area": "pial area",
    "gyrification_index": "gyrification index, convex hull",
    "gyrification_index_envelope": "gyrification index, envelope",
    "mean_curvedness": "mean curvedness",
    "mean_shape_index": "mean shape index",
}
"""The metrics of the overview and their titles."""
HEMISPHERE_LINES: Mapping[str, Literal["-", "--", ":"]] = {"whole": "-", "left": "--", "right": ":"}
QUALITY_TITLES = {
    "radius_ratio": "radius ratio (1 = regular)",
    "min_dihedral_deg": "smallest dihedral angle (°)",
    "max_dihedral_deg": "largest dihedral angle (°)",
}


@styled
def growth_chart(
    areas: pd.DataFrame,
    rates: pd.DataFrame,
    *,
    folding_rate_per_s: float | Mapping[float, float] | None = None,
    measured: str = REAL_BRAIN,
    title: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns cortical area and volume over weeks, and the tangential growth rate of each interval as bars.

    Parameters
    ----------
    areas : columns subject, week, area_cm2, volume_ml
    rates : columns from_week, to_week, rate_per_s (1/s)
    folding_rate_per_s
        Growth rate of the folding in 1/s, drawn as a line over the bars: a number, or values by week that are linear
        in between and constant beyond.
    """
    figure = new_figure(FULL_WIDTH_IN, 2.6, title=title, synthetic=synthetic)
    area_axes, rate_axes = figure.subplots(1, 2)
    known = areas.sort_values("week")
    area_axes.plot(known["week"], known["area_cm2"], "o-", color=RUN_COLOURS[0])
    area_axes.set_ylabel("pial area (cm²)", color=RUN_COLOURS[0])
    from_zero(area_axes)
    week_axis(area_axes, known["week"])
    light_grid(area_axes)
    volume_axes = area_axes.twinx()
    volume_axes.spines["right"].set_visible(True)
    volume_axes.plot(known["week"], known["volume_ml"], "s--", color=RUN_COLOURS[1])
    volume_axes.set_ylabel("volume (mL)", color=RUN_COLOURS[1])
    from_zero(volume_axes)
    area_axes.set_title(f"{measured}: area and volume")

    scaled = rates["rate_per_s"] * 1e7
    labels = [
        column_label((a, b)).removesuffix(" GW") for a, b in zip(rates["from_week"], rates["to_week"], strict=True)
    ]
    bars = rate_axes.bar(labels, scaled, width=0.7, color=RUN_COLOURS[0])
    # in front of the folding's line, where they meet
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
    size = 6.5 if len(rates) <= 10 else 5
    texts = rate_axes.bar_label(bars, fmt=lambda rate: f"{rate:.2f}".replace("-", "−"), fontsize=size, padding=2)
    for text in texts:
        text.set(bbox=box, zorder=3)
    rate_axes.axhline(0, color="black", linewidth=0.6)
    if folding_rate_per_s is not None:
        _folding_line(rate_axes, rates, folding_rate_per_s)
        # above the axes, where no bar can be
        rate_axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.06), borderaxespad=0)
    rate_axes.set_ylabel("growth rate (10⁻⁷ s⁻¹)")
    rate_axes.set_xlabel("gestational interval (GW)")
    rate_axes.set_title("tangential growth rate", loc="left")
    if len(labels) > 6:
        rate_axes.tick_params(axis="x", rotation=45)
    rate_axes.margins(y=0.12)
    # room for three bars at least, else a single one fills the panel
    spare = max(0.0, 3 - len(labels)) / 2
    rate_axes.set_xlim(-0.6 - spare, len(labels) - 0.4 + spare)
    return figure


def _folding_line(axes: Axes, rates: pd.DataFrame, rate_per_s: float | Mapping[float, float]) -> None:
    """Draws the folding's growth rate over bars of equal width, one per interval of the rates."""
    look: dict[str, Any] = {"color": RUN_COLOURS[1], "linestyle": "--"}
    if not isinstance(rate_per_s, Mapping):
        axes.axhline(rate_per_s * 1e7, label=f"folding: {rate_per_s * 1e7:.3g}·10⁻⁷ s⁻¹", **look)
        return
    weeks = np.array(sorted(rate_per_s))
    values = 1e7 * np.array([rate_per_s[week] for week in weeks])
    ends = np.array([*rates["from_week"], rates["to_week"].iloc[-1]])
    shown = np.union1d(ends, weeks[(weeks > ends[0]) & (weeks < ends[-1])])
    places = np.interp(shown, ends, np.arange(len(ends)) - 0.5)
    axes.plot(places, np.interp(shown, weeks, values), label="folding", **look)


def _metric_panel(axes: Axes, rows: pd.DataFrame, colours: Mapping[str, Any]) -> set[str]:
    """Draws one metric, of the whole brain where it is known, else per hemisphere; returns the hemispheres drawn."""
    drawn = {"whole"} if (rows["hemisphere"] == "whole").any() else {"left", "right"}
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
    measured: str = REAL_BRAIN,
    title: str = "",
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
    figure = new_figure(width, height, title=title, synthetic=synthetic, measured=measured)
    grid = figure.subplots(lines, columns, squeeze=False)
    runs = simulated_runs(metrics["run"])
    hemispheres: set[str] = set()
    for axes, name in zip(grid.flat, present, strict=False):
        rows = metrics[metrics["metric"] == name]
        hemispheres |= _metric_panel(axes, rows, run_colours(runs))
        unit = shown_unit(rows["unit"].iloc[0])
        axes.set_title(METRIC_TITLES.get(name, name.replace("_", " ")) + (f" ({unit})" if unit else ""))
        week_axis(axes, metrics["week"])
        light_grid(axes)
    for axes in grid.flat[len(present) :]:
        axes.remove()
    extra = [
        Line2D([], [], color=MUTED_COLOUR, linestyle=HEMISPHERE_LINES[side], label=f"{side} hemisphere")
        for side in ("left", "right")
        if side in hemispheres
    ]
    run_legend(figure, runs, measured=measured if MEASURED in set(metrics["run"]) else "", extra=extra)
    return figure


@styled
def steps_chart(steps: pd.DataFrame, *, title: str = "", synthetic: bool = False) -> Figure:
    """Returns what a folding solve did over its steps: iterations, smallest det F, displacement and time.

    Parameters
    ----------
    steps : columns week, newton, krylov, min_J, max_u_mm, mean_u_mm, rung, seconds
        One row per accepted step. Steps on another rung than the most frequent one are marked.
    """
    figure = new_figure(SINGLE_COLUMN_IN, 6.2, title=title, synthetic=synthetic)
    panels = figure.subplots(5, 1, sharex=True)
    week = steps["week"]
    dots = {"markersize": 2.0, "linewidth": 0.8, "marker": "o"}
    series: list[tuple[str, list[tuple[str, str]]]] = [
        ("Newton\niterations", [("newton", "")]),
        ("CG iterations", [("krylov", "")]),
        ("smallest\ndet F", [("min_J", "")]),
        ("|u| per step\n(mm)", [("max_u_mm", "max"), ("mean_u_mm", "mean")]),
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
    from_zero(panels[4])
    figure.align_ylabels(panels)
    week_axis(panels[4], week)
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
    min_radius_ratio: float | None = None,
    title: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns histograms of the tetrahedra's radius ratio and dihedral angles.

    Parameters
    ----------
    quality : DataFrame with one row per element, or {column: {"edges": (k + 1,), "counts": (k,)}}
        Columns radius_ratio, min_dihedral_deg, max_dihedral_deg; others are left out.
    min_radius_ratio
        The gate of the configuration, drawn as a line.
    """
    figure = new_figure(FULL_WIDTH_IN, 2.3, title=title, synthetic=synthetic)
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
        low, high = edges[filled[0]], edges[filled[-1] + 1]
        count = f"{int(counts.sum()):,}".replace(",", "\u2009")
        axes.set_title(f"{count} elements, {low:.3g} to {high:.3g}", fontsize=7)
        light_grid(axes)
    panels[0].set_ylabel("elements")
    if min_radius_ratio is not None:
        panels[0].axvline(min_radius_ratio, color=RUN_COLOURS[1], linestyle="--", label=f"gate {min_radius_ratio:g}")
        panels[0].legend(loc="upper left")
    return figure
