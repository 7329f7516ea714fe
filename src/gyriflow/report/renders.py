"""Pictures of brains: simulated beside measured ones, displacement and shape."""

from collections.abc import Hashable, Mapping, Sequence

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from ..errors import InputError
from ..geometry.triangles import Floats, TriangleMesh
from ..parameters.measures import SHAPE_MEASURES
from .panels import Panel, Row, panel_grid
from .scene import colour_scale, named_views, painted, uniform_colours
from .style import (
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


def _ordered(*groups: Mapping) -> list:
    """Returns the keys of all groups, weeks and intervals in order, names as they come."""
    keys = list(dict.fromkeys(key for group in groups for key in group))
    return keys if any(isinstance(key, str) for key in keys) else sorted(keys)


@styled
def weekly_comparison(
    simulated: Mapping[float, TriangleMesh],
    real: Mapping[float, TriangleMesh],
    *,
    views: Sequence[str] = SIDE_VIEWS,
    measured: str = REAL_BRAIN,
    title: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns simulated (blue) above measured brains (beige), a column per week, a pair of rows per view.

    Parameters
    ----------
    simulated, real : {week: surface in RAS+ mm}
        A week that one of them lacks leaves its place empty.
    views
        Names of `scene.VIEWS`.
    measured
        What the measured brains are called.
    """
    return _surface_rows(
        {
            "simulated": (simulated, SIMULATED_SURFACE_COLOUR),
            measured: (real, REAL_SURFACE_COLOUR),
        },
        views=views,
        title=title,
        synthetic=synthetic,
        measured=measured,
    )


@styled
def runs_comparison(
    runs: Mapping[str, TriangleMesh],
    real: TriangleMesh | None = None,
    *,
    views: Sequence[str] = SIDE_VIEWS,
    measured: str = REAL_BRAIN,
    title: str = "",
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
    return panel_grid(columns, rows, title=title, synthetic=synthetic, measured=measured)


def _surface_rows(
    groups: Mapping[str, tuple[Mapping[float, TriangleMesh], str]],
    *,
    views: Sequence[str],
    title: str,
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
    return panel_grid([column_label(key) for key in keys], rows, title=title, synthetic=synthetic, measured=measured)


@styled
def displacement_maps(
    displacements: Mapping[tuple[float, float], SurfaceMap],
    *,
    views: Sequence[str] = SIDE_VIEWS,
    title: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns the norm of the displacement on the pial surface, a column per interval, on one colour scale.

    The largest and the mean value over the vertices stand below each interval.

    Parameters
    ----------
    displacements : {(from_week, to_week): (surface, norms in mm)}
    """
    keys = _ordered(displacements)
    scale = colour_scale("viridis", 0.0, max(float(np.nanmax(norms)) for _, norms in displacements.values()))
    seen = named_views(views)
    rows = []
    for view in seen:
        panels = []
        for key in keys:
            mesh, norms = displacements[key]
            caption = f"max {np.nanmax(norms):.2f} mm\nmean {np.nanmean(norms):.2f} mm" if view == seen[-1] else ""
            panels.append(Panel(mesh, painted(norms, scale), view, caption))
        rows.append(Row(f"{view.name} view", panels))
    return panel_grid(
        [column_label(key) for key in keys],
        rows,
        title=title,
        synthetic=synthetic,
        colour_bars=[(scale, "norm of the displacement (mm)")],
    )


PRESSURES = {
    "contact_pressure_pa": "contact pressure (Pa)",
    "contact_pressure_pa_per_gw": "contact pressure built up in a week (Pa/GW)",
}
LABELS = {name: measure.label for name, measure in SHAPE_MEASURES.items()} | PRESSURES
"""The quantities that can be drawn as maps, with the labels of their colour bars."""


def _scale_of(quantity: str, values: Floats) -> ScalarMappable:
    """Returns the colour scale of a quantity; without limits it ends below a few sharp vertices."""
    if quantity in PRESSURES:
        touching = values[values > 0]
        return colour_scale("YlOrRd", 0.0, float(np.percentile(touching, 98)) if len(touching) else 1.0, cut=True)
    measure = SHAPE_MEASURES[quantity]
    if measure.limits is not None:
        return colour_scale(measure.colours, *measure.limits)
    return colour_scale(measure.colours, 0.0, float(np.nanpercentile(values, 98)), cut=True)


@styled
def scalar_maps(
    maps: Mapping[str, Mapping[Hashable, SurfaceMap]],
    *,
    quantity: str,
    views: Sequence[str] = SIDE_VIEWS,
    measured: str = PHANTOM,
    title: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns a shape measure on surfaces: a row per group and view, a column per week or run, one colour scale.

    Parameters
    ----------
    maps : {group: {week or run: (surface, values)}}
        For example {"simulated": {28.0: …}, "real brain": {28.0: …}}.
    quantity
        A name of `SHAPE_MEASURES`, or one of `PRESSURES` (up to the 98th percentile where there is contact).
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
    scale, label = _scale_of(quantity, values), LABELS[quantity]
    keys = _ordered(*maps.values())
    rows = [
        Row(
            f"{group}\n{view.name} view",
            [Panel(known[key][0], painted(known[key][1], scale), view) if key in known else None for key in keys],
        )
        for view in named_views(views)
        for group, known in maps.items()
    ]
    return panel_grid(
        [column_label(key) for key in keys],
        rows,
        title=title,
        synthetic=synthetic,
        measured=measured,
        colour_bars=[(scale, label)],
    )
