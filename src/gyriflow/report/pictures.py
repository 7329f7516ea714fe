"""Pictures of surfaces: simulated and observed brains, maps, regions and zones."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..geometry.triangles import Floats, TriangleMesh, face_areas, merged
from ..quantities import SIGNED_COLOURS, VERTEX_MAPS, name_in_interval
from ..settings.folding import AXES, FoldingParameters
from ..settings.terms import ZONE_NAMES
from ..units import CM2_PER_MM2
from .labels import column_label, map_title, value_labels
from .panels import MAX_COLUMNS, Panel, Row, panel_grid
from .scene import (
    MAP,
    TISSUE,
    UNKNOWN_COLOUR,
    VIEWS,
    View,
    colour_scale,
    half_extents,
    paint,
    render,
    restricted,
    uniform_colours,
)
from .style import (
    NEUTRAL_COLOUR,
    OBSERVED_SURFACE_COLOUR,
    RIGHT_COLOUR,
    SIMULATED_SURFACE_COLOUR,
    region_colours,
    styled,
)

SurfaceMaps = tuple[TriangleMesh, Mapping[str, Floats]]
"""A surface in RAS+ mm and its maps per vertex by name."""
Halves = Sequence[SurfaceMaps]
"""The hemispheres of a brain, each with its maps."""

SIDE_VIEWS = ("left", "top")
OUTER_VIEWS = ("left", "top", "bottom")
ROUND_VIEWS = ("left", "right", "top", "bottom")
BRAIN_VIEWS = ("left", "right", "top", "left medial", "right medial")
MEDIAL_VIEWS = ("left", "bottom", "left medial", "right medial")
ROUNDING = 1e-9
DIRECTION_QUANTILE = 0.9
"""Quantile of the lengths of directions above which all lines are equally long."""
ABSENT = "ended\nbefore\nthis week"
"""Text in place of a run that ended before the week."""
ZONE_COLOURS = {
    "free": "#D55E00",
    "clamped": "#009E73",
    "left contact": "#0072B2",
    "right contact": RIGHT_COLOUR,
    "between planes": "#CC79A7",
    "base": "#999999",
    "side x": "#56B4E9",
    "side y": "#E69F00",
    "medial wall": "#8C6D31",
}
"""Colours of the boundary's zones, near the paper's red, green, blue, yellow and
purple."""
DEEP_MM = 5.0
"""Upper end of the depth scale of observed brains, the same on all pages."""
SMALL_PER_MM, SMALL_PER_INCH = 4.0, 400
"""Small pictures: dots per mm of the brain and per inch of print."""


@dataclass(frozen=True, eq=False)
class GridBrain:
    """A brain of a grid, and where it stands.

    `row` is the label of its row, `column` a week, an interval of two weeks, or a name.
    `halves` are its hemispheres, or its whole surface, with their maps; empty if it has
    ended before. A brain without maps is blue if it is simulated, else beige, or has
    its own `colours` (n, 3) of vertices or (m, 3) of faces. `light`, `mark`,
    `directions` and the caption are those of its `Panel`.
    """

    row: str
    column: Any
    halves: Sequence[tuple[TriangleMesh, Any]] = ()
    is_simulated: bool = False
    view: View = VIEWS["left"]
    colours: Floats | None = None
    light: Mapping[str, Any] = field(default_factory=lambda: TISSUE)
    caption: str = ""
    mark: int | None = None
    directions: Floats | None = None

    @property
    def surface(self) -> TriangleMesh:
        mesh, _ = whole_maps(self.halves, [])
        return mesh


Grid = Sequence[GridBrain]


def _brain_grid(
    grid: Grid,
    quantity: str = "",
    *,
    title: str = "",
    legend: Sequence[Patch] = (),
    absent: str = "",
    limit: float | None = None,
    at_page_scale: bool = False,
) -> Figure:
    """Draw brains in their rows and columns, in the order in which these occur.

    Brains with maps have the colours of a quantity, a name of `VERTEX_MAPS`, on one
    scale with the `title` (default: that of the map), from 0 to `limit` if that is
    given. `absent` is the text where a row has no brain; `at_page_scale` that of
    `panel_grid`.
    """
    # each brain once, in however many views it is
    mapped = {id(brain.halves): brain.halves for brain in grid if _has_maps(brain)}
    scale = None
    colour_bar = None
    if quantity and mapped:
        values = [
            whole_maps(
                halves,
                [quantity],
            )[1]
            for halves in mapped.values()
        ]
        every = np.concatenate([maps[quantity] for maps in values])
        scale = scale_of(quantity, every)
        if limit is not None:
            colours = VERTEX_MAPS[quantity].colours
            scale = colour_scale(colours, 0.0, limit, cut=True)
        colour_bar = (scale, title or map_title(quantity))
        if not np.isfinite(every).all():
            legend = [*legend, Patch(color=UNKNOWN_COLOUR, label="not measured")]
    columns = list(dict.fromkeys(brain.column for brain in grid))
    rows = []
    for label in dict.fromkeys(brain.row for brain in grid):
        panels = {}
        for brain in grid:
            if brain.row == label:
                panels[brain.column] = _panel(brain, quantity, scale)
        rows.append(
            Row(
                label,
                [panels.get(column) for column in columns],
                absent,
            )
        )
    return panel_grid(
        columns,
        rows,
        colour_bar=colour_bar,
        legend=legend,
        at_page_scale=at_page_scale,
    )


def _has_maps(brain: GridBrain) -> bool:
    return any(maps for _, maps in brain.halves)


def _panel(
    brain: GridBrain,
    quantity: str,
    scale: ScalarMappable | None,
) -> Panel | None:
    """Return a brain in its view and colours, None if it has no surface."""
    if not brain.halves:
        return None
    if scale is not None and _has_maps(brain):
        mesh, maps = whole_maps(brain.halves, [quantity])
        colours = paint(maps[quantity], scale)
        light: Mapping[str, Any] = MAP
    else:
        mesh = brain.surface
        plain = OBSERVED_SURFACE_COLOUR
        if brain.is_simulated:
            plain = SIMULATED_SURFACE_COLOUR
        colours = uniform_colours(mesh, plain)
        if brain.colours is not None:
            colours = brain.colours
        light = brain.light
    return Panel(
        mesh, colours, brain.view, brain.caption, light, brain.mark, brain.directions
    )


def _in_views(
    grid: Grid,
    views: Sequence[str] = SIDE_VIEWS,
) -> list[GridBrain]:
    """Return brains from several views, a column per week, interval or name.

    Weeks and intervals are sorted, names in their order. Each row has all views, or is
    repeated for each view where all would be too wide. Captions are below the first
    view.
    """
    columns = list(dict.fromkeys(brain.column for brain in grid))
    if not any(isinstance(column, str) for column in columns):
        columns.sort()
    is_wide = len(views) * len(columns) > MAX_COLUMNS
    places = {(brain.row, brain.column): brain for brain in grid}
    seen = []
    for name in views:
        for row in dict.fromkeys(brain.row for brain in grid):
            for column in columns:
                brain = places.get(
                    (row, column),
                    GridBrain(row, column),
                )
                heading, label = column_label(column), row
                if is_wide:
                    label = f"{row}\n{name} view".strip()
                else:
                    heading = f"{heading}\n{name} view"
                caption = brain.caption if name == views[0] else ""
                brain = replace(brain, row=label, column=heading, caption=caption)
                seen.append(replace(brain, view=VIEWS[name]))
    return seen


# brains by week


@styled
def inputs_figure(grid: Grid) -> Figure:
    """Draw the first and the last brain of a study."""
    return _brain_grid(_in_views(grid, OUTER_VIEWS))


predicted_figure = inputs_figure
"""The start brain, the predicted one, and the atlas' own brain."""


