"""The scheme of contact: the walls that may touch, the planes or the distance between them, the law of the pressure."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from ..geometry.triangles import Floats, TriangleMesh, submesh
from ..parameters.terms import BETWEEN_PLANES, LEFT_CONTACT, RIGHT_CONTACT
from .overlay import section_lines
from .style import FULL_WIDTH_IN, MUTED_COLOUR, RUN_COLOURS, add_letters, light_grid, new_figure, styled
from .zones import ZONES

_WALLS = {code: ZONES[code][1] for code in (LEFT_CONTACT, RIGHT_CONTACT, BETWEEN_PLANES)}
_ZOOM_MM = 9.0


@dataclass(frozen=True)
class Law:
    """The pressure of contact over a length.

    Attributes
    ----------
    label, pressure_label : of the axes
    at : (k,) lengths
    pressure : (k,) at these
    """

    label: str
    pressure_label: str
    at: NDArray
    pressure: NDArray


def penalty_law(penalty_pa_per_m: float) -> Law:
    """Returns the pressure ε⟨g⟩ of a penalty over the penetration g of a wall beyond its plane, in mm."""
    at = np.linspace(-0.5, 1.0, 151)
    pressure = penalty_pa_per_m * 1e-3 * np.maximum(at, 0.0)
    return Law("penetration (mm)", "contact pressure (Pa)", at, pressure)


def barrier_law(barrier: Callable[[float, float], float]) -> Law:
    """Returns the repulsion −db/ds of a barrier b(s², d̂²) over the distance s in d̂, as a share of that at d̂/2."""
    at = np.linspace(0.12, 1.3, 237)
    step = 1e-5

    def force(s: float) -> float:
        return -(barrier((s + step) ** 2, 1.0) - barrier((s - step) ** 2, 1.0)) / (2 * step) if s < 1 else 0.0

    pressure = np.array([force(s) for s in at]) / force(0.5)
    return Law("distance of the walls / d̂", "repulsion / that at d̂/2", at, pressure)


@styled
def contact_scheme(
    mesh: TriangleMesh,
    zones: Floats,
    law: Law,
    *,
    planes_mm: tuple[float, float] | None,
    distance: str = "",
    synthetic: bool = False,
) -> Figure:
    """Returns an axial section with the walls that may touch, the fissure enlarged with what acts there, and the law.

    Parameters
    ----------
    mesh : the pial surface at the start, in RAS+ mm
    zones : (m,) zone of each face
    planes_mm
        Where the rigid planes stand across x; None for contact of the surface with itself.
    distance
        What is said of the distance at which the surface repels itself.
    """
    figure = new_figure(FULL_WIDTH_IN, 3.1, synthetic=synthetic)
    whole, zoom, curve = figure.subplots(1, 3, width_ratios=[1.0, 1.1, 1.0])
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    at = float((low[2] + high[2]) / 2)
    touching = set(_WALLS) if planes_mm else set()
    for axes in (whole, zoom):
        _walls(axes, mesh, zones, at, touching)
        axes.set_aspect("equal")
        axes.set(xlabel="x: left − to right + (mm)")
    whole.set(xlim=(low[0] - 2, high[0] + 2), ylim=(low[1] - 2, high[1] + 2), ylabel="y (mm)")
    middle = sum(planes_mm) / 2 if planes_mm else float((low[0] + high[0]) / 2)
    centre = _facing(mesh, at, middle)
    zoom.set(xlim=(middle - _ZOOM_MM / 2, middle + _ZOOM_MM / 2), ylim=(centre - _ZOOM_MM / 2, centre + _ZOOM_MM / 2))
    frame = [middle - _ZOOM_MM / 2, centre - _ZOOM_MM / 2]
    whole.add_line(_square(frame))
    handles = [
        Line2D([], [], color=colour, linewidth=2, label=ZONES[code][0])
        for code, colour in _WALLS.items()
        if code in touching and (zones == code).any()
    ]
    if planes_mm:
        for side, plane in zip((-1, 1), planes_mm, strict=True):
            for axes in (whole, zoom):
                axes.axvline(plane, color="black", linestyle="--", linewidth=0.8)
            arrow = {"arrowstyle": "->", "linewidth": 1.0}
            zoom.annotate("", (plane + side * 1.3, centre), (plane, centre), arrowprops=arrow)
            zoom.text(
                plane + side * 1.4, centre, "pressure", ha="right" if side < 0 else "left", va="center", fontsize=6.5
            )
        zoom.set_title("a wall beyond its plane\nis pressed back", fontsize=7)
        handles.append(Line2D([], [], color="black", linestyle="--", linewidth=0.8, label="rigid planes"))
    else:
        zoom.annotate(
            "", (middle - 0.8, centre), (middle - 2.6, centre), arrowprops={"arrowstyle": "<-", "linewidth": 1.0}
        )
        zoom.annotate(
            "", (middle + 0.8, centre), (middle + 2.6, centre), arrowprops={"arrowstyle": "<-", "linewidth": 1.0}
        )
        zoom.set_title(f"parts nearer than {distance}\nrepel each other", fontsize=7)
    whole.set_title(f"axial, z = {at:.1f} mm", fontsize=7)
    curve.plot(law.at, law.pressure, color=RUN_COLOURS[0])
    curve.axhline(0, color=MUTED_COLOUR, linewidth=0.6)
    curve.set(xlabel=law.label, ylabel=law.pressure_label)
    if not planes_mm:
        curve.set_ylim(-0.2, 5)
    light_grid(curve)
    add_letters([whole, zoom, curve])
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def _walls(axes: Axes, mesh: TriangleMesh, zones: Floats, at: float, touching: set[int]) -> None:
    for code in np.unique(zones):
        part, _ = submesh(mesh, zones == code)
        lines = section_lines(part, "axial", at)
        colour, width = (_WALLS[int(code)], 1.8) if int(code) in touching else ("black", 0.8)
        axes.add_collection(LineCollection(lines, colors=colour, linewidths=width))


def _facing(mesh: TriangleMesh, at: float, middle: float) -> float:
    """Returns where along y walls of the fissure face each other: the middle of the longest stretch near the plane."""
    points = np.concatenate([np.reshape(line, (-1, 2)) for line in section_lines(mesh, "axial", at)])
    near = np.sort(points[np.abs(points[:, 0] - middle) < 0.3 * _ZOOM_MM][:, 1])
    if len(near) == 0:
        return float(np.median(points[:, 1]))
    # back of the brain, where the fissure is open
    return float(np.quantile(near, 0.2))


def _square(corner: list[float]) -> Line2D:
    x, y = corner
    a = _ZOOM_MM
    return Line2D([x, x + a, x + a, x, x], [y, y, y + a, y + a, y], color=MUTED_COLOUR, linewidth=0.8)
