"""The chart of the age profile: which week of the reference brains the simulated ones look like."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..errors import InputError
from .style import (
    FULL_WIDTH_IN,
    MEASURED,
    MUTED_COLOUR,
    REAL_BRAIN,
    REAL_COLOUR,
    add_letters,
    chosen_colours,
    light_grid,
    new_figure,
    run_legend,
    styled,
    week_axis,
    week_label,
    wrap,
)

ALL, FREE_OF_SIZE = "all", "all without size"
CLIPPED = "range cut at the end"
"""The flag of an age or range that reaches an end of the reference."""
MOST_METRICS = 14
"""Metrics in the lower panel: those with most weight."""
LEAST_WEIGHT = 0.005
"""Metrics with a smaller share of the weight are left out there."""
ONE_A_WEEK = (
    "one reference brain a week: how fetuses of one age differ is not known, and no single fetus can be dated by this"
)
_GAP_GW = 0.1
"""How far points of one week stand from each other."""


@styled
def age_profile_chart(
    profile: pd.DataFrame,
    check: pd.DataFrame,
    similarity: pd.DataFrame,
    *,
    runs: Sequence[str] = (),
    measured: str = REAL_BRAIN,
    synthetic: bool = False,
) -> Figure:
    """Returns the ages that whole brains look like over their own, and each metric's age at the last simulated week.

    The upper left panel has the simulated brains (and measured ones that are no reference), the upper right one the
    reference brains, each left out of its own reference. Large marks are all metrics together, filled, and without
    those of size, open; bars are ± the error of reference brains left out (left) and the spread of the metrics (right);
    dots are single metrics; triangles are ages outside the reference, diamonds ages or ranges cut at its ends. The
    middle panel has the similarity of the runs' brains of that week to each week of the reference. Where the reference
    has one brain a week, the figure says that it can date no single fetus.

    Parameters
    ----------
    profile, check : columns run, week, hemisphere, metric, kind, estimated_week, low, high, weight, flag
        `profile` has brains_per_week, `check` mean_absolute_error, too.
    similarity : columns run, week, hemisphere, reference_week, similarity
    runs
        All runs of the study, which settle the colours.

    Raises
    ------
    InputError
        If there is no simulated brain in the profile.
    """
    brains = profile[profile["hemisphere"] == "whole"]
    left_out = check[check["hemisphere"] == "whole"]
    of_runs = chosen_colours(brains["run"], runs)
    if not of_runs:
        raise InputError("no simulated brain in the age profile", found=sorted(set(brains["run"])))
    colours = of_runs | {MEASURED: REAL_COLOUR}
    last = max(set.intersection(*(set(brains.loc[brains["run"] == run, "week"]) for run in of_runs)))
    rows = _of_last_week(brains, last)
    figure = new_figure(FULL_WIDTH_IN, 5.0 + 0.17 * rows["metric"].nunique(), synthetic=synthetic, measured=measured)
    grid = figure.add_gridspec(3, 2, height_ratios=[2.9, 1.3, 0.5 + 0.17 * rows["metric"].nunique()])
    panels = [figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])]
    for axes, table in zip(panels, (brains, left_out), strict=True):
        _age_panel(axes, table, colours)
        _frame(axes, [brains, left_out])
    panels[0].set_ylabel("looks like (GW)")
    panels[0].set_title("simulated" + (" (stars: other measured brains)" if (brains["run"] == MEASURED).any() else ""))
    panels[1].set_title(_errors(left_out, measured))
    below, between = figure.add_subplot(grid[2, :]), figure.add_subplot(grid[1, :])
    _similarity_panel(between, similarity[similarity["hemisphere"] == "whole"], colours, last)
    _metric_panel(below, rows, colours, last)
    add_letters([*panels, between, below])
    if (profile["brains_per_week"] < 2).all():
        figure.suptitle("\n".join(filter(None, (figure.get_suptitle(), wrap(ONE_A_WEEK, 90)))))
    dots: dict[str, Any] = {"color": MUTED_COLOUR, "linestyle": "none", "marker": "o"}
    extra = [
        Line2D([], [], markersize=5, label="all metrics", **dots),
        Line2D([], [], markersize=5, markerfacecolor="white", label="without those of size", **dots),
        Line2D([], [], markersize=2, label="single metrics", **dots),
        Line2D([], [], markersize=4, label="outside the reference", **dots | {"marker": "^"}),
        Line2D([], [], markersize=4, label="range cut at its end", **dots | {"marker": "d"}),
    ]
    run_legend(figure, of_runs, measured=f"{measured}, left out", extra=extra)
    return figure


def _of_last_week(brains: pd.DataFrame, week: float) -> pd.DataFrame:
    """Returns the rows of simulated brains of a week: the metrics with most weight, those first."""
    rows = brains[(brains["run"] != MEASURED) & (brains["week"] == week) & (brains["kind"] != "together")]
    rows = rows[
        (rows["weight"] > LEAST_WEIGHT) & rows["estimated_week"].notna() & (rows["flag"] != "growth follows it")
    ]
    order = rows.groupby("metric")["weight"].max().sort_values(ascending=False).index[:MOST_METRICS]
    return rows[rows["metric"].isin(order)].sort_values("weight", ascending=False, kind="stable")


def _errors(left_out: pd.DataFrame, measured: str) -> str:
    means = left_out.groupby("metric")["mean_absolute_error"].first()
    errors = f"mean error {means[ALL]:.2f} GW,\nwithout metrics of size {means[FREE_OF_SIZE]:.2f} GW"
    return wrap(f"{measured}, left out:" + (" " if len(measured) < 20 else "\n") + errors, 50)


def _marker(flag: str, inside: str) -> str:
    if flag == CLIPPED:
        return "d"
    return "v" if flag.startswith("younger") else "^" if flag.startswith("older") else inside


def _age_panel(axes: Axes, table: pd.DataFrame, colours: Mapping[str, Any]) -> None:
    """Draws estimated over own weeks, the brains of each run beside each other."""
    runs = list(dict.fromkeys(table["run"]))
    for index, run in enumerate(runs):
        own, colour = table[table["run"] == run], colours[run]
        shift = _GAP_GW * (index - (len(runs) - 1) / 2)
        single = own[(own["kind"] != "together") & (own["weight"] > 0) & (own["flag"] != "growth follows it")]
        for flag, rows in single.groupby("flag"):
            axes.plot(
                rows["week"] + 2 * shift,
                rows["estimated_week"],
                _marker(str(flag), "o"),
                color=colour,
                markersize=2.2,
                markeredgewidth=0,
                alpha=0.35,
            )
        for metric, face, line, aside in ((FREE_OF_SIZE, "white", "--", 0.4), (ALL, colour, "-", -0.4)):
            rows = own[own["metric"] == metric].sort_values("week")
            place = rows["week"] + 2 * shift + aside * _GAP_GW
            week = rows["estimated_week"]
            spread = np.abs([week - rows["low"], rows["high"] - week])
            axes.errorbar(place, week, yerr=spread, fmt="none", ecolor=colour, elinewidth=0.8, alpha=0.7)
            if run != MEASURED:
                axes.plot(place, week, line, color=colour, linewidth=0.9)
            for x, y, flag in zip(place, week, rows["flag"], strict=True):
                marker = _marker(flag, "*" if run == MEASURED else "o")
                size = 7 if marker == "*" else 4.5
                axes.plot(x, y, marker, color=colour, markerfacecolor=face, markersize=size, zorder=3)


def _frame(axes: Axes, tables: Sequence[pd.DataFrame]) -> None:
    """Gives both panels the same weeks on both axes, and the line on which a brain looks as old as it is."""
    weeks = pd.concat([pd.concat([table["week"], table["low"], table["high"]]) for table in tables]).dropna()
    week_axis(axes, weeks)
    axes.set_ylim(axes.get_xlim())
    axes.set_box_aspect(0.8)
    axes.yaxis.set_major_locator(axes.xaxis.get_major_locator())
    axes.plot([weeks.min(), weeks.max()], [weeks.min(), weeks.max()], ":", color=MUTED_COLOUR, linewidth=0.9, zorder=1)
    light_grid(axes)


def _similarity_panel(axes: Axes, similarity: pd.DataFrame, colours: Mapping[str, Any], week: float) -> None:
    """Draws the similarity of the runs' brains of a week to each week of the reference."""
    rows = similarity[(similarity["run"] != MEASURED) & (similarity["week"] == week)]
    for run, own in rows.groupby("run", sort=False):
        ordered = own.sort_values("reference_week")
        axes.plot(ordered["reference_week"], ordered["similarity"], "o-", color=colours[str(run)], markersize=3)
    axes.axvline(week, color=MUTED_COLOUR, linestyle=":", linewidth=0.9, zorder=1)
    axes.set_ylim(0, 1)
    axes.set_ylabel("similarity")
    axes.set_title(f"similarity of {week_label(week)} to each week of the reference (1: as on its curves)")
    week_axis(axes, similarity["reference_week"])
    axes.set_xlabel("week of the reference (GW)")
    light_grid(axes)