@styled
def weekly_figure(grid: Grid) -> Figure:
    """Draw the brains of several runs (blue) above observed ones (beige) by week."""
    return _brain_grid(_in_views(grid))


@styled
def expected_figure(grid: Grid) -> Figure:
    """Draw expected brains above observed ones by week, and below the distance between
    them (map `distance_mm`)."""
    return _brain_grid(_in_views(grid), "distance_mm")


@styled
def displacement_maps(
    frames: Sequence[Mapping[float, SurfaceMaps]],
    *,
    runs: Sequence[str],
) -> Figure:
    """Draw the norm of the displacement of runs on the pial surface, a column per
    interval, on one colour scale.

    `frames` are for each of the `runs` by week the surface in RAS+ mm and its fields.
    One vertex in two hundred is above the scale, so that a single maximum does not
    determine it. The maximum has a ring, dotted on the far side; the caption of each
    interval has its size, its position in RAS+ mm, and the mean over the vertices.
    """
    grid = []
    for run, weeks in zip(runs, frames, strict=True):
        for before, week in pairwise(sorted(weeks)):
            mesh, _ = weeks[week]
            moved = mesh.vertices - weeks[before][0].vertices
            norms = np.linalg.norm(moved, axis=1)
            largest = int(norms.argmax())
            place = [f"{value:z.0f}" for value in mesh.vertices[largest]]
            caption = (
                f"max {norms[largest]:.2f} mm\nat {', '.join(place)}\n"
                f"mean {norms.mean():.2f} mm"
            ).replace("-", "−")
            grid.append(
                GridBrain(
                    run,
                    (before, week),
                    [(mesh, {"displacement_mm": norms})],
                    caption=caption,
                    mark=largest,
                )
            )
    title = "norm of the displacement (mm)"
    return _brain_grid(_in_views(grid), "displacement_mm", title=title)


