"""Plane sections through tetrahedral meshes: fields, tags, and vectors as arrows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
import pyvista as pv
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.colors import Colormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.tetrahedra import TetrahedralMesh
from ..geometry.triangles import Floats
from ..parameters.terms import BRIDGE, LEFT, RIGHT
from .renders import ROUNDING, SIGNED, goes_below_zero
from .style import (
    FULL_WIDTH_IN,
    MAGNITUDES,
    RIGHT_COLOUR,
    RUN_COLOURS,
    add_letters,
    new_figure,
    styled,
    week_label,
    wrap,
)

PLANES = {
    # name: (axis across the plane, axes to the right and up)
    "coronal": (1, 0, 2),
    "axial": (2, 0, 1),
    "sagittal": (0, 1, 2),
}
AXIS_NAMES = ("x: left − to right + (mm)", "y: posterior − to anterior + (mm)", "z: inferior − to superior + (mm)")
SHOWN = ("coronal", "axial")
HEMISPHERES = {LEFT: ("left", "#0072B2"), RIGHT: ("right", RIGHT_COLOUR), BRIDGE: ("between the planes", "#CC79A7")}
GROWING = {1: ("growing", "#D55E00"), 0: ("no growth", "#56B4E9")}
"""Codes of the elements' tags, their names and colours, those of the boundary's zones, near the paper's."""
WEIGHT, GROWTH, STIFFNESS = "cortical weight", "tangential growth per step (10⁻³)", "shear modulus (Pa)"
_FOOT_IN, _LABEL_IN = 0.72, 1.3
_ARROWS_ACROSS = 26
_ARROWS = {"pial vertices": RUN_COLOURS[0], "vertices inside": RUN_COLOURS[1]}

Tag = tuple[NDArray[np.integer], Mapping[int, tuple[str, str]]]
Ellipsoid = tuple[Floats, Floats]


def region_sections(
    mesh: TetrahedralMesh,
    fields: Mapping[str, Floats],
    tags: Mapping[str, NDArray[np.integer]],
    ellipsoid: Ellipsoid | None,
    *,
    synthetic: bool = False,
) -> Figure:
    """Returns coronal and axial sections with the hemispheres, what grows, cortex, growth of a step, and stiffness.

    Fields at vertices, tags of elements, and the ellipsoid are those of the folding's regions.
    """
    return cross_sections(
        mesh,
        {
            WEIGHT: fields["cortex_weight"],
            GROWTH: 1e3 * fields["tangential_growth_per_step"],
            STIFFNESS: fields["shear_modulus_pa"],
        },
        tags={"hemispheres": (tags["hemisphere"], HEMISPHERES), "growing": (tags["growing"], GROWING)},
        ellipsoid=ellipsoid,
        synthetic=synthetic,
    )


