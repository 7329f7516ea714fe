"""One surface seen from one side: cameras, light and off-screen rendering."""

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import pyvista as pv
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgb
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkLogger

from ..geometry.triangles import Floats, TriangleMesh, corners, submesh, vertex_normals
from .style import NEUTRAL_COLOUR

# without a display VTK warns about X before it renders off-screen
vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)

Vector = tuple[float, float, float]
Image = NDArray[np.uint8]


@dataclass(frozen=True)
class View:
    """A view of a brain in RAS+ mm.

    `towards` is the unit vector from the brain to the camera, `up` the one that points
    up in the picture; `ends` are the letters of the picture's left and right ends (A
    anterior, P posterior, L left, R right). `hemisphere` is "left" or "right" if only
    that one is shown, else "". The name is the label of the picture.
    """

    name: str
    towards: Vector
    up: Vector
    ends: tuple[str, str]
    hemisphere: str = ""


VIEWS = {
    view.name: view
    for view in (
        View(
            "left",
            (-1, 0, 0),
            (0, 0, 1),
            ("A", "P"),
        ),
        View(
            "right",
            (1, 0, 0),
            (0, 0, 1),
            ("P", "A"),
        ),
        View(
            "top",
            (0, 0, 1),
            (0, 1, 0),
            ("L", "R"),
        ),
        View(
            "bottom",
            (0, 0, -1),
            (0, 1, 0),
            ("R", "L"),
        ),
        View(
            "front",
            (0, 1, 0),
            (0, 0, 1),
            ("R", "L"),
        ),
        View(
            "back",
            (0, -1, 0),
            (0, 0, 1),
            ("L", "R"),
        ),
        View(
            "left medial",
            (1, 0, 0),
            (0, 0, 1),
            ("P", "A"),
            "left",
        ),
        View(
            "right medial",
            (-1, 0, 0),
            (0, 0, 1),
            ("A", "P"),
            "right",
        ),
    )
}
"""The views by name. In the top view the brain's left is on the picture's left."""

PIXELS_PER_INCH = 600
"""Resolution of pictures of surfaces: as in PDF files, three times that of PNG
files."""

PARTS = {
    "YlGnBu": (0.0, 0.85),
    "YlOrRd": (0.08, 0.85),
    "RdBu_r": (0.06, 0.94),
}
"""Used parts of colour maps: their darkest ends could be mistaken for shade."""
UNKNOWN_COLOUR = "#B8B8B8"
TISSUE = {"ambient": 0.16, "diffuse": 0.84, "specular": 0.1}
"""Light on surfaces of one colour, whose shading shows the shape."""
MAP = {"ambient": 0.58, "diffuse": 0.42, "specular": 0.0}
"""Light on maps, whose colours show values: shading only hints at the shape."""

# lamps fixed to the camera, symmetric so that both hemispheres are shaded equally. The
# strongest is above, so that shallow sulci of young brains are visible
_LAMPS = (
    ((0.0, 1.0, 0.8), 0.45),
    ((-1.0, 0.2, 0.5), 0.22),
    ((1.0, 0.2, 0.5), 0.22),
    ((0.0, 0.0, 1.0), 0.36),
)


def picture_axes(view: View) -> tuple[Floats, Floats]:
    """Return the unit vectors that point right and up in the picture."""
    up = np.array(view.up, dtype=float)
    return np.cross(up, view.towards), up


def polydata(mesh: TriangleMesh) -> pv.PolyData:
    """Return a surface for VTK."""
    return pv.PolyData.from_regular_faces(
        np.array(mesh.vertices),
        np.array(
            mesh.faces,
            dtype=int,
        ),
    )


def half_extents(mesh: TriangleMesh, view: View) -> tuple[float, float]:
    """Return half the width and half the height in mm of the surface in a view."""
    right, up = (np.ptp(mesh.vertices @ axis) / 2 for axis in picture_axes(view))
    return float(right), float(up)


def restricted(
    mesh: TriangleMesh,
    colours: Floats,
    hemisphere: str,
    fissure_x_mm: float,
) -> tuple[TriangleMesh, Floats]:
    """Return the faces on one side of the fissure's plane, all for "", and their (n, 3)
    vertex or (m, 3) face colours.

    A brain that lacks the hemisphere has no faces there.
    """
    if not hemisphere:
        return mesh, colours
    is_left = corners(mesh).mean(axis=1)[:, 0] < fissure_x_mm
    keep = is_left if hemisphere == "left" else ~is_left
    part, vertices = submesh(mesh, keep)
    kept = vertices if len(colours) == len(mesh.vertices) else keep
    return part, colours[kept]