def _round_up(value: float) -> float:
    """Return a positive value rounded up to two digits, as the end of a colour bar."""
    step = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(np.ceil(value / step - 1e-9) * step)


def scale_of(quantity: str, values: Floats) -> ScalarMappable:
    """Return the colour scale of a map of `VERTEX_MAPS`, with its own limits or from a
    quantile of the values.

    The scale begins at zero. For signed maps, or if any value is negative, it is
    symmetric and pale at zero. It ends at a round value above the map's quantile, so
    that outliers do not determine it.
    """
    record = VERTEX_MAPS[quantity]
    if record.limits is not None:
        return colour_scale(record.colours, *record.limits)
    finite = values[np.isfinite(values)]
    # below zero by more than rounding
    rounding = ROUNDING * np.abs(finite).max(initial=0.0)
    signed = record.is_signed or finite.min(initial=0.0) < -rounding
    sizes = np.abs(finite) if signed else finite
    high = (
        float(
            np.quantile(
                sizes,
                record.quantile,
            )
        )
        if len(sizes)
        else 0.0
    )
    end = _round_up(high) if high > 0 else 1.0
    is_cut = bool((sizes > end).any())
    if signed:
        return colour_scale(SIGNED_COLOURS, -end, end, cut=is_cut)
    return colour_scale(record.colours, 0.0, end, cut=is_cut)


def whole_maps(
    halves: Halves,
    names: Iterable[str] | None = None,
) -> SurfaceMaps:
    """Return the hemispheres of a brain as one surface, with the maps that all of them
    have.

    `names` are the maps to return instead, NaN on a hemisphere that lacks one.
    """
    if names is None:
        names = [
            name for name in halves[0][1] if all(name in maps for _, maps in halves)
        ]
    values = {}
    for name in names:
        parts = []
        for mesh, maps in halves:
            parts.append(
                maps.get(
                    name,
                    np.full(len(mesh.vertices), np.nan),
                )
            )
        values[name] = np.concatenate(parts)
    return merged(*(mesh for mesh, _ in halves)), values


# maps


@styled
def shape_maps(grid: Grid) -> Figure:
    """Draw the shape index of simulated and observed brains by week."""
    return _brain_grid(_in_views(grid), "shape_index")


@styled
def brain_depth(halves: Halves, *, sides: Sequence[str]) -> Figure:
    """Draw the sulcal depth of a brain, at the scale and in the colours of all brains'
    pages; `sides` are those of its `halves`."""
    grid = _views_of_brain(halves, sides)
    return _brain_grid(grid, "sulcal_depth_mm", limit=DEEP_MM, at_page_scale=True)


@styled
def brain_maps(halves: Halves, *, sides: Sequence[str]) -> Figure:
    """Draw the shape index of a brain at the scale of all brains' pages; `sides` are
    those of its `halves`."""
    return _brain_grid(
        _views_of_brain(halves, sides), "shape_index", at_page_scale=True
    )


def _views_of_brain(
    halves: Halves,
    sides: Sequence[str],
) -> list[GridBrain]:
    """Return a brain from outside, from above, and the inner face of each
    hemisphere."""
    grid = []
    for name in BRAIN_VIEWS:
        view = VIEWS[name]
        shown = [
            half
            for side, half in zip(sides, halves, strict=True)
            if view.hemisphere in ("", side)
        ]
        if shown:
            grid.append(GridBrain("", name, shown, view=view))
    return grid