@styled
def cross_sections(
    mesh: TetrahedralMesh,
    fields: Mapping[str, Floats],
    *,
    tags: Mapping[str, Tag] | None = None,
    planes: Sequence[str] = SHOWN,
    ellipsoid: Ellipsoid | None = None,
    synthetic: bool = False,
) -> Figure:
    """Returns plane sections through the middle of a mesh in RAS+ mm, a row per plane, a column per tag and field.

    Parameters
    ----------
    fields : {name and unit: (n,) values at the vertices}
    tags : {name: ((m,) codes of the elements, {code: (name, colour)})}
    planes
        Among "coronal", "axial" and "sagittal"; the brain's left is on the picture's left. All panels have one scale.
    ellipsoid
        Centre and semi-axes, (3,) in mm, of an ellipsoid of which the outline is drawn.

    Raises
    ------
    InputError
        For another plane, values that do not fit the mesh, or a code without a name.
    """
    tags = tags or {}
    _require_fitting(mesh, fields, tags)
    grid = _grid(mesh, fields, {name: codes for name, (codes, _) in tags.items()})
    figure, panels, foot = _rows(mesh, planes, len(tags) + len(fields), synthetic)
    # a letter is about 0.055 in wide; the one by which a caption calls the panel stands beside the title
    letters = int((FULL_WIDTH_IN - 0.5) / panels.shape[1] / 0.055) - 6
    for column, name in enumerate((*tags, *fields)):
        panels[0, column].set_title(wrap(name.partition(" (")[0], letters), fontsize=7)
        for axes, plane in zip(panels[:, column], planes, strict=True):
            points, triangles, section = _section(grid, plane)
            scale: Colormap = mpl.colormaps[MAGNITUDES]
            if name in tags:
                colours = [colour for _, colour in tags[name][1].values()]
                values, limits = _ranks(section.cell_data[name], tags[name][1]), (-0.5, len(colours) - 0.5)
                scale = ListedColormap(colours)
            else:
                values = section.point_data[name][triangles].mean(axis=1)
                limits, scale = (
                    _limits(fields[name]),
                    mpl.colormaps[SIGNED if goes_below_zero(fields[name]) else MAGNITUDES],
                )
            drawn = _draw(axes, points, triangles, values, scale, limits)
            if panels.shape[1] > 3:
                axes.xaxis.set_major_locator(MaxNLocator(2))
            if ellipsoid:
                _outline(axes, ellipsoid, plane, _middle(mesh)[PLANES[plane][0]])
        if name in fields:
            bar = figure.colorbar(drawn, cax=foot[column].inset_axes((0.05, 0.8, 0.9, 0.1)), orientation="horizontal")
            bar.set_label(wrap(name, letters + 6), fontsize=7)
            bar.ax.xaxis.set_major_locator(MaxNLocator(nbins=3))
        else:
            keys: list[Artist] = [Patch(color=colour, label=label) for label, colour in tags[name][1].values()]
            if ellipsoid and name == list(tags)[-1]:
                keys.append(Line2D([], [], color="black", linestyle="--", linewidth=0.9, label="ellipsoid"))
            foot[column].legend(handles=keys, loc="upper center", borderaxespad=0, labelspacing=0.3, handlelength=1.6)
    add_letters(panels.flat)
    return figure


@dataclass(frozen=True, eq=False)
class Normals:
    """A mesh in RAS+ mm with the (n, 3) unit normals and the (n,) cortical weight at its vertices.

    `facets`, (f, 3), are the pial ones, whose vertices have arrows of another colour.
    """

    mesh: TetrahedralMesh
    normals: Floats
    weight: Floats
    facets: NDArray[np.integer]


@styled
def normal_arrows(weeks: Mapping[float, Normals], *, planes: Sequence[str] = SHOWN, synthetic: bool = False) -> Figure:
    """Returns sections with the normals of a sample of vertices near them as arrows, over the cortical weight.

    A row per week, a column per plane through the middle of the mesh, all at one scale.
    """
    for shown in weeks.values():
        _require_fitting(shown.mesh, {WEIGHT: shown.weight, "normals": shown.normals}, {})
    extents = np.max([np.ptp(shown.mesh.vertices, axis=0) for shown in weeks.values()], axis=0)
    step = float(extents.max()) / _ARROWS_ACROSS
    length = 1.3 * step
    half = extents / 2 + 1.1 * length
    wide = [half[PLANES[plane][1]] for plane in known(planes)]
    tall = max(half[PLANES[plane][2]] for plane in planes)
    each = (FULL_WIDTH_IN - 0.55 * len(planes)) * tall / sum(wide)
    height = each * len(weeks) + 0.35 + 0.55 * len(weeks) + 0.17 * synthetic
    figure = new_figure(FULL_WIDTH_IN, height, synthetic=synthetic)
    panels = figure.subplots(len(weeks), len(planes), squeeze=False, gridspec_kw={"width_ratios": wide})
    for line, (week, shown) in zip(panels, weeks.items(), strict=True):
        for axes, plane, width in zip(line, planes, wide, strict=True):
            _arrows(axes, shown, plane, (width, tall), step, length)
            across = PLANES[plane][0]
            at = _middle(shown.mesh)[across]
            axes.set_title(f"{week_label(week)}, {plane}, {'xyz'[across]} = {at:.1f} mm")
    add_letters(panels.flat)
    keys = [Patch(color=colour, label=f"normals, {name}") for name, colour in _ARROWS.items()]
    keys.append(Patch(color=mpl.colormaps["Greys"](0.5), label="cortex (weight 1; white: core, 0)"))
    figure.legend(handles=keys, loc="outside lower center", ncols=3)
    return figure


