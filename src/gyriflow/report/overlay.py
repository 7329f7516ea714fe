"""A surface drawn over the volume that it was made from, in three planes."""

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from scipy.ndimage import map_coordinates

from ..geometry.triangles import Floats, TriangleMesh
from .sections import AXIS_NAMES, PLANES
from .style import FULL_WIDTH_IN, RUN_COLOURS, add_letters, new_figure, styled

MARGIN_MM = 8.0
PIXEL_MM = 0.25
# grey values up to this quantile of those above zero are told apart
BRIGHTEST = 0.995


@styled
def surface_overlay(values: Floats, affine: ArrayLike, surface: TriangleMesh) -> Figure:
    """Returns a volume in grey with the outline of a surface, in a coronal, an axial and a sagittal plane.

    The coronal and the axial plane pass the middle of the surface; the sagittal one passes the right hemisphere, at a
    quarter of the width, since a mid-sagittal plane would only show the fissure. The left is on the picture's left.

    Parameters
    ----------
    values : (i, j, k) float
        Grey values of the volume.
    affine : (4, 4) float
        Voxel index to position in mm in the surface's coordinates.
    surface
        In RAS+ mm.
    """
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    middle = (low + high) / 2
    at = {"coronal": middle[1], "axial": middle[2], "sagittal": (middle[0] + high[0]) / 2}
    spans = [(high - low)[list(PLANES[plane][1:])] + 2 * MARGIN_MM for plane in PLANES]
    # beside and above the panels is room for words
    height = (FULL_WIDTH_IN - 1.7) * max(span[1] for span in spans) / sum(span[0] for span in spans) + 0.9
    figure = new_figure(FULL_WIDTH_IN, height, synthetic=False)
    panels = figure.subplots(1, len(PLANES), width_ratios=[span[0] for span in spans])
    lit = values[np.isfinite(values) & (values > 0)]
    brightest = float(np.quantile(lit, BRIGHTEST)) if lit.size else 1.0
    for axes, plane in zip(panels, PLANES, strict=True):
        across, right, up = PLANES[plane]
        points, extent = plane_grid(plane, at[plane], low, high)
        inverse = np.linalg.inv(np.asarray(affine, dtype=float))
        index = np.moveaxis(points @ inverse[:3, :3].T + inverse[:3, 3], -1, 0)
        grey = map_coordinates(values, index, order=1)
        axes.imshow(grey, cmap="gray", vmin=0, vmax=brightest, origin="lower", extent=extent, interpolation="none")
        draw_outline(axes, surface, plane, at[plane])
        axes.set(xlabel=AXIS_NAMES[right], ylabel=AXIS_NAMES[up], xlim=extent[:2], ylim=extent[2:])
        axes.set_title(f"{plane}, {'xyz'[across]} = {at[plane]:.1f} mm")
        axes.set_aspect("equal")
    add_letters(panels)
    return figure


def plane_grid(plane: str, at: float, low: Floats, high: Floats) -> tuple[Floats, tuple[float, float, float, float]]:
    """Returns the (rows, columns, 3) points of a picture of a plane, and its left, right, lower and upper end in mm."""
    across, right, up = PLANES[plane]
    begin, end = low - MARGIN_MM, high + MARGIN_MM
    columns, rows = (np.arange(begin[axis], end[axis], PIXEL_MM) for axis in (right, up))
    points = np.empty((len(rows), len(columns), 3))
    points[..., across], points[..., right], points[..., up] = at, columns[None], rows[:, None]
    return points, (begin[right], columns[-1] + PIXEL_MM, begin[up], rows[-1] + PIXEL_MM)


def draw_outline(axes: Axes, surface: TriangleMesh, plane: str, at: float, colour: str = RUN_COLOURS[4]) -> None:
    """Draws the lines in which a plane cuts a surface."""
    across, right, up = PLANES[plane]
    body = pv.PolyData.from_regular_faces(np.array(surface.vertices), np.array(surface.faces, dtype=int))
    cut = body.slice(normal=np.eye(3)[across], origin=np.eye(3)[across] * at)
    segments = np.asarray(cut.points)[cut.lines.reshape(-1, 3)[:, 1:]][..., [right, up]]
    axes.add_collection(LineCollection(list(segments), colors=colour, linewidths=0.8, capstyle="round"))
