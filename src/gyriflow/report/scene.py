"""One surface seen from one side: cameras, light and off-screen rendering."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import matplotlib as mpl
import numpy as np

# without which VTK does not draw
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgb
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger, vtkPoints, vtkUnsignedCharArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkLight,
    vtkPolyDataMapper,
    vtkProperty,
    vtkRenderer,
    vtkRenderWindow,
)

from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    corners,
    submesh,
    vertex_normals,
)
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

_SHININESS, _SHINE_COLOUR = 15.0, "lightblue"
"""Exponent and colour of highlights."""

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


def polydata(mesh: TriangleMesh) -> vtkPolyData:
    """Return a surface for VTK."""
    data = vtkPolyData()
    data.SetPoints(_points(mesh.vertices))
    data.SetPolys(_cells(mesh.faces))
    return data


def _points(positions: Floats) -> vtkPoints:
    points = vtkPoints()
    points.SetData(
        numpy_to_vtk(
            np.asarray(positions, dtype=float),
            deep=True,
        )
    )
    return points


def _cells(corners_of_cells: Ints) -> vtkCellArray:
    """Return triangles or lines, by the numbers of their points."""
    numbers = np.asarray(corners_of_cells, dtype=np.int64)
    cells = vtkCellArray()
    cells.SetData(
        numbers.shape[1],
        numpy_to_vtk(numbers.ravel(), deep=True),
    )
    return cells


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
    normals = vertex_normals(mesh)
    surface.GetPointData().SetNormals(numpy_to_vtk(normals, deep=True))
    levels = np.clip(
        np.round(255 * np.asarray(colours)),
        0,
        255,
    )
    is_by_vertex = len(colours) == len(mesh.vertices)
    attributes = surface.GetPointData() if is_by_vertex else surface.GetCellData()
    attributes.SetScalars(
        numpy_to_vtk(
            levels.astype(np.uint8),
            deep=True,
        )
    )
    scene = vtkRenderer()
    scene.SetBackground(1.0, 1.0, 1.0)
    outside = _add_actor(scene, surface, **light)
    outside.SetInterpolationToPhong()
    outside.BackfaceCullingOn()
    # the inside of a surface that is open where the hemispheres were separated
    inside = _add_actor(scene, surface, NEUTRAL_COLOUR, ambient=0.6, diffuse=0.4)
    inside.SetInterpolationToFlat()
    inside.FrontfaceCullingOn()
    if lines is not None:
        segments = vtkPolyData()
        segments.SetPoints(_points(lines.reshape(-1, 3)))
        segments.SetLines(_cells(np.arange(2 * len(lines)).reshape(-1, 2)))
        drawn = _add_actor(scene, segments, "black")
        drawn.SetLineWidth(0.005 * PIXELS_PER_INCH)
        drawn.LightingOff()
    _add_lamps(scene)
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    distance = 4 * float(
        np.linalg.norm(
            np.ptp(
                mesh.vertices,
                axis=0,
            )
        )
    )
    camera = scene.GetActiveCamera()
    camera.SetPosition(*(middle + distance * np.array(view.towards)))
    camera.SetFocalPoint(*middle)
    camera.SetViewUp(*view.up)
    camera.ParallelProjectionOn()
    camera.SetParallelScale(half_extents_mm[1])
    scene.ResetCameraClippingRange()
    return _photograph(scene, *size)


def _add_actor(
    scene: vtkRenderer,
    data: vtkPolyData,
    colour: str = "",
    *,
    ambient: float = 0.0,
    diffuse: float = 1.0,
    specular: float = 0.0,
) -> vtkProperty:
    """Add a surface or lines to a scene, in its own colours or in one, and return its
    look."""
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    actor = vtkActor()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    look.SetAmbient(ambient)
    look.SetDiffuse(diffuse)
    look.SetSpecular(specular)
    look.SetSpecularPower(_SHININESS)
    look.SetSpecularColor(*to_rgb(_SHINE_COLOUR))
    if colour:
        mapper.ScalarVisibilityOff()
        look.SetColor(*to_rgb(colour))
    scene.AddActor(actor)
    return look


def _add_lamps(scene: vtkRenderer) -> None:
    scene.AutomaticLightCreationOff()
    for position, intensity in _LAMPS:
        lamp = vtkLight()
        lamp.SetLightTypeToCameraLight()
        lamp.SetFocalPoint(0.0, 0.0, 0.0)
        lamp.SetPosition(*position)
        lamp.SetIntensity(intensity)
        scene.AddLight(lamp)


@cache
def _window() -> vtkRenderWindow:
    """Return the window of all pictures, since OpenGL takes longer to start than to
    draw one."""
    window = vtkRenderWindow()
    window.SetOffScreenRendering(True)
    # at twice the resolution of print, smoother edges would not be visible
    window.SetMultiSamples(0)
    # macOS would show a window of the desktop
    if hasattr(window, "SetConnectContextToNSView"):
        window.SetConnectContextToNSView(False)
    return window


def _photograph(scene: vtkRenderer, width: int, height: int) -> Image:
    """Return a picture (height, width, 3) of a scene."""
    window = _window()
    window.SetSize(width, height)
    window.AddRenderer(scene)
    window.Render()
    pixels = vtkUnsignedCharArray()
    window.GetPixelData(
        0,
        0,
        width - 1,
        height - 1,
        1,
        pixels,
        0,
    )
    window.RemoveRenderer(scene)
    # rows from the bottom up
    rows = vtk_to_numpy(pixels).reshape(height, width, 3)
    return np.array(rows[::-1])