def _arrows(axes: Axes, shown: Normals, plane: str, half: tuple[float, float], step: float, length: float) -> None:
    mesh = shown.mesh
    across, right, up = PLANES[plane]
    middle = _middle(mesh)
    axes.set_xlim(middle[right] - half[0], middle[right] + half[0])
    axes.set_ylim(middle[up] - half[1], middle[up] + half[1])
    points, triangles, section = _section(_grid(mesh, {WEIGHT: shown.weight}, {}), plane)
    # half of the scale, so that arrows stand out
    cortex = section.point_data[WEIGHT][triangles].mean(axis=1)
    _draw(axes, points, triangles, cortex, mpl.colormaps["Greys"], (0.0, 2.0))
    pial = np.zeros(len(mesh.vertices), dtype=bool)
    pial[np.unique(shown.facets)] = True
    for among, colour in zip((pial, ~pial), _ARROWS.values(), strict=True):
        chosen = _sample(mesh.vertices, among, plane, middle[across], step)
        axes.quiver(
            *mesh.vertices[chosen][:, (right, up)].T, *(length * shown.normals[chosen][:, (right, up)]).T, color=colour,
            angles="xy", scale_units="xy", scale=1.0, width=0.005, headwidth=3.5, headlength=4, headaxislength=3.5,
        )  # fmt: skip
    axes.set(xlabel=AXIS_NAMES[right], ylabel=AXIS_NAMES[up])


def known(planes: Sequence[str]) -> Sequence[str]:
    """Returns the names of planes as they are; InputError for an unknown one."""
    unknown = [plane for plane in planes if plane not in PLANES]
    if unknown:
        raise InputError("unknown plane", found=unknown, expected=list(PLANES))
    return planes


def _require_fitting(mesh: TetrahedralMesh, fields: Mapping[str, Floats], tags: Mapping[str, Tag]) -> None:
    for label, values in fields.items():
        if len(values) != len(mesh.vertices):
            expected = f"{len(mesh.vertices)}, one per vertex"
            raise InputError(f"{label}: values do not fit the mesh", found=len(values), expected=expected)
    for label, (codes, names) in tags.items():
        if len(codes) != len(mesh.tets):
            expected = f"{len(mesh.tets)}, one per element"
            raise InputError(f"{label}: tags do not fit the mesh", found=len(codes), expected=expected)
        if unknown := sorted({int(code) for code in np.unique(codes)} - set(names)):
            raise InputError(f"{label}: unknown tag", found=unknown, expected=sorted(names))


def _rows(
    mesh: TetrahedralMesh, planes: Sequence[str], columns: int, synthetic: bool
) -> tuple[Figure, NDArray, NDArray]:
    """Returns a figure with its panels, a row for each plane, all at one scale, and a place for a key per column."""
    middle, half = _middle(mesh), 0.515 * np.ptp(mesh.vertices, axis=0)
    width = max(half[PLANES[plane][1]] for plane in known(planes))
    inches_per_mm = (FULL_WIDTH_IN - 0.8 - 0.1 * columns) / columns / width
    tall = [max(half[PLANES[plane][2]], _LABEL_IN / inches_per_mm) for plane in planes]
    heights = [inches_per_mm * height for height in tall] + [_FOOT_IN]
    total = sum(heights) + 0.5 + 0.12 * len(planes) + 0.17 * synthetic
    figure = new_figure(FULL_WIDTH_IN, total, synthetic=synthetic)
    panels = figure.subplots(len(heights), columns, squeeze=False, gridspec_kw={"height_ratios": heights})
    for (row, column), axes in np.ndenumerate(panels[:-1]):
        across, right, up = PLANES[planes[row]]
        axes.set_xlim(middle[right] - width, middle[right] + width)
        axes.set_ylim(middle[up] - tall[row], middle[up] + tall[row])
        last = row == len(planes) - 1 or PLANES[planes[row + 1]][1] != right
        axes.tick_params(labelbottom=last, labelleft=not column)
        if last:
            axes.set_xlabel(AXIS_NAMES[right] if columns < 3 else f"{'xyz'[right]} (mm)")
        if not column:
            axes.set_ylabel(f"{planes[row]}, {'xyz'[across]} = {middle[across]:.1f} mm\n{'xyz'[up]} (mm)")
    for axes in panels[-1]:
        axes.set_axis_off()
    return figure, panels[:-1], panels[-1]


