"""Charts of simulations compared with observed brains: gain, onset of sulci, sweeps, calibrations."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..errors import InputError
from ..quantities import COMPARED_MAPS, VERTEX_MAPS, Shown, metrics_shown
from ..settings.terms import MEASURED, SIDES
from .labels import parameter_label, plain, with_unit
from .style import (
    FULL_WIDTH_IN,
    MUTED_COLOUR,
    OBSERVED_COLOUR,
    RUN_COLOURS,
    panel_figure,
    run_colours,
    run_legend,
    star,
    styled,
    week_axis,
    wrap,
)

ONE_WEEK = np.array([-0.25, 0.25])
"""Ends in weeks of a line for a single week."""
ROW_IN = 0.22
"""Height of a sulcus's row."""
SIDE_STYLES = {"whole": ("o", RUN_COLOURS[0]), "left": ("<", RUN_COLOURS[0]), "right": (">", RUN_COLOURS[1])}
SIDE_NAMES = {"whole": "whole brain", "left": "left hemisphere", "right": "right hemisphere"}


@styled
def validation_chart(
    validation: pd.DataFrame, ceiling: pd.DataFrame | None = None, *, runs: Sequence[str] = ()
) -> Figure:
    """Draw by week how much better a run's curvature correlates with the observed brain's than the scaled start's.

    Bars are 95 % intervals of the bootstrap; filled marks are explained weeks, open ones predicted. Stars are the
    headroom, the gain of the observed brain of the week before; a dotted line is the start carried by registration
    alone.

    `validation` has the columns run, start_week, week, kind, and gain and headroom (gain_…, gain_low_…, gain_high_…) of
    each of `COMPARED_MAPS`; `ceiling` the same of the start carried by registration.
    """
    colours = run_colours(validation["run"], runs)
    figure, panels = panel_figure(len(COMPARED_MAPS), per_row=2, panel_in=2.5)
    for axes, measure in zip(panels, COMPARED_MAPS, strict=True):
        for number, ((run, _), rows) in enumerate(validation.groupby(["run", "start_week"], sort=False)):
            line = rows.sort_values("week")
            shift = 0.03 * (number - (len(colours) - 1) / 2)
            _gain_line(axes, line["week"] + shift, line, measure, colours[str(run)])
        for _, rows in validation.groupby("start_week"):
            weeks = rows.drop_duplicates("week")
            headroom, bars = weeks[f"headroom_{measure}"], _bars(weeks, "headroom", measure)
            style: dict[str, Any] = {"color": OBSERVED_COLOUR, "markersize": 6, "elinewidth": 0.7}
            axes.errorbar(weeks["week"], headroom, yerr=bars, fmt="*", **style)
        for _, rows in [] if ceiling is None else ceiling.groupby("start_week"):
            gain = rows[f"gain_{measure}"]
            axes.plot(rows["week"], gain, ":", color=MUTED_COLOUR)
            if len(rows) == 1:  # a line through one point is invisible
                begin, end = rows["week"].iloc[0] + ONE_WEEK
                axes.hlines(gain, begin, end, colors=MUTED_COLOUR, linestyles=":")
        axes.axhline(0, color=MUTED_COLOUR, linewidth=0.8)
        axes.set_title(VERTEX_MAPS[measure].label)
        week_axis(axes, validation["week"])
    panels[0].set_ylabel("gain in r over the scaled start")
    extra: list[Artist] = [star("headroom: observed brain of the week before", markersize=6)]
    if ceiling is not None and len(ceiling):
        extra.append(Line2D([], [], color=MUTED_COLOUR, linestyle=":", label="registration alone"))
    run_legend(figure, colours, extra=extra)
    return figure


def _gain_line(axes: Axes, x: pd.Series, rows: pd.DataFrame, measure: str, colour: Any) -> None:
    """Draw a gain with its interval; filled marks are explained weeks, open ones predicted."""
    gain = rows[f"gain_{measure}"]
    axes.errorbar(x, gain, yerr=_bars(rows, "gain", measure), color=colour, linewidth=1.0, elinewidth=0.7)
    for kind, face in (("explained", colour), ("predicted", "white")):
        if (selected := rows["kind"] == kind).any():
            axes.plot(x[selected], gain[selected], "o", color=colour, markerfacecolor=face)


