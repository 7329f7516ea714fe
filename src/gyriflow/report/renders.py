"""Pictures of brains: simulated beside measured ones, displacement, shape and the zones of a folding."""

from collections.abc import Hashable, Mapping, Sequence
from itertools import pairwise

import matplotlib as mpl
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.triangles import Floats, TriangleMesh, face_areas
from ..units import CM2_PER_MM2
from .panels import Panel, Row, panel_grid
from .scene import VIEWS, View, restricted, uniform_colours
from .style import (
    REAL_SURFACE_COLOUR,
    SIMULATED_SURFACE_COLOUR,
    column_label,
    measured_name,
    styled,
)

SurfaceMap = tuple[TriangleMesh, Floats]
"""A surface in RAS+ mm and a value per vertex."""

_UNKNOWN_COLOUR = (0.72, 0.72, 0.72, 1.0)
SIDE_VIEWS = ("left", "top")
ZONE_VIEWS = ("left", "bottom", "left medial", "right medial")

ZONES: Mapping[int, tuple[str, str]] = {
    0: ("free", "#D55E00"),
    1: ("clamped", "#009E73"),
    2: ("contact, left", "#0072B2"),
    3: ("contact, right", "#F0E442"),
}
"""Codes of the boundary's zones, their names and colours (red, green, blue and yellow in the paper)."""


def _views(names: Sequence[str]) -> list[View]:
    unknown = [name for name in names if name not in VIEWS]
    if unknown:
        raise InputError("unknown view", found=unknown, expected=list(VIEWS))
    return [VIEWS[name] for name in names]


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
    """
    return _surface_rows(
        {
            "simulated": (simulated, SIMULATED_SURFACE_COLOUR),
            measured_name(synthetic): (real, REAL_SURFACE_COLOUR),
        },
        views=views,
        title=title,
        synthetic=synthetic,
    )


@styled
def runs_comparison(
    runs: Mapping[str, TriangleMesh],
    real: TriangleMesh | None = None,
    *,
    views: Sequence[str] = SIDE_VIEWS,
    title: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns the brains of several runs at one week side by side (blue), the measured one last (beige).

    Parameters
    ----------
    runs : {run: surface in RAS+ mm}
    """
    last = measured_name(synthetic)
    columns = [*runs, last] if real is not None else list(runs)
    rows = []
    for view in _views(views):
        panels = [Panel(mesh, uniform_colours(mesh, SIMULATED_SURFACE_COLOUR), view) for mesh in runs.values()]
        if real is not None:
            panels.append(Panel(real, uniform_colours(real, REAL_SURFACE_COLOUR), view))
        rows.append(Row(f"{view.name} view", panels))
    return panel_grid(columns, rows, title=title, synthetic=synthetic)


def _surface_rows(
    groups: Mapping[str, tuple[Mapping[float, TriangleMesh], str]],
    *,
    views: Sequence[str],
    title: str,
    synthetic: bool,
) -> Figure:
    keys = _ordered(*(meshes for meshes, _ in groups.values()))
    rows = [
        Row(
            f"{name}\n{view.name} view",
            [
                Panel(meshes[key], uniform_colours(meshes[key], colour), view) if key in meshes else None
                for key in keys
            ],
        )
        for view in _views(views)
        for name, (meshes, colour) in groups.items()
    ]
    return panel_grid([column_label(key) for key in keys], rows, title=title, synthetic=synthetic)


def _painted(values: Floats, scale: ScalarMappable) -> Floats:
    """Returns the (n, 3) colours of values, grey where they are not finite."""
    colours = np.asarray(scale.to_rgba(np.asarray(values, dtype=float)))
    colours[~np.isfinite(values)] = _UNKNOWN_COLOUR
    return colours[:, :3]


def _scale(colormap: str, low: float, high: float, *, cut: bool = False) -> ScalarMappable:
    """Returns a colour scale; `cut` marks its upper end as passed by some values."""
    colours = mpl.colormaps[colormap]
    colours.colorbar_extend = "max" if cut else "neither"
    return ScalarMappable(Normalize(low, high if high > low else low + 1.0), colours)


