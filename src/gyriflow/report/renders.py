"""Pictures of brains: simulated beside measured ones, displacement and shape."""

from collections.abc import Hashable, Mapping, Sequence

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ..errors import InputError
from ..geometry.triangles import Floats, TriangleMesh
from ..parameters.measures import SHAPE_MEASURES
from .panels import Panel, Row, panel_grid
from .scene import MAP, UNKNOWN_COLOUR, View, colour_scale, named_views, paint, uniform_colours
from .style import (
    MAGNITUDES,
    NEUTRAL_COLOUR,
    PHANTOM,
    REAL_BRAIN,
    REAL_SURFACE_COLOUR,
    SIMULATED_SURFACE_COLOUR,
    column_label,
    styled,
)

SurfaceMap = tuple[TriangleMesh, Floats]
"""A surface in RAS+ mm and a value per vertex."""

SIDE_VIEWS = ("left", "top")
DISPLACEMENT_VIEWS = ("left", "top", "back")
PRESSURE_COLOURS = "YlOrRd"
SIGNED = "RdBu_r"
ROUNDING = 1e-9
_MOST = 0.995
"""Part of the vertices that a colour scale reaches."""


def _ordered(*groups: Mapping) -> list:
    """Returns the keys of all groups, weeks and intervals in order, names as they come."""
    keys = list(dict.fromkeys(key for group in groups for key in group))
    return keys if any(isinstance(key, str) for key in keys) else sorted(keys)


@styled
def runs_by_week(
    runs: Mapping[str, Mapping[float, TriangleMesh]],
    real: Mapping[float, TriangleMesh],
    *,
    views: Sequence[str] = SIDE_VIEWS,
    measured: str = REAL_BRAIN,
    synthetic: bool = False,
) -> Figure:
    """Returns the brains of several runs (blue) above measured ones (beige), a column per week, their rows by view.

    Parameters
    ----------
    runs : {run: {week: surface in RAS+ mm}}
    real : {week: surface in RAS+ mm}
        A week that one of them lacks leaves its place empty.
    views
        Names of `scene.VIEWS`.
    measured
        What the measured brains are called.
    """
    groups = {name: (meshes, SIMULATED_SURFACE_COLOUR) for name, meshes in runs.items()}
    groups |= {measured: (real, REAL_SURFACE_COLOUR)}
    return _surface_rows(groups, views=views, synthetic=synthetic, measured=measured)


@styled
def runs_comparison(
    runs: Mapping[str, TriangleMesh],
    real: TriangleMesh | None = None,
    *,
    views: Sequence[str] = SIDE_VIEWS,
    measured: str = REAL_BRAIN,
    synthetic: bool = False,
) -> Figure:
    """Returns the brains of several runs at one week side by side (blue), the measured one last (beige).

    Parameters
    ----------
    runs : {run: surface in RAS+ mm}
    """
    columns = [*runs, measured] if real is not None else list(runs)
    rows = []
    for view in named_views(views):
        panels = [Panel(mesh, uniform_colours(mesh, SIMULATED_SURFACE_COLOUR), view) for mesh in runs.values()]
        if real is not None:
            panels.append(Panel(real, uniform_colours(real, REAL_SURFACE_COLOUR), view))
        rows.append(Row(f"{view.name} view", panels))
    return panel_grid(columns, rows, synthetic=synthetic, measured=measured)


@styled
def brains_picture(
    brains: Mapping[str, TriangleMesh], *, views: Sequence[str] = ("left", "top", "bottom"), synthetic: bool = False
) -> Figure:
    """Returns measured brains side by side, a row per view.

    Parameters
    ----------
    brains : {heading: surface in RAS+ mm}
    """
    rows = [
        Row(
            f"{view.name} view",
            [Panel(mesh, uniform_colours(mesh, REAL_SURFACE_COLOUR), view) for mesh in brains.values()],
        )
        for view in named_views(views)
    ]
    return panel_grid(list(brains), rows, synthetic=synthetic)


def _surface_rows(
    groups: Mapping[str, tuple[Mapping[float, TriangleMesh], str]],
    *,
    views: Sequence[str],
    synthetic: bool,
    measured: str,
) -> Figure:
    keys = _ordered(*(meshes for meshes, _ in groups.values()))
    rows = [
        Row(
            f"{name}\n{view.name} view",
            [Panel(meshes[key], uniform_colours(meshes[key], colour), view) if key in meshes else None for key in keys],
        )
        for view in named_views(views)
        for name, (meshes, colour) in groups.items()
        if meshes
    ]
    return panel_grid([column_label(key) for key in keys], rows, synthetic=synthetic, measured=measured)


