"""Plane sections: fields and arrows in tetrahedral meshes, outlines of surfaces over images and over each other."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import pyvista as pv
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection, LineCollection
from matplotlib.colors import Colormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch, Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import map_coordinates

from ..errors import InputError
from ..geometry.tetrahedra import TetrahedralMesh
from ..geometry.triangles import Floats, TriangleMesh, submesh
from ..parameters.terms import BETWEEN_PLANES, BRIDGE, LEFT, LEFT_CONTACT, RIGHT, RIGHT_CONTACT, ZONE_NAMES
from .labels import GROWTH, STIFFNESS, WEIGHT, week_label
from .pictures import ROUNDING, SIGNED, ZONE_COLOURS, goes_below_zero
from .style import (
    FULL_WIDTH_IN,
    MAGNITUDES,
    MUTED_COLOUR,
    REAL_BRAIN,
    REAL_COLOUR,
    RIGHT_COLOUR,
    RUN_COLOURS,
    SINGLE_COLUMN_IN,
    add_letters,
    light_grid,
    new_figure,
    run_colours,
    styled,
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
MOST_WEEKS = 5
MARGIN_MM, PIXEL_MM = 8.0, 0.25
"""Of an image, beyond the surface and between the dots."""
SCALE_BAR_MM = 20.0
ZOOM_MM = 9.0
# grey values up to this quantile of those above zero are told apart
_BRIGHTEST = 0.995
_FOOT_IN, _LABEL_IN = 0.72, 1.3
_ARROWS_ACROSS = 26
_ARROWS = {"pial vertices": RUN_COLOURS[0], "vertices inside": RUN_COLOURS[1]}
_WALLS = (LEFT_CONTACT, RIGHT_CONTACT, BETWEEN_PLANES)

Tag = tuple[NDArray[np.integer], Mapping[int, tuple[str, str]]]
Ellipsoid = tuple[Floats, Floats]


def plane_panels(
    wide: Sequence[float],
    tall: Sequence[float],
    *,
    beside_in: float,
    beyond_in: float,
    most_in: float = FULL_WIDTH_IN,
    **shown: object,
) -> tuple[Figure, NDArray]:
    """Returns a figure with a grid of panels at one scale, which is as wide as a page or less, and its panels.

    Parameters
    ----------
    wide, tall
        Widths of the columns and heights of the rows in mm.
    beside_in, beyond_in
        What the page has besides the panels, in width and in height, in inches.
    most_in
        The most that a panel may be wide, in inches.
    shown : as for `new_figure`
    """
    inches_per_mm = min((FULL_WIDTH_IN - beside_in) / sum(wide), most_in / max(wide))
    width = max(SINGLE_COLUMN_IN, beside_in + inches_per_mm * sum(wide))
    figure = new_figure(width, inches_per_mm * sum(tall) + beyond_in, **shown)  # type: ignore[arg-type]
    ratios = {"width_ratios": wide, "height_ratios": tall}
    return figure, figure.subplots(len(tall), len(wide), squeeze=False, gridspec_kw=ratios)


def known(planes: Sequence[str]) -> Sequence[str]:
    """Returns the names of planes as they are; InputError for an unknown one."""
    unknown = [plane for plane in planes if plane not in PLANES]
    if unknown:
        raise InputError("unknown plane", found=unknown, expected=list(PLANES))
    return planes


def _middle(vertices: Floats) -> Floats:
    return np.asarray((vertices.min(axis=0) + vertices.max(axis=0)) / 2)


def section_lines(surface: TriangleMesh, plane: str, at: float) -> list[Floats]:
    """Returns the (2, 2) ends of the pieces of the line in which a plane at a place in mm cuts a surface."""
    across, right, up = PLANES[plane]
    body = pv.PolyData.from_regular_faces(np.array(surface.vertices), np.array(surface.faces, dtype=int))
    cut = body.slice(normal=np.eye(3)[across], origin=np.eye(3)[across] * at)
    segments = np.asarray(cut.points)[cut.lines.reshape(-1, 3)[:, 1:]][..., [right, up]]
    return list(segments)


def draw_outline(
    axes: Axes, surface: TriangleMesh, plane: str, at: float, colour: str = RUN_COLOURS[4], thickness: float = 0.8
) -> None:
    """Draws the lines in which a plane cuts a surface."""
    lines = section_lines(surface, plane, at)
    axes.add_collection(LineCollection(lines, colors=colour, linewidths=thickness, capstyle="round"))


def plane_grid(plane: str, at: float, low: Floats, high: Floats) -> tuple[Floats, tuple[float, float, float, float]]:
    """Returns the (rows, columns, 3) points of a picture of a plane, and its left, right, lower and upper end in mm."""
    across, right, up = PLANES[plane]
    begin, end = low - MARGIN_MM, high + MARGIN_MM
    columns, rows = (np.arange(begin[axis], end[axis], PIXEL_MM) for axis in (right, up))
    points = np.empty((len(rows), len(columns), 3))
    points[..., across], points[..., right], points[..., up] = at, columns[None], rows[:, None]
    return points, (begin[right], columns[-1] + PIXEL_MM, begin[up], rows[-1] + PIXEL_MM)


def draw_image(axes: Axes, values: Floats, affine: ArrayLike, plane: str, at: float, low: Floats, high: Floats) -> None:
    """Draws a volume in grey in a plane, within the box of a surface and a margin.

    Parameters
    ----------
    values : (i, j, k) float
    affine : (4, 4) float
        Voxel index to position in mm.
    """
    lit = values[np.isfinite(values) & (values > 0)]
    brightest = float(np.quantile(lit, _BRIGHTEST)) if lit.size else 1.0
    points, extent = plane_grid(plane, at, low, high)
    grey = map_coordinates(np.nan_to_num(values), voxel_index(points, np.asarray(affine, dtype=float)), order=1)
    axes.imshow(grey, cmap="gray", vmin=0, vmax=brightest, origin="lower", extent=extent, interpolation="none")


def voxel_index(points: Floats, affine: Floats) -> Floats:
    """Returns the (3, rows, columns) indices of voxels at (rows, columns, 3) places."""
    inverse = np.linalg.inv(affine)
    return np.moveaxis(points @ inverse[:3, :3].T + inverse[:3, 3], -1, 0)


@styled
def surface_overlay(values: Floats, affine: ArrayLike, surface: TriangleMesh, *, synthetic: bool = False) -> Figure:
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
    spans = np.array([(high - low)[list(PLANES[plane][1:])] + 2 * MARGIN_MM for plane in PLANES])
    # beside and above the panels is room for words
    figure, grid = plane_panels(
        list(spans[:, 0]), [spans[:, 1].max()], beside_in=1.7, beyond_in=0.9, synthetic=synthetic
    )
    for axes, plane in zip(grid[0], PLANES, strict=True):
        across, right, up = PLANES[plane]
        draw_image(axes, values, affine, plane, at[plane], low, high)
        draw_outline(axes, surface, plane, at[plane])
        _, extent = plane_grid(plane, at[plane], low, high)
        axes.set(xlabel=AXIS_NAMES[right], ylabel=AXIS_NAMES[up], xlim=extent[:2], ylim=extent[2:], aspect="equal")
        axes.set_title(f"{plane}, {'xyz'[across]} = {at[plane]:.1f} mm")
    add_letters(grid[0])
    return figure


@styled
def outlines_chart(
    runs: Mapping[str, Mapping[float, TriangleMesh]],
    real: Mapping[float, TriangleMesh],
    *,
    planes: Sequence[str] = tuple(PLANES),
    measured: str = REAL_BRAIN,
    synthetic: bool = False,
) -> Figure:
    """Returns the outlines of runs over those of the measured brain, a row per plane, a column per week.

    The coronal and axial planes pass the middle of the measured brain, the sagittal one its right hemisphere. All
    panels have one scale. Of many weeks the last ones are shown.

    Parameters
    ----------
    runs : {run: {week: surface in RAS+ mm, laid onto the measured one}}
    real : {week: measured surface in RAS+ mm}
    """
    weeks, colours = sorted(real)[-MOST_WEEKS:], run_colours(runs)
    drawn = [known[week] for known in (real, *runs.values()) for week in weeks if week in known]
    low = np.min([mesh.vertices.min(axis=0) for mesh in drawn], axis=0) - 1
    high = np.max([mesh.vertices.max(axis=0) for mesh in drawn], axis=0) + 1
    wide = max((high - low)[PLANES[plane][1]] for plane in known(planes))
    tall = [(high - low)[PLANES[plane][2]] for plane in planes]
    shown: dict[str, Any] = {"measured": measured, "synthetic": synthetic}
    figure, panels = plane_panels([wide] * len(weeks), tall, beside_in=0.7, beyond_in=0.9, most_in=2.3, **shown)
    for line, plane in zip(panels, planes, strict=True):
        across, right, up = PLANES[plane]
        centre = (low[right] + high[right]) / 2
        # a sagittal plane in the middle would show the fissure alone
        part = 0.75 if plane == "sagittal" else 0.5
        for axes, week in zip(line, weeks, strict=True):
            ends = real[week].vertices[:, across].min(), real[week].vertices[:, across].max()
            at = float(ends[0] + part * (ends[1] - ends[0]))
            # wide enough to be seen under a run that meets it
            draw_outline(axes, real[week], plane, at, REAL_COLOUR, 1.7)
            for run in runs:
                if week in runs[run]:
                    draw_outline(axes, runs[run][week], plane, at, colours[run], 0.8)
            axes.set(xlim=(centre - wide / 2, centre + wide / 2), ylim=(low[up], high[up]), aspect="equal")
            axes.set_axis_off()
            if axes is line[0]:
                axes.text(-0.02, 0.5, plane, transform=axes.transAxes, rotation=90, ha="right", va="center")
            if plane == planes[0]:
                axes.set_title(week_label(week), fontsize=8)
    foot = panels[-1, 0]
    start, bottom = foot.get_xlim()[0] + 2, low[PLANES[planes[-1]][2]]
    foot.plot([start, start + SCALE_BAR_MM], [bottom] * 2, color="black", linewidth=2, clip_on=False)
    foot.text(start, bottom - 1, f"{SCALE_BAR_MM:g} mm", va="top", fontsize=7)
    add_letters(panels[:, 0] if len(planes) > 1 and len(weeks) > 1 else panels.flat)
    named = {**colours, measured: REAL_COLOUR}
    handles = [Line2D([], [], color=colour, label=label) for label, colour in named.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def region_sections(
    mesh: TetrahedralMesh,
    fields: Mapping[str, Floats],
    tags: Mapping[str, NDArray[np.integer]],
    ellipsoid: Ellipsoid | None,
    *,
    synthetic: bool = False,
) -> Figure:
    """Returns coronal and axial sections with the hemispheres, what grows, cortex, growth, and stiffness.

    Fields at vertices, tags of elements, and the ellipsoid are those of the folding's regions.
    """
    return cross_sections(
        mesh,
        {
            WEIGHT: fields["cortex_weight"],
            GROWTH: fields["tangential_growth_percent_per_gw"],
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
            scale: Colormap
            if name in tags:
                names = tags[name][1]
                values = _ranks(section.cell_data[name], names)
                limits, scale = (-0.5, len(names) - 0.5), ListedColormap([colour for _, colour in names.values()])
            else:
                values = section.point_data[name][triangles].mean(axis=1)
                scale = mpl.colormaps[SIGNED if goes_below_zero(fields[name]) else MAGNITUDES]
                limits = _limits(fields[name])
            drawn = _draw(axes, points, triangles, values, scale, limits)
            if panels.shape[1] > 3:
                axes.xaxis.set_major_locator(MaxNLocator(2))
            if ellipsoid:
                _outline(axes, ellipsoid, plane, _middle(mesh.vertices)[PLANES[plane][0]])
        if name in fields:
            bar = figure.colorbar(drawn, cax=foot[column].inset_axes((0.05, 0.8, 0.9, 0.1)), orientation="horizontal")
            bar.set_label(wrap(name, letters + 6), fontsize=7)
            bar.ax.xaxis.set_major_locator(MaxNLocator(nbins=3))
        else:
            codes, named = tags[name]
            there = set(map(int, np.unique(codes)))
            keys: list[Artist] = [Patch(color=named[code][1], label=named[code][0]) for code in named if code in there]
            if ellipsoid and name == list(tags)[-1]:
                keys.append(Line2D([], [], color="black", linestyle="--", linewidth=0.9, label="ellipsoid"))
            foot[column].legend(handles=keys, loc="upper center", borderaxespad=0, labelspacing=0.3, handlelength=1.6)
    add_letters(panels.flat)
    return figure


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
    middle, half = _middle(mesh.vertices), 0.515 * np.ptp(mesh.vertices, axis=0)
    width = max(half[PLANES[plane][1]] for plane in known(planes))
    beside_in = 0.8 + 0.1 * columns
    mm_per_inch = columns * width / (FULL_WIDTH_IN - beside_in)
    tall = [max(half[PLANES[plane][2]], _LABEL_IN * mm_per_inch) for plane in planes]
    beyond_in = 0.5 + 0.12 * len(planes) + 0.17 * synthetic
    figure, panels = plane_panels(
        [width] * columns,
        [*tall, _FOOT_IN * mm_per_inch],
        beside_in=beside_in,
        beyond_in=beyond_in,
        synthetic=synthetic,
    )
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
    """Returns the section across the middle of an axis: its (k, 2) points, its triangles, and all data."""
    across, right, up = PLANES[plane]
    section = grid.slice(normal=np.eye(3)[across], origin=grid.center, generate_triangles=True)
    return np.asarray(section.points)[:, (right, up)], section.regular_faces, section


def _ranks(codes: NDArray[np.integer], names: Mapping[int, object]) -> Floats:
    """Returns the place of each code among the names."""
    return (codes[:, None] == np.array(list(names))).argmax(axis=1).astype(float)


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
    axes.set(**keep, aspect="equal")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.yaxis.set_major_locator(MaxNLocator(5))
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
    beyond_in = 0.35 + 0.55 * len(weeks) + 0.17 * synthetic
    figure, panels = plane_panels(
        wide, [tall] * len(weeks), beside_in=0.55 * len(planes), beyond_in=beyond_in, synthetic=synthetic
    )
    for line, (week, shown) in zip(panels, weeks.items(), strict=True):
        for axes, plane, width in zip(line, planes, wide, strict=True):
            _arrows(axes, shown, plane, (width, tall), step, length)
            across = PLANES[plane][0]
            at = _middle(shown.mesh.vertices)[across]
            axes.set_title(f"{week_label(week)}, {plane}, {'xyz'[across]} = {at:.1f} mm")
    add_letters(panels.flat)
    keys = [Patch(color=colour, label=f"normals, {name}") for name, colour in _ARROWS.items()]
    keys.append(Patch(color=mpl.colormaps["Greys"](0.5), label="cortex (weight 1; white: core, 0)"))
    figure.legend(handles=keys, loc="outside lower center", ncols=3)
    return figure


def _arrows(axes: Axes, shown: Normals, plane: str, half: tuple[float, float], step: float, length: float) -> None:
    mesh = shown.mesh
    across, right, up = PLANES[plane]
    middle = _middle(mesh.vertices)
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


def _sample(points: Floats, among: NDArray[np.bool_], plane: str, position: float, step: float) -> NDArray[np.int64]:
    """Returns some of the vertices near a plane: in each square of `step` mm the one nearest to it."""
    across, right, up = PLANES[plane]
    away = np.abs(points[:, across] - position)
    near = np.flatnonzero(among & (away < step / 2))
    near = near[np.argsort(away[near], kind="stable")]
    squares = np.floor(points[near][:, (right, up)] / step).astype(int)
    _, first = np.unique(squares, axis=0, return_index=True)
    return near[first]


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
    touching = [code for code in _WALLS if planes_mm and (zones == code).any()]
    for axes in (whole, zoom):
        for code in np.unique(zones):
            part, _ = submesh(mesh, zones == code)
            wall = code in touching
            draw_outline(axes, part, "axial", at, ZONE_COLOURS[int(code)] if wall else "black", 1.8 if wall else 0.8)
        axes.set(xlabel="x: left − to right + (mm)", aspect="equal")
    whole.set(xlim=(low[0] - 2, high[0] + 2), ylim=(low[1] - 2, high[1] + 2), ylabel="y (mm)")
    middle = sum(planes_mm) / 2 if planes_mm else float((low[0] + high[0]) / 2)
    centre = _facing(mesh, at, middle)
    left, bottom = middle - ZOOM_MM / 2, centre - ZOOM_MM / 2
    zoom.set(xlim=(left, left + ZOOM_MM), ylim=(bottom, bottom + ZOOM_MM))
    whole.add_patch(Rectangle((left, bottom), ZOOM_MM, ZOOM_MM, fill=False, edgecolor=MUTED_COLOUR, linewidth=0.8))
    handles = [Line2D([], [], color=ZONE_COLOURS[code], linewidth=2, label=ZONE_NAMES[code]) for code in touching]
    if planes_mm:
        for side, plane in zip((-1, 1), planes_mm, strict=True):
            for axes in (whole, zoom):
                axes.axvline(plane, color="black", linestyle="--", linewidth=0.8)
            _arrow(zoom, plane, plane + side * 1.3, centre)
            place: dict[str, Any] = {"ha": "right" if side < 0 else "left", "va": "center", "fontsize": 6.5}
            zoom.text(plane + side * 1.4, centre, "pressure", **place)
        zoom.set_title("a wall beyond its plane\nis pressed back", fontsize=7)
        handles.append(Line2D([], [], color="black", linestyle="--", linewidth=0.8, label="rigid planes"))
    else:
        zoom.set_title(f"walls repel each other\nonce nearer than {distance}", fontsize=7)
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


def _arrow(axes: Axes, start: float, end: float, y: float) -> None:
    axes.annotate("", (end, y), (start, y), arrowprops={"arrowstyle": "->", "linewidth": 1.0})


def _facing(mesh: TriangleMesh, at: float, middle: float) -> float:
    """Returns where along y walls of the fissure face each other: the middle of the longest stretch near the plane."""
    points = np.concatenate([np.reshape(line, (-1, 2)) for line in section_lines(mesh, "axial", at)])
    near = points[np.abs(points[:, 0] - middle) < 0.3 * ZOOM_MM][:, 1]
    # back of the brain, where the fissure is open
    return float(np.quantile(near, 0.2)) if len(near) else float(np.median(points[:, 1]))
