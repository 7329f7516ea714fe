"""How a parameter that is varied changes the folds: pictures, maps and spectra at one week, and what comes nearest."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..errors import InputError
from ..parameters.measures import SHAPE_MEASURES
from ..parameters.terms import SIDES
from .panels import Panel, Row, panel_grid
from .renders import SurfaceMap
from .scene import MAP, colour_scale, named_views, paint, uniform_colours
from .spectra import spectra_chart
from .style import (
    FULL_WIDTH_IN,
    MEASURED,
    MUTED_COLOUR,
    PHANTOM,
    REAL_BRAIN,
    REAL_SURFACE_COLOUR,
    RUN_COLOURS,
    SIMULATED_SURFACE_COLOUR,
    add_letters,
    light_grid,
    new_figure,
    shown_unit,
    styled,
    wrap,
)

ABSENT = "ended\nbefore\nthis week"
"""What stands in the place of a member of a study that has not come to the week."""
HEMISPHERE_MARKERS = {"whole": "o", "left": "<", "right": ">"}
_COLUMNS = 3
_SIZES = ("area", "volume", "gyrification_index")
_UNITS = {"_mm_per_gw": "mm/GW", "_per_s": "s⁻¹", "_pa_per_m": "Pa/m", "_mm": "mm", "_pa": "Pa", "_gw": "GW", "_s": "s"}
_NAMES = {
    "thickness": "cortical thickness",
    "shear_modulus_cortex": "shear modulus of the cortex",
    "shear_modulus_core": "shear modulus of the core",
}


@styled
def influence_picture(
    members: Mapping[str, SurfaceMap | None],
    real: SurfaceMap | None = None,
    *,
    views: Sequence[str] = ("left", "top"),
    quantity: str = "shape_index",
    measured: str = PHANTOM,
    synthetic: bool = False,
) -> Figure:
    """Returns the surfaces of the members of a study at one week above their maps of a shape measure on one scale.

    Parameters
    ----------
    members : {label of the parameter's value: (surface in RAS+ mm, values at its vertices)}
        In the order of the study; None for a member that has not come to the week.
    real
        The measured brain of the week, shown last.
    measured
        What it is called.
    """
    known: dict[str, SurfaceMap | None] = {**members} | ({measured: real} if real is not None else {})
    measure = SHAPE_MEASURES[quantity]
    if measure.limits is None:
        raise InputError("a measure without limits has no scale of its own", found=quantity)
    scale = colour_scale(measure.colours, *measure.limits)
    rows = []
    for view in named_views(views):
        panels = [
            None
            if found is None
            else Panel(found[0], uniform_colours(found[0], _surface_colour(name, measured, real)), view)
            for name, found in known.items()
        ]
        rows.append(Row(f"{view.name} view", panels, absent=ABSENT))
    for view in named_views(views):
        panels = [
            None if found is None else Panel(found[0], paint(found[1], scale), view, material=MAP)
            for found in known.values()
        ]
        rows.append(Row(f"{quantity.replace('_', ' ')}\n{view.name} view", panels, absent=ABSENT))
    return panel_grid(list(known), rows, synthetic=synthetic, measured=measured, colour_bars=[(scale, measure.label)])


def _surface_colour(name: str, measured: str, real: SurfaceMap | None) -> str:
    return REAL_SURFACE_COLOUR if real is not None and name == measured else SIMULATED_SURFACE_COLOUR


@styled
def influence_spectra(
    spectra: pd.DataFrame,
    labels: Mapping[str, str],
    *,
    week: float,
    measured: str = REAL_BRAIN,
    synthetic: bool = False,
) -> Figure:
    """Returns the relative power in B4 to B6 of the members of a study at one week, beside the measured brain's.

    Colours go from pale to dark in the order of the values.

    Parameters
    ----------
    spectra : as for `spectra_chart`
    labels : {run: label of its value}, in the order of the study
    """
    members = spectra[spectra["run"].isin([*labels, MEASURED])]
    named = members.assign(run=[labels.get(run, run) for run in members["run"]])
    shades = mpl.colormaps["YlGnBu"](np.linspace(0.3, 0.95, max(len(labels), 2)))
    colours = dict(zip(labels.values(), shades, strict=False))
    return spectra_chart(named, week=week, colours=colours, measured=measured, synthetic=synthetic)


@styled
def nearest_chart(
    comparison: pd.DataFrame,
    *,
    varied: str,
    parameter: str,
    published: Mapping[str, float] | None = None,
    synthetic: bool = False,
) -> Figure:
    """Returns by each measure how far the members of a study are from the measured brain, over the varied parameter.

    Each measure has its panel, with the whole brain or both hemispheres; the nearest member is filled and named.

    Parameters
    ----------
    comparison : columns hemisphere, measure, distance, unit, flag, and one with the values of the parameter
        `flag` is "ok", or says why a distance is not to be trusted: such are open.
    varied
        Name of the column with the parameter's values.
    parameter
        Its name and unit, for example "cortical thickness (mm)".
    published : {measure: value that a publication found nearest}
        Drawn as a dashed line.

    Raises
    ------
    InputError
        If no distance is known.
    """
    rows = comparison[comparison["distance"].notna()]
    rows = rows.assign(at=rows[varied])
    measures = list(dict.fromkeys(rows["measure"]))
    if not measures:
        raise InputError("no distance to a measured brain is known", found=f"{len(comparison)} rows")
    columns = min(_COLUMNS, len(measures))
    lines = -(-len(measures) // columns)
    figure = new_figure(FULL_WIDTH_IN * max(columns, 2) / _COLUMNS, 0.7 + 2.1 * lines, synthetic=synthetic)
    grid = figure.subplots(lines, columns, squeeze=False)
    drawn: set[str] = set()
    for axes, measure in zip(grid.flat, measures, strict=False):
        own = rows[rows["measure"] == measure]
        sides = ["whole"] if (own["hemisphere"] == "whole").any() else list(SIDES)
        drawn |= set(sides)
        _nearest_panel(axes, own, sides)
        if published and measure in published:
            axes.axvline(published[measure], color=MUTED_COLOUR, linestyle="--", linewidth=0.9)
        axes.set_title(wrap(_titled(measure, own), 30), fontsize=7.5)
        axes.set_xlabel(parameter)
        light_grid(axes)
    for axes in grid.flat[len(measures) :]:
        axes.remove()
    for line in grid:
        line[0].set_ylabel("distance from the real brain")
    add_letters(grid.flat[: len(measures)])
    figure.legend(
        handles=_nearest_legend(drawn, bool(published), bool((rows["flag"] != "ok").any())),
        loc="outside lower center",
        ncols=3,
    )
    return figure


def _titled(measure: str, rows: pd.DataFrame) -> str:
    """Returns the name of a measure with the unit of its distances: those of sizes are parts of the real brain's."""
    unit = "share of the real" if measure in _SIZES else shown_unit(rows["unit"].iloc[0] if "unit" in rows else "")
    return measure.replace("_", " ") + (f" ({unit})" if unit else "")


def _nearest_panel(axes: Axes, rows: pd.DataFrame, sides: Sequence[str]) -> None:
    for side, colour in zip(sides, (RUN_COLOURS[0], RUN_COLOURS[1]), strict=False):
        own = rows[rows["hemisphere"] == side].sort_values("at")
        if own.empty:
            continue
        axes.plot(own["at"], own["distance"], color=colour, linewidth=1.0)
        for (_, row), face in zip(own.iterrows(), _faces(own, colour), strict=True):
            look: dict[str, Any] = {"color": colour, "markerfacecolor": face, "markersize": 4.5}
            axes.plot(row["at"], row["distance"], HEMISPHERE_MARKERS[side], **look)
        trusted = own[own["flag"] == "ok"]
        best = (trusted if len(trusted) else own).sort_values("distance").iloc[0]
        axes.plot(
            best["at"],
            best["distance"],
            "o",
            markersize=11,
            markerfacecolor="none",
            color=colour,
            markeredgewidth=1.0,
        )
        axes.annotate(
            f"{best['at']:g}",
            (best["at"], best["distance"]),
            xytext=(0, -8),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=7,
            color=colour,
        )
    axes.margins(y=0.25)


def _faces(rows: pd.DataFrame, colour: str) -> list[str]:
    return [colour if flag == "ok" else "white" for flag in rows["flag"]]


def _nearest_legend(drawn: set[str], published: bool, untrusted: bool) -> list[Artist]:
    named = {"whole": ("whole brain", RUN_COLOURS[0]), "left": ("left hemisphere", RUN_COLOURS[0])}
    named |= {"right": ("right hemisphere", RUN_COLOURS[1])}
    handles: list[Artist] = [
        Line2D([], [], color=colour, marker=HEMISPHERE_MARKERS[side], markersize=4.5, label=label)
        for side, (label, colour) in named.items()
        if side in drawn
    ]
    ring: dict[str, Any] = {"color": MUTED_COLOUR, "linestyle": "none", "marker": "o", "markerfacecolor": "none"}
    handles.append(Line2D([], [], markersize=9, label="nearest", **ring))
    if untrusted:
        handles.append(
            Line2D([], [], markersize=4.5, label="cut off, or not resolved", **ring | {"markerfacecolor": "white"})
        )
    if published:
        handles.append(Line2D([], [], color=MUTED_COLOUR, linestyle="--", label="nearest in the publication"))
    return handles


def parameter_label(key: str) -> str:
    """Returns what a key of the folding is called on an axis, with its unit, for example "cortical thickness (mm)"."""
    name, unit = key.rpartition(".")[2], ""
    for ending, shown in _UNITS.items():
        if name.endswith(ending):
            name, unit = name.removesuffix(ending), f" ({shown})"
            break
    return _NAMES.get(name, name.replace("_", " ")) + unit


def value_labels(values: Sequence[Mapping[str, Any]]) -> list[str]:
    """Returns a heading for each member of a study: its values with their units, for example "1.5 mm".

    Where several keys are varied, each is named.
    """
    labels = []
    for member in values:
        parts = []
        for key, value in member.items():
            name, _, unit = parameter_label(key).partition(" (")
            text = f"{value:g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)
            text += f" {unit.removesuffix(')')}" if unit else ""
            parts.append(text if len(member) == 1 and unit else f"{name} {text}")
        labels.append("\n".join(parts))
    return labels
