"""Pictures of the zones and fields that a folding is given."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.triangles import Floats, TriangleMesh, face_areas
from ..parameters.terms import (
    BASE,
    BETWEEN_PLANES,
    CLAMPED,
    FLAT_CUTS,
    FREE,
    LEFT_CONTACT,
    MEDIAL_WALL,
    RIGHT_CONTACT,
    SIDE_X,
    SIDE_Y,
    ZONE_NAMES,
)
from ..units import CM2_PER_MM2
from .panels import Panel, Row, panel_grid
from .renders import goes_below_zero, magnitude_scale, signed_scale
from .scene import MAP, hemisphere_faces, named_views, paint, restricted
from .style import MAGNITUDES, NEUTRAL_COLOUR, RIGHT_COLOUR, styled

ZONE_VIEWS = ("left", "bottom", "left medial", "right medial")
COLOURS = {
    FREE: "#D55E00",
    CLAMPED: "#009E73",
    LEFT_CONTACT: "#0072B2",
    RIGHT_CONTACT: RIGHT_COLOUR,
    BETWEEN_PLANES: "#CC79A7",
    BASE: "#999999",
    SIDE_X: "#56B4E9",
    SIDE_Y: "#E69F00",
    MEDIAL_WALL: "#8C6D31",
}
"""Colours of the boundary's zones, near the paper's red, green, blue, yellow and purple."""
ZONES: Mapping[int, tuple[str, str]] = {code: (ZONE_NAMES[code], colour) for code, colour in COLOURS.items()}
"""Their names and colours by code."""


@styled
def zones_picture(
    mesh: TriangleMesh,
    zones: NDArray[np.integer],
    *,
    fissure_x_mm: float,
    names: Mapping[int, tuple[str, str]] = ZONES,
    views: Sequence[str] = ZONE_VIEWS,
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
        table[code] = to_rgb(colour)
    areas = np.bincount(zones, weights=face_areas(mesh), minlength=max(names) + 1) * CM2_PER_MM2
    legend = [
        Patch(color=colour, label=f"{name} {areas[code]:.1f} cm²")
        for code, (name, colour) in names.items()
        if areas[code] or code not in FLAT_CUTS
    ]
    columns, rows = _one_row(mesh, table[zones], views, fissure_x_mm)
    return panel_grid(columns, rows, synthetic=synthetic, legend=legend)


@styled
def field_picture(
    mesh: TriangleMesh,
    values: Floats,
    *,
    label: str,
    fissure_x_mm: float,
    views: Sequence[str] = ZONE_VIEWS,
    synthetic: bool = False,
) -> Figure:
    """Returns a field at the pial vertices, such as the growth weight, from several sides; grey where it is zero.

    Parameters
    ----------
    values : (n,)
    label
        Name and unit, for example "growth weight" or "tangential growth increment (10⁻³)".
    """
    scale = signed_scale(values) if goes_below_zero(values) else magnitude_scale(values, MAGNITUDES)
    columns, rows = _one_row(mesh, paint(values, scale, zero_is_nothing=True), views, fissure_x_mm)
    return panel_grid(
        columns,
        rows,
        synthetic=synthetic,
        colour_bars=[(scale, label)],
        legend=[Patch(color=NEUTRAL_COLOUR, label="zero")],
    )


def _one_row(
    mesh: TriangleMesh, colours: Floats, views: Sequence[str], fissure_x_mm: float
) -> tuple[list[str], list[Row]]:
    # a brain of one hemisphere has no medial view of the other
    shown = [view for view in named_views(views) if hemisphere_faces(mesh, view.hemisphere, fissure_x_mm).any()]
    panels = [Panel(*restricted(mesh, colours, view.hemisphere, fissure_x_mm), view, material=MAP) for view in shown]
    return [f"{view.name} view" for view in shown], [Row("", panels)]