def _bars(rows: pd.DataFrame, name: str, measure: str) -> Any:
    """Return the (2, n) lengths of error bars below and above values, to the ends of their intervals."""
    value, low, high = (rows[f"{part}_{measure}"] for part in (name, f"{name}_low", f"{name}_high"))
    return np.stack([value - low, high - value]).clip(min=0)


@styled
def onset_chart(onset: pd.DataFrame, *, runs: Sequence[str] = ()) -> Figure:
    """Draw a row for each sulcus that observed brains do not have at the start, with the weeks when it begins.

    A cross at the right edge means never. If there are several start brains, their names follow those of the sulci.
    `onset` has the columns run ("real" for observed brains), subject, region, there_at_start, onset_week.
    """
    several = len(onset["subject"].unique()) > 1
    table = onset.assign(row=onset["region"] + (" · " + onset["subject"] if several else ""))
    table = table[~table["there_at_start"].astype(bool)]
    late = table[table["run"] == MEASURED].drop_duplicates("row").sort_values("onset_week", ascending=False)
    places = {name: place for place, name in enumerate(late["row"])}
    drawn = table[table["row"].isin(places)]
    weeks = drawn["onset_week"].dropna()
    if not len(weeks):
        figure = Figure(figsize=(FULL_WIDTH_IN, 0.4), layout="constrained")
        figure.text(0.0, 0.5, "No sulcus begins after the start.", va="center")
        return figure
    height_in = 1.2 + ROW_IN * max(len(places), 2)
    figure = Figure(figsize=(FULL_WIDTH_IN, height_in), layout="constrained")
    axes = figure.subplots()
    colours = run_colours(onset["run"], runs)
    beyond = np.ceil(weeks.max() + 0.5)
    for number, (run, colour) in enumerate({MEASURED: OBSERVED_COLOUR, **colours}.items()):
        rows = drawn[drawn["run"] == run].drop_duplicates("row")
        # runs side by side, the observed brains in the middle
        shift = 0 if run == MEASURED else 0.5 * ((number - 0.5) / len(colours) - 0.5)
        heights = rows["row"].map(places) + shift
        begins = rows["onset_week"].notna()
        marker, size = ("*" if run == MEASURED else "o"), (6 if shift == 0 else 4)
        axes.plot(rows.loc[begins, "onset_week"], heights[begins], marker, color=colour, markersize=size)
        axes.plot(np.full((~begins).sum(), beyond), heights[~begins], "x", color=colour, markersize=4)
    axes.set_yticks(list(places.values()), list(places))
    axes.set_ylim(-0.6, max(len(places), 1) - 0.4)
    week_axis(axes, [weeks.min(), beyond])
    whole = np.arange(np.ceil(weeks.min()), beyond)
    axes.set_xticks([*whole, beyond], [*(f"{week:g}" for week in whole), "never"])
    axes.grid(visible=True, axis="both")
    run_legend(figure, colours, observed_name="observed brains")
    return figure


