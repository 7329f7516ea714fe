"""Plane sections through tetrahedral meshes."""

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
import pyvista as pv
from matplotlib.figure import Figure

from ..errors import InputError
from ..geometry.tetrahedra import TetrahedralMesh
from ..geometry.triangles import Floats
from .style import FULL_WIDTH_IN, new_figure, styled

PLANES = {
    # name: (axis across the plane, axes to the right and up)
    "coronal": (1, 0, 2),
    "axial": (2, 0, 1),
    "sagittal": (0, 1, 2),
}
AXIS_NAMES = ("x: left − to right + (mm)", "y: posterior − to anterior + (mm)", "z: inferior − to superior + (mm)")


@styled
def cross_sections(
    mesh: TetrahedralMesh,
    fields: Mapping[str, Floats],
    *,
    plane: str = "coronal",
    title: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns a plane section through the middle of a mesh in RAS+ mm for each of some fields, side by side.

    Parameters
    ----------
    fields : {name and unit: (n,) values at the vertices}
    plane
        "coronal", "axial" or "sagittal"; the brain's left is on the picture's left.

    Raises
    ------
    InputError
        For another plane, or values that do not fit the mesh.
    """
    if plane not in PLANES:
        raise InputError("unknown plane", found=plane, expected=list(PLANES))
    for label, values in fields.items():
        if len(values) != len(mesh.vertices):
            expected = f"{len(mesh.vertices)}, one per vertex"
            raise InputError(f"{label}: values do not fit the mesh", found=len(values), expected=expected)
    across, right, up = PLANES[plane]
    section = _cut(mesh, fields, across)
    points, triangles = np.asarray(section.points), section.regular_faces
    span = np.ptp(points, axis=0)
    height = 1.35 + 0.17 * synthetic + (FULL_WIDTH_IN / len(fields) - 0.7) * span[up] / span[right]
    figure = new_figure(FULL_WIDTH_IN, height, title=title, synthetic=synthetic)
    panels = figure.subplots(1, len(fields), sharey=True, squeeze=False)[0]
    for axes, (label, values) in zip(panels, fields.items(), strict=True):
        low, high = float(np.min(values)), float(np.max(values))
        drawn = axes.tripcolor(
            points[:, right],
            points[:, up],
            triangles,
            facecolors=section.point_data[label][triangles].mean(axis=1),
            cmap="viridis",
            vmin=low,
            vmax=high if high > low else low + 1.0,
            antialiased=False,
            rasterized=True,
        )
        axes.set_aspect("equal")
        axes.set_xlabel(AXIS_NAMES[right])
        axes.set_title(f"{plane} section at {'xyz'[across]} = {points[0, across]:.1f} mm")
        axes.xaxis.set_major_locator(mpl.ticker.MaxNLocator(6))
        figure.colorbar(drawn, ax=axes, location="bottom", shrink=0.8, aspect=30).set_label(label)
    panels[0].set_ylabel(AXIS_NAMES[up])
    return figure


def _cut(mesh: TetrahedralMesh, fields: Mapping[str, Floats], axis: int) -> pv.PolyData:
    """Returns the triangles of the section across the middle of an axis, with the fields at their points."""
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: np.array(mesh.tets)}, np.array(mesh.vertices))
    for label, values in fields.items():
        grid.point_data[label] = np.asarray(values, dtype=float)
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    return grid.slice(normal=np.eye(3)[axis], origin=middle, generate_triangles=True)
