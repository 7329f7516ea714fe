"""Plane sections through tetrahedral meshes."""

import matplotlib as mpl
import numpy as np
import pyvista as pv
from matplotlib.figure import Figure

from ..errors import InputError
from ..geometry.tetrahedra import TetrahedralMesh
from ..geometry.triangles import Floats
from .style import SINGLE_COLUMN_IN, new_figure, styled

_PLANES = {
    # name: (axis across the plane, axes to the right and up, their names)
    "coronal": (1, 0, 2),
    "axial": (2, 0, 1),
    "sagittal": (0, 1, 2),
}
_AXIS_NAMES = ("x: left − to right + (mm)", "y: posterior − to anterior + (mm)", "z: inferior − to superior + (mm)")


@styled
def cross_section(
    mesh: TetrahedralMesh,
    values: Floats,
    *,
    label: str,
    plane: str = "coronal",
    at_mm: float | None = None,
    show_elements: bool = False,
    title: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns a plane section through a mesh in RAS+ mm with the elements in the colour of their values.

    Parameters
    ----------
    values : (n,) of vertices, shown as their mean over each element, or (m,) of elements
    label
        Name and unit of the values.
    plane
        "coronal", "axial" or "sagittal"; the brain's left is on the picture's left.
    at_mm
        Where the plane cuts its axis; by default the middle of the mesh.
    show_elements
        Draws the edges of the elements.

    Raises
    ------
    InputError
        For another plane, values that do not fit the mesh, or a plane that misses it.
    """
    if plane not in _PLANES:
        raise InputError("unknown plane", found=plane, expected=list(_PLANES))
    values = np.asarray(values, dtype=float)
    if len(values) not in (len(mesh.vertices), len(mesh.tets)):
        raise InputError(
            "values do not fit the mesh",
            found=f"{len(values)} values",
            expected=f"{len(mesh.vertices)} (vertices) or {len(mesh.tets)} (elements)",
        )
    across, right, up = _PLANES[plane]
    low, high = mesh.vertices[:, across].min(), mesh.vertices[:, across].max()
    position = float((low + high) / 2) if at_mm is None else at_mm
    if not low < position < high:
        raise InputError("the plane misses the mesh", found=f"{position:g} mm", expected=f"{low:.1f} to {high:.1f} mm")
    points, triangles, elements = _cut(mesh, across, position)
    colours = values[elements] if len(values) == len(mesh.tets) else values[mesh.tets[elements]].mean(axis=1)

    span = np.ptp(points, axis=0)
    height = 1.35 + 0.17 * synthetic + (SINGLE_COLUMN_IN - 0.7) * span[up] / span[right]
    figure = new_figure(SINGLE_COLUMN_IN, height, title=title, synthetic=synthetic)
    axes = figure.subplots()
    drawn = axes.tripcolor(
        points[:, right],
        points[:, up],
        triangles,
        facecolors=colours,
        cmap="viridis",
        vmin=float(values.min()),
        vmax=float(values.max()) if np.ptp(values) > 0 else float(values.min()) + 1.0,
        edgecolors="#00000055" if show_elements else "none",
        linewidth=0.15,
        antialiased=show_elements,
        rasterized=True,
    )
    axes.set_aspect("equal")
    axes.set_xlabel(_AXIS_NAMES[right])
    axes.set_ylabel(_AXIS_NAMES[up])
    axes.set_title(f"{plane} section at {'xyz'[across]} = {position:.1f} mm")
    axes.xaxis.set_major_locator(mpl.ticker.MaxNLocator(6))
    bar = figure.colorbar(drawn, ax=axes, location="bottom", shrink=0.8, aspect=30)
    bar.set_label(label)
    return figure


def _cut(mesh: TetrahedralMesh, axis: int, position: float) -> tuple[Floats, np.ndarray, np.ndarray]:
    """Returns the (p, 3) points and (t, 3) triangles of the section, and the (t,) element of each triangle."""
    cells = {pv.CellType.TETRA: np.array(mesh.tets)}
    grid = pv.UnstructuredGrid(cells, np.array(mesh.vertices))
    grid.cell_data["element"] = np.arange(len(mesh.tets))
    normal, origin = np.eye(3)[axis], np.eye(3)[axis] * position
    section = grid.slice(normal=normal, origin=origin, generate_triangles=True)
    return (
        np.asarray(section.points, dtype=float),
        section.regular_faces.astype(np.int64),
        np.asarray(section.cell_data["element"]),
    )