@styled
def displacement_maps(
    displacements: Mapping[tuple[float, float], SurfaceMap],
    *,
    views: Sequence[str] = SIDE_VIEWS,
    highest_mm: float | None = None,
    title: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns the norm of the displacement on the pial surface, a column per interval, on one colour scale.

    The largest and the mean value over the vertices stand below each interval.

    Parameters
    ----------
    displacements : {(from_week, to_week): (surface, norms in mm)}
    highest_mm
        Upper end of the colour scale; by default the largest norm of all.
    """
    keys = _ordered(displacements)
    largest = max(float(np.nanmax(norms)) for _, norms in displacements.values())
    highest = largest if highest_mm is None else highest_mm
    scale = _scale("viridis", 0.0, highest, cut=highest < largest)
    seen = _views(views)
    rows = []
    for view in seen:
        panels = []
        for key in keys:
            mesh, norms = displacements[key]
            caption = f"max {np.nanmax(norms):.2f}, mean {np.nanmean(norms):.2f} mm" if view == seen[-1] else ""
            panels.append(Panel(mesh, _painted(norms, scale), view, caption))
        rows.append(Row(f"{view.name} view", panels))
    return panel_grid(
        [column_label(key) for key in keys],
        rows,
        title=title,
        synthetic=synthetic,
        colour_bars=[(scale, "norm of the displacement (mm)")],
    )


@styled
def scalar_maps(
    maps: Mapping[str, Mapping[Hashable, SurfaceMap]],
    *,
    quantity: str,
    views: Sequence[str] = SIDE_VIEWS,
    title: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns a shape measure on surfaces: a row per group and view, a column per week or run, one colour scale.

    Parameters
    ----------
    maps : {group: {week or run: (surface, values)}}
        For example {"simulated": {28.0: …}, "real brain": {28.0: …}}.
    quantity
        "shape_index" (−1 to 1, gyri red, sulci blue), or "curvedness" (1/mm; from 0 to the 98th percentile of all
        surfaces).

    Raises
    ------
    InputError
        For another quantity or an unknown view.
    """
    values = np.concatenate([values for group in maps.values() for _, values in group.values()])
    match quantity:
        case "shape_index":
            scale, label = _scale("RdBu_r", -1.0, 1.0), "shape index (sulci −1, gyri +1)"
        case "curvedness":
            # a few sharp vertices would take the whole scale
            high = float(np.nanpercentile(values, 98))
            scale, label = _scale("viridis", 0.0, high, cut=True), "curvedness (mm⁻¹)"
        case _:
            raise InputError("unknown quantity", found=quantity, expected=["shape_index", "curvedness"])
    keys = _ordered(*maps.values())
    rows = [
        Row(
            f"{group}\n{view.name} view",
            [Panel(known[key][0], _painted(known[key][1], scale), view) if key in known else None for key in keys],
        )
        for view in _views(views)
        for group, known in maps.items()
    ]
    return panel_grid(
        [column_label(key) for key in keys], rows, title=title, synthetic=synthetic, colour_bars=[(scale, label)]
    )


@styled
def zones_picture(
    mesh: TriangleMesh,
    zones: NDArray[np.integer],
    *,
    fissure_x_mm: float,
    names: Mapping[int, tuple[str, str]] = ZONES,
    views: Sequence[str] = ZONE_VIEWS,
    title: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns the zones of the brain's boundary from several sides, with their areas.

    Parameters
    ----------
    zones : (m,) code of each face
    fissure_x_mm
        Where the medial views part the hemispheres.
    names : {code: (name, colour)}

    Raises
    ------
    InputError
        If the number of codes is not the number of faces, or a code has no name.
    """
    if len(zones) != len(mesh.faces):
        raise InputError("zones do not fit the surface", found=f"{len(zones)} codes", expected=f"{len(mesh.faces)}")
    unknown = sorted(set(np.unique(zones).tolist()) - set(names))
    if unknown:
        raise InputError("unknown zone", found=unknown, expected=list(names))
    table = np.zeros((max(names) + 1, 3))
    for code, (_, colour) in names.items():
        table[code] = mpl.colors.to_rgb(colour)
    areas = np.bincount(zones, weights=face_areas(mesh), minlength=max(names) + 1) * CM2_PER_MM2
    legend = [Patch(color=colour, label=f"{name} {areas[code]:.1f} cm²") for code, (name, colour) in names.items()]
    columns, rows = _one_row(mesh, table[zones], views, fissure_x_mm)
    return panel_grid(columns, rows, title=title, synthetic=synthetic, legend=legend)


@styled
def field_picture(
    mesh: TriangleMesh,
    values: Floats,
    *,
    label: str,
    fissure_x_mm: float,
    views: Sequence[str] = ZONE_VIEWS,
    title: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns a field at the pial vertices, such as the growth weight, from several sides.

    Parameters
    ----------
    values : (n,)
    label
        Name and unit, for example "growth weight" or "tangential growth increment (10⁻³)".
    """
    scale = _scale("viridis", float(np.nanmin(values)), float(np.nanmax(values)))
    columns, rows = _one_row(mesh, _painted(values, scale), views, fissure_x_mm)
    return panel_grid(columns, rows, title=title, synthetic=synthetic, colour_bars=[(scale, label)])


def _one_row(
    mesh: TriangleMesh, colours: Floats, views: Sequence[str], fissure_x_mm: float
) -> tuple[list[str], list[Row]]:
    panels = [Panel(*restricted(mesh, colours, view.hemisphere, fissure_x_mm), view) for view in _views(views)]
    return [f"{name} view" for name in views], [Row("", panels)]