def _metric_panel(axes: Axes, rows: pd.DataFrame, colours: Mapping[str, Any], week: float) -> None:
    """Draws the age by each metric with its range, most weight on top."""
    metrics = list(dict.fromkeys(rows["metric"]))
    runs = list(dict.fromkeys(rows["run"]))
    for index, run in enumerate(runs):
        own = rows[rows["run"] == run]
        columns = (own[name] for name in ("metric", "kind", "flag", "estimated_week", "low", "high"))
        for metric, kind, flag, age, low, high in zip(*columns, strict=True):
            place = metrics.index(metric) + 0.6 * ((index + 0.5) / len(runs) - 0.5)
            axes.plot([low, high], [place, place], color=colours[run], linewidth=0.8, alpha=0.7)
            face = colours[run] if kind == "size" else "white"
            axes.plot(age, place, _marker(flag, "o"), color=colours[run], markerfacecolor=face, markersize=3.5)
    weights = rows.groupby("metric")["weight"].max()
    names = [
        f"{metric.replace('spangy', 'SpAnGy').replace('_', ' ')}  {100 * weights[metric]:.0f} %" for metric in metrics
    ]
    axes.set_yticks(range(len(metrics)), names)
    axes.set_ylim(len(metrics) - 0.4, -0.6)
    axes.axvline(week, color=MUTED_COLOUR, linestyle=":", linewidth=0.9, zorder=1)
    axes.set_title(f"by single metrics at {week_label(week)}, with their weight: of size filled, free of size open")
    week_axis(axes)
    axes.set_xlabel("looks like (GW)")
    light_grid(axes, "x")