@styled
def position_spread_figure(grid: Grid) -> Figure:
    """Draw the standard deviation of positions over an ensemble by week."""
    return _brain_grid(_in_views(grid), "position_sd_mm")


@styled
def sulcus_probability_figure(grid: Grid) -> Figure:
    """Draw the share of an ensemble's members that have a sulcus, by week."""
    return _brain_grid(_in_views(grid), "sulcus_probability")


@styled
def deviation_figure(grid: Grid, *, quantity: str) -> Figure:
    """Draw how observed brains deviate from expected ones in a quantity, by week."""
    return _brain_grid(_in_views(grid, ROUND_VIEWS), quantity)


@styled
def influence_figure(
    grid: Grid,
    *,
    values: Mapping[str, Mapping[str, Any]],
) -> Figure:
    """Draw the surfaces of the runs of a sweep at one week, and below their shape index
    on one scale.

    The columns are runs, in the order of the sweep, and the observed brain of the week,
    last. `values` are by run the varied parameters with their values, for the headings.
    """
    headings = dict(
        zip(
            values,
            value_labels(list(values.values())),
            strict=True,
        )
    )
    placed = []
    for label in ("", "shape index\n"):
        for view in SIDE_VIEWS:
            for brain in grid:
                column = headings.get(brain.column, brain.column)
                brain = replace(
                    brain,
                    row=f"{label}{view} view",
                    column=column,
                )
                if not label:
                    plain: Halves = [(mesh, {}) for mesh, _ in brain.halves]
                    brain = replace(brain, halves=plain)
                placed.append(replace(brain, view=VIEWS[view]))
    return _brain_grid(placed, "shape_index", absent=ABSENT)


# growth


@styled
def growth_found_figure(
    frames: Mapping[float, SurfaceMaps], growth: Mapping[str, Floats]
) -> Figure:
    """Draw the growth in area by which a run approached its target shapes."""
    return _growth_grid(frames, growth, "area_growth_percent_per_gw")


growth_sd_figure = growth_found_figure
"""The standard deviation of growth in area over the members of an ensemble."""


@styled
def growth_across_figure(
    frames: Mapping[float, SurfaceMaps], growth: Mapping[str, Floats]
) -> Figure:
    """Draw the growth across the surface by which a run approached its target
    shapes."""
    return _growth_grid(frames, growth, "thickness_growth_percent_per_gw")


def _growth_grid(
    frames: Mapping[float, SurfaceMaps],
    growth: Mapping[str, Floats],
    quantity: str,
) -> Figure:
    """Draw a quantity of growth on the surface at the end of each interval.

    `frames` are by week the surface in RAS+ mm and its fields; `growth` are the maps of
    `growth.rates.growth_per_week`, with their intervals in the names. Lines run along
    the largest growth in the surface, in proportion to its excess over the growth
    across it; the longest tenth have the same length. Maps without directions, as of
    standard deviations, have no lines.
    """
    intervals = list(pairwise(sorted(frames)))
    directions = {}
    for interval in intervals:
        names = [
            name_in_interval(f"growth_direction_{axis}", *interval) for axis in AXES
        ]
        if names[0] in growth:
            directions[interval] = np.stack(
                [growth[name] for name in names],
                axis=1,
            )
    if directions:
        every = np.concatenate(list(directions.values()))
        longest = np.quantile(
            np.linalg.norm(every, axis=1),
            DIRECTION_QUANTILE,
        )
        directions = {key: lines / longest for key, lines in directions.items()}
    grid = []
    for interval in intervals:
        mesh, _ = frames[interval[1]]
        maps = {quantity: growth[name_in_interval(quantity, *interval)]}
        brain = GridBrain(
            "growth", interval, [(mesh, maps)], directions=directions.get(interval)
        )
        grid.append(brain)
    return _brain_grid(_in_views(grid, OUTER_VIEWS), quantity)


