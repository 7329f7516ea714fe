"""Charts of simulations compared with observed brains: gain, sweeps, calibrations."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..errors import InputError
from ..grouping import counted
from ..quantities import COMPARED_MAPS, VERTEX_MAPS, Shown, metrics_shown
from ..settings.terms import SIDES
from .labels import parameter_label, plain, with_unit
from .style import (
    MUTED_COLOUR,
    RUN_COLOURS,
    entry,
    legend_below,
    panel_figure,
    run_colours,
    run_entries,
    styled,
    week_axis,
    wrap,
)

SIDE_STYLES = {
    "whole": ("o", RUN_COLOURS[0]),
    "left": ("<", RUN_COLOURS[0]),
    "right": (">", RUN_COLOURS[1]),
}
SIDE_NAMES = {
    "whole": "whole brain",
    "left": "left hemisphere",
    "right": "right hemisphere",
}


@styled
def validation_figure(
    validation: pd.DataFrame,
    *,
    runs: Sequence[str] = (),
) -> Figure:
    """Draw by week how much better a run's shape index and mean curvature correlate
    with the observed brain's than the scaled start's.

    Bars are 95 % intervals of the bootstrap; filled marks are explained weeks, open
    ones predicted.

    `validation` has the columns run, start (the start brain), week, kind, and gain_…,
    gain_low_… and gain_high_… of each of `COMPARED_MAPS`.
    """
    colours = run_colours(validation["run"], runs)
    simulations = validation.groupby(["run", "start"], sort=False)
    figure, panels = panel_figure(
        len(COMPARED_MAPS),
        per_row=2,
        panel_in=2.5,
    )
    for axes, measure in zip(panels, COMPARED_MAPS, strict=True):
        for number, ((run, _), rows) in enumerate(simulations):
            rows = rows.sort_values("week")
            # side by side, so that their bars do not hide each other
            shift_gw = 0.03 * (number - (simulations.ngroups - 1) / 2)
            rows = rows.assign(at=rows["week"] + shift_gw)
            _gain_line(axes, rows, measure, colours[str(run)])
        axes.axhline(0, color=MUTED_COLOUR, linewidth=0.8)
        axes.set_title(VERTEX_MAPS[measure].label)
        week_axis(axes, validation["week"])
    panels[0].set_ylabel("gain in r over the scaled start")
    legend_below(figure, run_entries(colours))
    return figure


def _gain_line(
    axes: Axes,
    rows: pd.DataFrame,
    measure: str,
    colour: Any,
) -> None:
    """Draw a gain with its interval at the places `at`; filled marks are explained
    weeks, open ones predicted."""
    gain = rows[f"gain_{measure}"]
    below = gain - rows[f"gain_low_{measure}"]
    above = rows[f"gain_high_{measure}"] - gain
    lengths = np.stack([below, above]).clip(min=0)
    axes.errorbar(
        rows["at"],
        gain,
        yerr=lengths,
        color=colour,
        linewidth=1.0,
        elinewidth=0.7,
    )
    for kind, part in rows.groupby("kind"):
        face = colour if kind == "explained" else "white"
        marks = part["at"], part[gain.name]
        axes.plot(*marks, "o", color=colour, markerfacecolor=face)


@styled
def nearest_figure(
    comparison: pd.DataFrame,
    *,
    varied: str,
    subject: str,
    observed: Sequence[str],
    week: float,
    published: Mapping[str, Any] | None = None,
) -> Figure:
    """Draw the distance of the runs of a sweep from the observed brain, over the varied
    parameter: a panel per measure.

    Panels show the whole brain or both hemispheres; the nearest run has a ring and its
    value.

    `comparison` has the columns subject, observed, hemisphere, measure, distance, unit,
    flag, resolution, and `varied` with the parameter's values. If the flag or the
    resolution is not "ok", a distance is not reliable and its mark is open. `subject`
    is the start brain, `observed` are the brains that it is compared with, at a `week`.
    The rows `nearest` of `published` have parameter, week, measure, and the nearest
    value, drawn as a dashed line. InputError if there is no distance.
    """
    is_own = comparison["subject"] == subject
    rows = comparison[is_own & comparison["observed"].isin(observed)]
    rows = rows.dropna(subset="distance")
    if rows.empty:
        raise InputError(
            "no distance to an observed brain", found=counted(len(comparison), "row")
        )
    trusted = (rows["resolution"] == "ok") & (rows["flag"] == "ok")
    rows = rows.assign(at=rows[varied], trusted=trusted)
    lines = {}
    for row in published["nearest"] if published else []:
        if (row["parameter"], row["week"]) == (varied, week):
            lines[row["measure"]] = row["value"]
    measures = list(dict.fromkeys(rows["measure"]))
    figure, panels = panel_figure(len(measures), panel_in=2.1)
    drawn: set[str] = set()
    for number, (axes, measure) in enumerate(
        zip(
            panels,
            measures,
            strict=True,
        )
    ):
        here = rows[rows["measure"] == measure]
        sides = ["whole"] if (here["hemisphere"] == "whole").any() else list(SIDES)
        drawn |= set(sides)
        for side in sides:
            own = here[here["hemisphere"] == side].sort_values("at")
            _nearest_line(axes, own, *SIDE_STYLES[side])
        axes.margins(y=0.25)
        # a band cut at Weyl's number is the same measure
        if (value := lines.get(measure.removesuffix("_weyl"))) is not None:
            axes.axvline(value, color=MUTED_COLOUR, linestyle="--", linewidth=0.9)
        # distances of sizes are relative to the observed brain
        unit = (
            "share of the observed"
            if measure in metrics_shown(Shown.SIZE)
            else here["unit"].iloc[0]
        )
        title = with_unit(plain(measure), unit)
        axes.set_title(wrap(title, 30), fontsize=7.5)
        axes.set_xlabel(parameter_label(varied))
        if number % 3 == 0:
            axes.set_ylabel("distance from the observed brain")
    handles = [
        entry(SIDE_NAMES[side], colour, marker=marker, markersize=4.5)
        for side, (marker, colour) in SIDE_STYLES.items()
        if side in drawn
    ]
    ring: dict[str, Any] = {"linestyle": "none", "marker": "o"}
    handles.append(
        entry(
            "nearest",
            markersize=9,
            markerfacecolor="none",
            **ring,
        )
    )
    if not rows["trusted"].all():
        label = "cut off, or not resolved"
        handles.append(
            entry(
                label,
                markersize=4.5,
                markerfacecolor="white",
                **ring,
            )
        )
    if lines:
        handles.append(entry("nearest in the publication", linestyle="--"))
    legend_below(figure, handles)
    return figure


paper_nearest_figure = nearest_figure
"""Of a rule with the values of the paper as `published`."""


def _nearest_line(
    axes: Axes,
    rows: pd.DataFrame,
    marker: str,
    colour: str,
) -> None:
    if rows.empty:
        return
    axes.plot(
        rows["at"],
        rows["distance"],
        color=colour,
        linewidth=1.0,
    )
    for trusted, part in rows.groupby("trusted"):
        axes.plot(
            part["at"],
            part["distance"],
            marker,
            color=colour,
            markerfacecolor=colour if trusted else "white",
            markersize=4.5,
        )
    # those that are trusted first
    best = rows.sort_values(
        ["trusted", "distance"],
        ascending=[False, True],
    ).iloc[0]
    place = best["at"], best["distance"]
    axes.plot(
        *place,
        "o",
        color=colour,
        markersize=11,
        markerfacecolor="none",
        markeredgewidth=1.0,
    )
    axes.annotate(
        f"{best['at']:g}",
        place,
        xytext=(0, -8),
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize=7,
        color=colour,
    )


@styled
def calibration_figure(
    runs: pd.DataFrame,
    optimum: pd.DataFrame,
    *,
    score: Sequence[str],
) -> Figure:
    """Draw a panel for each parameter, with the scores of the runs and the optimum.

    `runs` has the columns of the parameters, round, score (NaN: diverged); `optimum`
    parameter, value. `score` are the terms of the score.
    """
    figure, panels = panel_figure(
        len(optimum),
        per_row=len(optimum),
        panel_in=2.0,
    )
    diverged = runs[runs["score"].isna()]
    # later rounds are darker
    rounds = sorted(set(runs["round"]))
    shades = np.linspace(0.75, 0, len(rounds))
    for axes, name, value in zip(
        panels, optimum["parameter"], optimum["value"], strict=True
    ):
        axes.axvline(
            value,
            color=RUN_COLOURS[1],
            linestyle="--",
            label="optimum",
        )
        for number, shade in zip(rounds, shades, strict=True):
            rows = runs[runs["round"] == number].dropna(subset="score")
            axes.plot(
                rows[name],
                rows["score"],
                "o",
                color=str(shade),
                markeredgecolor="black",
                markeredgewidth=0.4,
                label=f"round {number}",
            )
        if len(diverged):
            worst = np.full(
                len(diverged),
                runs["score"].max(),
            )
            axes.plot(
                diverged[name],
                worst,
                "x",
                color=MUTED_COLOUR,
                label="diverged",
            )
        axes.set_xlabel(parameter_label(name))
    panels[0].set_ylabel(f"score: {plain(' + '.join(score))}")
    figure.legend(
        handles=panels[0].get_legend_handles_labels()[0],
        loc="outside lower center",
        ncols=5,
    )
    return figure