def uniform_colours(mesh: TriangleMesh, colour: str) -> Floats:
    """Return one colour for every vertex, (n, 3) in 0 to 1."""
    return np.tile(
        to_rgb(colour),
        (len(mesh.vertices), 1),
    )


def colour_scale(
    colormap: str,
    low: float,
    high: float,
    *,
    cut: bool = False,
) -> ScalarMappable:
    """Return a colour scale; `cut` marks values above its upper end."""
    start, end = PARTS.get(colormap, (0.0, 1.0))
    shades = mpl.colormaps[colormap](
        np.linspace(
            start,
            end,
            256,
        )
    )
    colours = LinearSegmentedColormap.from_list(
        colormap, [tuple(shade) for shade in shades]
    )
    colours.colorbar_extend = "max" if cut else "neither"  # type: ignore[assignment]
    # a map with one value has no range
    top = high if high > low else low + 1.0
    return ScalarMappable(Normalize(low, top), colours)


def paint(values: Floats, scale: ScalarMappable) -> Floats:
    """Return the (n, 3) colours of values, grey if not finite."""
    values = np.asarray(values, dtype=float)
    colours = np.asarray(scale.to_rgba(values))[:, :3]
    colours[~np.isfinite(values)] = to_rgb(UNKNOWN_COLOUR)
    return colours


def render(
    mesh: TriangleMesh,
    colours: Floats,
    view: View,
    half_extents_mm: tuple[float, float],
    pixels_per_mm: float,
    *,
    light: Mapping[str, Any] = TISSUE,
    lines: Floats | None = None,
) -> Image:
    """Return a picture (height, width, 3) of the surface on white, in parallel
    projection about the middle of its box.

    `colours` are (n, 3) of vertices or (m, 3) of faces, red, green and blue in 0 to 1;
    `half_extents_mm` half the width and half the height of the picture; `lines` (k, 2,
    3) ends of lines, drawn unless the surface hides them.
    """
    size = [
        max(
            2,
            round(2 * half * pixels_per_mm),
        )
        for half in half_extents_mm
    ]
    surface = polydata(mesh)
    surface.point_data.active_normals = vertex_normals(mesh)
    is_by_vertex = len(colours) == len(mesh.vertices)
    attributes = surface.point_data if is_by_vertex else surface.cell_data
    levels = np.clip(np.round(255 * np.asarray(colours)), 0, 255)
    attributes["colour"] = levels.astype(np.uint8)
    plotter = pv.Plotter(off_screen=True, window_size=size, lighting="none")
    with closing(plotter):
        plotter.set_background("white")  # type: ignore[arg-type]
        plotter.add_mesh(
            surface,
            scalars="colour",
            rgb=True,
            interpolation="phong",
            specular_power=15,
            culling="back",
            **light,
        )
        # the inside of a surface that is open where the hemispheres were separated
        plotter.add_mesh(
            surface,
            color=NEUTRAL_COLOUR,
            ambient=0.6,
            diffuse=0.4,
            culling="front",
        )
        if lines is not None:
            ends = pv.line_segments_from_points(lines.reshape(-1, 3))
            plotter.add_mesh(
                ends,
                color="black",
                line_width=0.005 * PIXELS_PER_INCH,
                lighting=False,
            )
        for position, intensity in _LAMPS:
            lamp = pv.Light(
                position=position,
                light_type="camera light",
                intensity=intensity,
            )
            plotter.add_light(lamp)
        middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
        distance = 4 * float(
            np.linalg.norm(
                np.ptp(
                    mesh.vertices,
                    axis=0,
                )
            )
        )
        place = middle + distance * np.array(view.towards)
        plotter.camera_position = [
            tuple(place),
            tuple(middle),
            view.up,
        ]
        plotter.camera.parallel_projection = True
        plotter.camera.parallel_scale = half_extents_mm[1]
        plotter.renderer.ResetCameraClippingRange()
        # at twice the resolution of print, smoother edges would not be visible
        plotter.disable_anti_aliasing()
        return np.array(plotter.screenshot(return_img=True))[..., :3]