@styled
def small_pictures(halves: Halves, *, side: str) -> Figure:
    """Draw a small picture without text: shape index from a side, and depth from above,
    0 to `DEEP_MM`.

    All brains have one scale.
    """
    mesh, maps = whole_maps(halves, ("shape_index", "sulcal_depth_mm"))
    depth = colour_scale(VERTEX_MAPS["sulcal_depth_mm"].colours, 0.0, DEEP_MM)
    views = {
        side: ("shape_index", scale_of("shape_index", np.empty(0))),
        "top": ("sulcal_depth_mm", depth),
    }
    extents = {view: half_extents(mesh, VIEWS[view]) for view in views}
    tall = 1.05 * max(height for _, height in extents.values())
    images = [
        render(
            mesh,
            paint(maps[name], scale),
            VIEWS[view],
            (1.05 * extents[view][0], tall),
            SMALL_PER_MM,
            light=MAP,
        )
        for view, (name, scale) in views.items()
    ]
    image = np.hstack(images)
    figure = Figure(
        figsize=(image.shape[1] / SMALL_PER_INCH, image.shape[0] / SMALL_PER_INCH)
    )
    axes = figure.add_axes((0, 0, 1, 1))
    axes.imshow(image)
    axes.set_axis_off()
    return figure


@styled
def brain_regions(grid: Grid) -> Figure:
    """Draw brains coloured by region, a column per brain and a row per view, with the
    regions' names.

    In place of maps, the hemispheres have the numbers of their vertices' regions and
    the names by number. Numbers without a name mean no region.
    """
    names: list[str] = []
    has_unnamed = False
    for brain in grid:
        for _, (numbers, table) in brain.halves:
            names += table.values()
            has_unnamed |= not np.isin(numbers, list(table)).all()
    colours = region_colours(names)
    legend = [
        Patch(
            color=colour,
            label=name,
        )
        for name, colour in colours.items()
    ]
    if has_unnamed:
        legend.append(Patch(color=NEUTRAL_COLOUR, label="no region"))
    placed = []
    for view in ROUND_VIEWS:
        for brain in grid:
            painted = _painted_regions(brain.halves, colours)
            brain = replace(
                brain,
                row=f"{view} view",
                colours=painted,
            )
            placed.append(replace(brain, view=VIEWS[view]))
    return _brain_grid(placed, legend=legend)


regions_figure = brain_regions
"""The regions of observed and simulated brains, beside each other."""


def _painted_regions(
    halves: Sequence[tuple[TriangleMesh, Any]],
    colours: Mapping[str, Any],
) -> Floats:
    """Return the colours of the vertices of all hemispheres."""
    painted = []
    for mesh, (numbers, table) in halves:
        shades = uniform_colours(mesh, NEUTRAL_COLOUR)
        for number, name in table.items():
            shades[numbers == number] = colours[name]
        painted.append(shades)
    return np.concatenate(painted)


@styled
def zones_figure(
    boundary: tuple[TriangleMesh, Mapping[str, NDArray[np.integer]]],
    parameters: FoldingParameters,
) -> Figure:
    """Draw the zones of the brain's boundary from several sides, with their areas.

    `boundary` is the surface in RAS+ mm and the tags (m,) of its faces, where `zone` is
    an index into `ZONE_NAMES`; `fissure_x_mm` of the parameters separates the
    hemispheres in medial views.
    """
    mesh, tags = boundary
    zones = tags["zone"]
    colours = to_rgba_array([ZONE_COLOURS[name] for name in ZONE_NAMES])[:, :3]
    areas_mm2 = np.bincount(
        zones,
        face_areas(mesh),
        minlength=len(colours),
    )
    legend = []
    for name, colour, area_mm2 in zip(
        ZONE_NAMES,
        colours,
        areas_mm2,
        strict=True,
    ):
        if area_mm2:
            label = f"{name} {CM2_PER_MM2 * area_mm2:.1f} cm²"
            legend.append(Patch(color=colour, label=label))
    grid = []
    for name in MEDIAL_VIEWS:
        view = VIEWS[name]
        part, shades = restricted(
            mesh, colours[zones], view.hemisphere, parameters.fissure_x_mm
        )
        # a brain of one hemisphere has no medial view of the other
        if len(part.faces):
            brain = GridBrain(
                "",
                f"{name} view",
                [(part, {})],
                view=view,
                light=MAP,
            )
            grid.append(replace(brain, colours=shades))
    return _brain_grid(grid, legend=legend)