@styled
def nearest_chart(
    comparison: pd.DataFrame,
    *,
    varied: str,
    subject: str,
    observed: Sequence[str],
    week: float,
    published: Mapping[str, Any] | None = None,
) -> Figure:
    """Draw the distance of the runs of a sweep from the observed brain, over the varied parameter: a panel per measure.

    Panels show the whole brain or both hemispheres; the nearest run has a ring and its value.

    `comparison` has the columns subject, observed, hemisphere, measure, distance, unit, flag, resolution, and `varied`
    with the parameter's values. If the flag or the resolution is not "ok", a distance is not reliable and its mark is
    open. `subject` is the start brain, `observed` are the brains that it is compared with, at a `week`. The rows
    `nearest` of `published` have parameter, week, measure, and the nearest value, drawn as a dashed line. InputError if
    there is no distance.
    """
    rows = comparison[(comparison["subject"] == subject) & comparison["observed"].isin(observed)].dropna(
        subset="distance"
    )
    if rows.empty:
        raise InputError("no distance to an observed brain", found=f"{len(comparison)} rows")
    rows = rows.assign(at=rows[varied], trusted=(rows["resolution"] == "ok") & (rows["flag"] == "ok"))
    lines = {
        row["measure"]: row["value"]
        for row in (published or {"nearest": []})["nearest"]
        if (row["parameter"], row["week"]) == (varied, week)
    }
    measures = list(dict.fromkeys(rows["measure"]))
    figure, panels = panel_figure(len(measures), panel_in=2.1)
    drawn: set[str] = set()
    for number, (axes, measure) in enumerate(zip(panels, measures, strict=True)):
        here = rows[rows["measure"] == measure]
        sides = ["whole"] if (here["hemisphere"] == "whole").any() else list(SIDES)
        drawn |= set(sides)
        for side in sides:
            _nearest_line(axes, here[here["hemisphere"] == side].sort_values("at"), *SIDE_STYLES[side])
        axes.margins(y=0.25)
        # a band cut at Weyl's number is the same measure
        if (value := lines.get(measure.removesuffix("_weyl"))) is not None:
            axes.axvline(value, color=MUTED_COLOUR, linestyle="--", linewidth=0.9)
        # distances of sizes are relative to the observed brain
        unit = "share of the observed" if measure in metrics_shown(Shown.SIZE) else here["unit"].iloc[0]
        axes.set_title(wrap(with_unit(plain(measure), unit), 30), fontsize=7.5)
        axes.set_xlabel(parameter_label(varied))
        if number % 3 == 0:
            axes.set_ylabel("distance from the observed brain")
    handles: list[Artist] = [
        Line2D([], [], color=colour, marker=marker, markersize=4.5, label=SIDE_NAMES[side])
        for side, (marker, colour) in SIDE_STYLES.items()
        if side in drawn
    ]
    ring: dict[str, Any] = {"color": MUTED_COLOUR, "linestyle": "none", "marker": "o"}
    handles.append(Line2D([], [], markersize=9, markerfacecolor="none", label="nearest", **ring))
    if not rows["trusted"].all():
        label = "cut off, or not resolved"
        handles.append(Line2D([], [], markersize=4.5, markerfacecolor="white", label=label, **ring))
    if lines:
        handles.append(Line2D([], [], color=MUTED_COLOUR, linestyle="--", label="nearest in the publication"))
    run_legend(figure, {}, extra=handles)
    return figure


def _nearest_line(axes: Axes, rows: pd.DataFrame, marker: str, colour: str) -> None:
    if rows.empty:
        return
    axes.plot(rows["at"], rows["distance"], color=colour, linewidth=1.0)
    for trusted, part in rows.groupby("trusted"):
        style: dict[str, Any] = {"markerfacecolor": colour if trusted else "white", "markersize": 4.5}
        axes.plot(part["at"], part["distance"], marker, color=colour, **style)
    sound = rows[rows["trusted"]]
    best = (sound if len(sound) else rows).sort_values("distance").iloc[0]
    place = best["at"], best["distance"]
    axes.plot(*place, "o", markersize=11, markerfacecolor="none", color=colour, markeredgewidth=1.0)
    below: dict[str, Any] = {"xytext": (0, -8), "textcoords": "offset points", "ha": "center", "va": "top"}
    axes.annotate(f"{best['at']:g}", place, fontsize=7, color=colour, **below)


@styled
def calibration_chart(runs: pd.DataFrame, optimum: pd.DataFrame, *, score: Sequence[str]) -> Figure:
    """Draw a panel for each parameter, with the scores of the runs and the optimum.

    `runs` has the columns of the parameters, round, score (NaN: diverged); `optimum` parameter, value. `score` are the
    terms of the score.
    """
    figure, panels = panel_figure(len(optimum), per_row=len(optimum), panel_in=2.0)
    finished, diverged = runs[runs["score"].notna()], runs[runs["score"].isna()]
    # later rounds are darker
    shades = dict(zip(sorted(set(runs["round"])), np.linspace(0.75, 0, runs["round"].nunique()), strict=True))
    for axes, name, value in zip(panels, optimum["parameter"], optimum["value"], strict=True):
        axes.axvline(value, color=RUN_COLOURS[1], linestyle="--", label="optimum")
        for number, shade in shades.items():
            rows = finished[finished["round"] == number]
            style: dict[str, Any] = {"color": str(shade), "markeredgecolor": "black", "markeredgewidth": 0.4}
            axes.plot(rows[name], rows["score"], "o", label=f"round {number}", **style)
        if len(diverged):
            top = np.full(len(diverged), float(finished["score"].max()))
            axes.plot(diverged[name], top, "x", color=MUTED_COLOUR, label="diverged")
        axes.set_xlabel(parameter_label(name))
    panels[0].set_ylabel(f"score: {plain(' + '.join(score))}")
    figure.legend(handles=panels[0].get_legend_handles_labels()[0], loc="outside lower center", ncols=5)
    return figure