def _limits(values: Floats) -> tuple[float, float]:
    """Returns the ends of the colour scale of a field: from zero where it is the same everywhere but for rounding."""
    low, high = float(np.min(values)), float(np.max(values))
    if goes_below_zero(values):
        return min(low, -high), max(high, -low)
    return (low, high) if high - low > ROUNDING * high else (0.0, high)


def _middle(mesh: TetrahedralMesh) -> Floats:
    return np.asarray((mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2)


def _grid(
    mesh: TetrahedralMesh, fields: Mapping[str, Floats], tags: Mapping[str, NDArray[np.integer]]
) -> pv.UnstructuredGrid:
    kind = {1: pv.CellType.TETRA, 2: pv.CellType.QUADRATIC_TETRA}[mesh.order]
    grid = pv.UnstructuredGrid({kind: np.array(mesh.tets)}, np.array(mesh.vertices))
    for name, values in fields.items():
        grid.point_data[name] = np.asarray(values, dtype=float)
    for name, codes in tags.items():
        grid.cell_data[name] = np.asarray(codes)
    return grid


def _section(grid: pv.UnstructuredGrid, plane: str) -> tuple[Floats, NDArray, pv.PolyData]:
    """Returns (k, 2) points and triangles of the section across the middle of an axis, and it with its data."""
    across, right, up = PLANES[plane]
    section = grid.slice(normal=np.eye(3)[across], origin=grid.center, generate_triangles=True)
    return np.asarray(section.points)[:, (right, up)], section.regular_faces, section


def _ranks(codes: NDArray[np.integer], names: Mapping[int, object]) -> Floats:
    """Returns the place of each code among the names."""
    order = np.array(list(names))
    return (codes[:, None] == order).argmax(axis=1).astype(float)


def _draw(
    axes: Axes, points: Floats, triangles: NDArray, values: Floats, colours: Colormap, limits: tuple[float, float]
) -> Collection:
    """Returns the section drawn into the panel, whose limits stay."""
    low, high = limits
    keep = {"xlim": axes.get_xlim(), "ylim": axes.get_ylim()}
    drawn = axes.tripcolor(
        points[:, 0],
        points[:, 1],
        triangles=triangles,
        facecolors=values,
        cmap=colours,
        vmin=low,
        vmax=high if high > low else low + 1.0,
        antialiased=False,
        rasterized=True,
    )
    axes.set(**keep)
    axes.set_aspect("equal")
    axes.xaxis.set_major_locator(mpl.ticker.MaxNLocator(5))
    axes.yaxis.set_major_locator(mpl.ticker.MaxNLocator(5))
    return drawn


def _outline(axes: Axes, ellipsoid: Ellipsoid, plane: str, position: float) -> None:
    """Draws the ellipse in which the plane at a position cuts the ellipsoid, if it does."""
    centre, semi_axes = ellipsoid
    across, right, up = PLANES[plane]
    rest = 1 - ((position - centre[across]) / semi_axes[across]) ** 2
    if rest > 0:
        size = 2 * np.sqrt(rest) * semi_axes
        for colour, line, thickness in (("white", "-", 1.6), ("black", "--", 0.9)):
            ellipse = Ellipse((centre[right], centre[up]), size[right], size[up], fill=False)
            ellipse.set(edgecolor=colour, linestyle=line, linewidth=thickness)
            axes.add_patch(ellipse)


def _sample(points: Floats, among: NDArray[np.bool_], plane: str, position: float, step: float) -> NDArray[np.int64]:
    """Returns some of the vertices near a plane: in each square of `step` mm the one nearest to it."""
    across, right, up = PLANES[plane]
    away = np.abs(points[:, across] - position)
    near = np.flatnonzero(among & (away < step / 2))
    near = near[np.argsort(away[near], kind="stable")]
    squares = np.floor(points[near][:, (right, up)] / step).astype(int)
    _, first = np.unique(squares, axis=0, return_index=True)
    return near[first]