@styled
def displacement_maps(
    displacements: Mapping[tuple[float, float], SurfaceMap],
    *,
    views: Sequence[str] = DISPLACEMENT_VIEWS,
    synthetic: bool = False,
) -> Figure:
    """Returns the norm of the displacement on the pial surface, a column per interval, on one colour scale.

    The scale ends where one vertex in two hundred is above, so that a single maximum does not set it. The maximum is
    ringed, dotted where it lies on the side turned away; below each interval stand its size, its place in RAS+ mm, and
    the mean over the vertices.

    Parameters
    ----------
    displacements : {(from_week, to_week): (surface, norms in mm)}
    """
    keys = _ordered(displacements)
    scale = magnitude_scale(np.concatenate([norms for _, norms in displacements.values()]), MAGNITUDES)
    seen = named_views(views)
    rows = []
    for view in seen:
        panels = []
        for key in keys:
            mesh, norms = displacements[key]
            place = mesh.vertices[int(np.nanargmax(norms))]
            where = ", ".join(f"{value:z.0f}" for value in place).replace("-", "−")
            caption = f"max {np.nanmax(norms):.2f} mm at {where}\nmean {np.nanmean(norms):.2f} mm"
            shown = caption if view == seen[-1] else ""
            panels.append(Panel(mesh, paint(norms, scale), view, shown, MAP, place))
        rows.append(Row(f"{view.name} view", panels))
    return panel_grid(
        [column_label(key) for key in keys],
        rows,
        synthetic=synthetic,
        colour_bars=[(scale, "norm of the displacement (mm)")],
    )


def magnitude_scale(values: Floats, colours: str) -> ScalarMappable:
    """Returns a scale from zero to a round value that at most a few of the values pass, so that no outlier sets it."""
    known = values[np.isfinite(values)]
    high = float(np.quantile(known, _MOST)) if len(known) else 1.0
    end = round_up(high) if high > 0 else 1.0
    return colour_scale(colours, 0.0, end, cut=bool((known > end).any()))


def signed_scale(values: Floats) -> ScalarMappable:
    """Returns a scale that is pale at zero and as wide on both sides, for values of which some are below zero."""
    known = np.abs(values[np.isfinite(values)])
    end = round_up(float(np.quantile(known, _MOST)))
    return colour_scale(SIGNED, -end, end, cut=bool((known > end).any()))


def goes_below_zero(values: Floats) -> bool:
    """Returns whether values go below zero by more than rounding."""
    return bool(np.nanmin(values) < -ROUNDING * np.nanmax(np.abs(values)))


def round_up(value: float) -> float:
    """Returns a positive value rounded up to two digits, so that a colour bar ends at a number one can say."""
    step = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(np.ceil(value / step - 1e-9) * step)


PRESSURES = {
    "contact_pressure_pa": "contact pressure (Pa)",
    "contact_pressure_pa_per_gw": "contact pressure built up in a week (Pa/GW)",
}
LABELS = {name: measure.label for name, measure in SHAPE_MEASURES.items()} | PRESSURES
"""The quantities that can be drawn as maps, with the labels of their colour bars."""


def scale_of(quantity: str, values: Floats) -> ScalarMappable:
    """Returns the colour scale of a quantity: its own limits, else from zero to where few vertices are above."""
    if quantity in PRESSURES:
        return magnitude_scale(values[values > 0], PRESSURE_COLOURS)
    measure = SHAPE_MEASURES[quantity]
    if measure.limits is not None:
        return colour_scale(measure.colours, *measure.limits)
    return magnitude_scale(values, measure.colours)


@styled
def scalar_maps(
    maps: Mapping[str, Mapping[Hashable, SurfaceMap]],
    *,
    quantity: str,
    views: Sequence[str] = SIDE_VIEWS,
    measured: str = PHANTOM,
    synthetic: bool = False,
) -> Figure:
    """Returns a shape measure on surfaces: a row per group and view, a column per week or run, one colour scale.

    Parameters
    ----------
    maps : {group: {week or run: (surface, values)}}
        For example {"simulated": {28.0: …}, "real brain": {28.0: …}}.
    quantity
        A name of `SHAPE_MEASURES`, or one of `PRESSURES`, which leave the surface grey where nothing touches.
    measured
        What the measured brains are called, where there are any.

    Raises
    ------
    InputError
        For another quantity or an unknown view.
    """
    if quantity not in LABELS:
        raise InputError("unknown quantity", found=quantity, expected=list(LABELS))
    values = np.concatenate([values for group in maps.values() for _, values in group.values()])
    scale, label = scale_of(quantity, values), LABELS[quantity]
    keys = _ordered(*maps.values())
    rows = [
        Row(
            f"{group}\n{view.name} view",
            [_map_panel(*known[key], scale, view, quantity) if key in known else None for key in keys],
        )
        for view in named_views(views)
        for group, known in maps.items()
    ]
    legend = [Patch(color=NEUTRAL_COLOUR, label="no contact")] if quantity in PRESSURES else []
    if not np.isfinite(values).all():
        legend.append(Patch(color=UNKNOWN_COLOUR, label="not measured"))
    return panel_grid(
        [column_label(key) for key in keys],
        rows,
        synthetic=synthetic,
        measured=measured,
        colour_bars=[(scale, label)],
        legend=legend,
    )


def _map_panel(mesh: TriangleMesh, values: Floats, scale: ScalarMappable, view: View, quantity: str) -> Panel:
    return Panel(mesh, paint(values, scale, zero_is_nothing=quantity in PRESSURES), view, material=MAP)
