"""Pictures of surfaces: simulated and observed brains, maps, regions and zones."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import cycle, pairwise
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import to_rgb, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..geometry.triangles import Floats, Ints, TriangleMesh, face_areas, merged
from ..quantities import SIGNED_COLOURS, VERTEX_MAPS, name_in_interval
from ..settings.folding import AXES, FoldingParameters
from ..settings.terms import OBSERVED_BRAIN, ZONE_NAMES
from ..units import CM2_PER_MM2
from .labels import column_label, map_title, value_labels
from .panels import MAX_COLUMNS, Panel, Row, panel_grid, plain_panel
from .scene import (
    MAP,
    UNKNOWN_COLOUR,
    VIEWS,
    View,
    colour_scale,
    half_extents,
    paint,
    render,
    restricted,
)
from .style import (
    NEUTRAL_COLOUR,
    OBSERVED_SURFACE_COLOUR,
    RIGHT_COLOUR,
    RUN_COLOURS,
    SIMULATED_SURFACE_COLOUR,
    styled,
)

SurfaceMap = tuple[TriangleMesh, Floats]
"""A surface in RAS+ mm and a value per vertex."""
SurfaceMaps = tuple[TriangleMesh, Mapping[str, Floats]]
"""A surface in RAS+ mm and its maps per vertex by name."""
Halves = Sequence[SurfaceMaps]
"""The hemispheres of a brain, each with its maps."""

SIDE_VIEWS = ("left", "top")
ROUND_VIEWS = ("left", "right", "top", "bottom")
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
SMALL_DEEP_MM, SMALL_PER_MM, SMALL_PER_INCH = 5.0, 4.0, 400
"""Small pictures: upper end of the depth scale, and dots per mm of the brain and per
inch of print."""
TINTS = (0.0, 0.4, 0.7)
"""Shares of white in the colours of further regions."""


def _ordered(*groups: Mapping) -> list:
    """Return the keys of all groups: weeks and intervals sorted, names in their
    order."""
    keys = list(dict.fromkeys(key for group in groups for key in group))
    return keys if any(isinstance(key, str) for key in keys) else sorted(keys)


def _mapped(
    surface_map: SurfaceMap, scale: ScalarMappable, directions: Floats | None = None
) -> Panel:
    mesh, values = surface_map
    return Panel(mesh, paint(values, scale), light=MAP, directions=directions)


def brain_grid(
    groups: Mapping[str, Mapping[Any, Panel]], views: Sequence[str], **more: Any
) -> Figure:
    """Draw groups of brains from several views, a column per week, interval or name;
    `more` for `panel_grid`.

    A group has a row with all views, or a row per view where these are too wide.
    Captions are below the first view.
    """
    keys, seen = _ordered(*groups.values()), [VIEWS[name] for name in views]
    heads = list(map(column_label, keys))

    if len(seen) * len(keys) <= MAX_COLUMNS:
        rows = [
            Row(
                name,
                [
                    panel
                    for view in seen
                    for panel in _seen(group, keys, view, with_caption=view == seen[0])
                ],
            )
            for name, group in groups.items()
        ]
        return panel_grid(
            [f"{head}\n{view.name} view" for view in seen for head in heads],
            rows,
            **more,
        )
    rows = [
        Row(
            f"{name}\n{view.name} view".strip(),
            _seen(group, keys, view, with_caption=view == seen[0]),
        )
        for view in seen
        for name, group in groups.items()
    ]
    return panel_grid(heads, rows, **more)


def _seen(
    group: Mapping[Any, Panel], keys: Iterable, view: View, *, with_caption: bool = True
) -> list[Panel | None]:
    """Return the brains of a group from a view, None where the group has none."""
    panels = [group.get(key) for key in keys]
    return [
        panel
        and replace(panel, view=view, caption=panel.caption if with_caption else "")
        for panel in panels
    ]


@styled
def runs_by_week(
    runs: Mapping[str, Mapping[float, TriangleMesh]],
    observed: Mapping[float, TriangleMesh],
    *,
    deviations: Mapping[float, SurfaceMaps] | None = None,
    views: Sequence[str] = SIDE_VIEWS,
    observed_name: str = OBSERVED_BRAIN,
    predicted: str = "",
) -> Figure:
    """Draw the brains of several runs (blue) above observed ones (beige), a column per
    week, rows by view.

    `runs` are surfaces in RAS+ mm by run and week, `observed` those by week, or by
    another heading; a missing week leaves its panel empty. `deviations` are surfaces
    and maps by week, of which `distance_mm` is shown below. `predicted` is the heading
    of a predicted brain (blue) in `observed`.
    """
    special: dict[Any, str] = {predicted: SIMULATED_SURFACE_COLOUR}
    groups = {
        name: {
            week: plain_panel(mesh, SIMULATED_SURFACE_COLOUR)
            for week, mesh in meshes.items()
        }
        for name, meshes in runs.items()
        if meshes
    }
    if observed:
        groups[observed_name] = {
            key: plain_panel(mesh, special.get(key, OBSERVED_SURFACE_COLOUR))
            for key, mesh in observed.items()
        }
    if not deviations:
        return brain_grid(groups, views)
    maps = {
        week: (mesh, maps["distance_mm"]) for week, (mesh, maps) in deviations.items()
    }
    scale = scale_of(
        "distance_mm", np.concatenate([values for _, values in maps.values()])
    )
    groups["distance"] = {
        week: _mapped(surface_map, scale) for week, surface_map in maps.items()
    }
    return brain_grid(groups, views, colour_bar=(scale, map_title("distance_mm")))


def displacements(
    frames: Mapping[float, SurfaceMaps],
) -> dict[tuple[float, float], SurfaceMap]:
    """Return the norm in mm of the displacement between successive weeks, on the
    surface at the later one."""
    surfaces = {week: mesh for week, (mesh, _) in frames.items()}
    return {
        (a, b): (
            surfaces[b],
            np.linalg.norm(surfaces[b].vertices - surfaces[a].vertices, axis=1),
        )
        for a, b in pairwise(sorted(surfaces))
    }


@styled
def displacement_maps(frames: Mapping[str, Mapping[float, SurfaceMaps]]) -> Figure:
    """Draw the norm of the displacement of runs on the pial surface, a column per
    interval, on one colour scale.

    `frames` are by run and week the surface in RAS+ mm and its fields. One vertex in
    two hundred is above the scale, so that a single maximum does not determine it. The
    maximum has a ring, dotted on the far side; the caption of each interval has its
    size, its position in RAS+ mm, and the mean over the vertices.
    """
    moved = {run: displacements(weeks) for run, weeks in frames.items()}
    every = np.concatenate(
        [norms for maps in moved.values() for _, norms in maps.values()]
    )
    scale = scale_of("displacement_mm", every)

    def panel(mesh: TriangleMesh, norms: Floats) -> Panel:
        place = mesh.vertices[int(np.nanargmax(norms))]
        where = ", ".join(f"{value:z.0f}" for value in place).replace("-", "−")
        words = (
            f"max {np.nanmax(norms):.2f} mm\n"
            f"at {where}\n"
            f"mean {np.nanmean(norms):.2f} mm"
        )
        return replace(_mapped((mesh, norms), scale), caption=words, mark=place)

    groups = {
        run: {key: panel(*surface_map) for key, surface_map in maps.items()}
        for run, maps in moved.items()
    }
    return brain_grid(
        groups, SIDE_VIEWS, colour_bar=(scale, "norm of the displacement (mm)")
    )


def round_up(value: float) -> float:
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
    end = 1.0
    if len(sizes):
        high = float(np.quantile(sizes, record.quantile))
        if high > 0:
            end = round_up(high)
    is_cut = bool((sizes > end).any())
    if signed:
        return colour_scale(SIGNED_COLOURS, -end, end, cut=is_cut)
    return colour_scale(record.colours, 0.0, end, cut=is_cut)


def whole_maps(halves: Halves, names: Iterable[str] | None = None) -> SurfaceMaps:
    """Return the hemispheres of a brain as one surface, with the maps that all of them
    have.

    `names` are the maps to return instead, NaN on a hemisphere that lacks one.
    """
    if names is None:
        names = [
            name for name in halves[0][1] if all(name in maps for _, maps in halves)
        ]
    values = {
        name: np.concatenate(
            [
                maps.get(name, np.full(len(mesh.vertices), np.nan))
                for mesh, maps in halves
            ]
        )
        for name in names
    }
    return (
        merged(*(mesh for mesh, _ in halves)) if len(halves) > 1 else halves[0][0]
    ), values


def _map_of(halves: Halves, quantity: str) -> SurfaceMap:
    mesh, maps = whole_maps(halves, [quantity])
    return mesh, maps[quantity]


def shape_maps(
    brains: Mapping[str, Mapping[float, Halves]],
    *,
    quantity: str,
    views: Sequence[str] = SIDE_VIEWS,
) -> Figure:
    """Draw `scalar_maps` of a quantity of hemispheres, {group: {week: hemispheres}},
    without empty groups."""
    maps = {
        group: {week: _map_of(halves, quantity) for week, halves in weeks.items()}
        for group, weeks in brains.items()
        if weeks
    }
    return scalar_maps(maps, quantity=quantity, views=views)


@styled
def scalar_maps(
    maps: Mapping[str, Mapping[Any, SurfaceMap]],
    *,
    quantity: str,
    directions: Mapping[Any, Floats] | None = None,
    views: Sequence[str] = SIDE_VIEWS,
) -> Figure:
    """Draw a quantity on surfaces: a row per group and view, a column per week or run,
    one colour scale.

    `maps` are by group and week, or run, such as {"simulated": {28.0: …}, "observed
    brain": {28.0: …}}, surfaces and values of `quantity`, a name of `VERTEX_MAPS`.
    `directions`, by week or run, are (n, 3) vectors at the vertices, drawn as lines of
    proportional length; the longest tenth have the same length.
    """
    every = np.concatenate(
        [values for group in maps.values() for _, values in group.values()]
    )
    scale, shares = scale_of(quantity, every), {}
    if directions:
        lengths = np.linalg.norm(np.concatenate(list(directions.values())), axis=1)
        shares = {
            key: vectors / np.quantile(lengths, DIRECTION_QUANTILE)
            for key, vectors in directions.items()
        }
    groups = {
        group: {
            key: _mapped(surface_map, scale, shares.get(key))
            for key, surface_map in values.items()
        }
        for group, values in maps.items()
    }
    legend = (
        []
        if np.isfinite(every).all()
        else [Patch(color=UNKNOWN_COLOUR, label="not measured")]
    )
    return brain_grid(
        groups, views, colour_bar=(scale, map_title(quantity)), legend=legend
    )


def growth_maps(
    frames: Mapping[float, SurfaceMaps],
    growth: Mapping[str, Floats],
    *,
    quantity: str = "area_growth_percent_per_gw",
    views: Sequence[str] = SIDE_VIEWS,
) -> Figure:
    """Draw the growth found by a run towards target shapes, with lines along the
    largest growth in the surface.

    `frames` are by week the surface in RAS+ mm and its fields; `growth` are the maps of
    `growth.rates.growth_per_week`, with their intervals in the names. The `quantity` is
    that of area, or that across the surface (`thickness_growth_percent_per_gw`). Maps
    without directions, as of standard deviations, have no lines.
    """
    intervals = list(pairwise(sorted(frames)))
    maps = {
        (a, b): (frames[b][0], growth[name_in_interval(quantity, a, b)])
        for a, b in intervals
    }
    directions = {
        interval: np.stack(
            [
                growth[name_in_interval(f"growth_direction_{axis}", *interval)]
                for axis in AXES
            ],
            axis=1,
        )
        for interval in intervals
        if name_in_interval("growth_direction_x", *interval) in growth
    }
    return scalar_maps(
        {"growth": maps}, quantity=quantity, directions=directions, views=views
    )


@styled
def influence_picture(
    members: Mapping[str, Halves | None],
    observed: Halves | None,
    *,
    values: Mapping[str, Mapping[str, Any]],
    observed_name: str = OBSERVED_BRAIN,
) -> Figure:
    """Draw the surfaces of the runs of a sweep at one week, and below their shape index
    on one scale.

    `members` are by run, in the order of the sweep, the hemispheres with their maps,
    None for a run that ended before the week. `observed` are those of the observed
    brain of the week, shown last under `observed_name`. `values` are by run the varied
    parameters with their values, for the headings.
    """
    headings = dict(zip(values, value_labels(list(values.values())), strict=True))
    brains = {headings[run]: halves for run, halves in members.items()} | (
        {observed_name: observed} if observed else {}
    )
    maps = {
        name: _map_of(halves, "shape_index")
        for name, halves in brains.items()
        if halves
    }
    scale = scale_of("shape_index", np.empty(0))
    colours = {observed_name: OBSERVED_SURFACE_COLOUR}
    groups = {
        "": {
            name: plain_panel(mesh, colours.get(name, SIMULATED_SURFACE_COLOUR))
            for name, (mesh, _) in maps.items()
        },
        "shape index\n": {
            name: _mapped(surface_map, scale) for name, surface_map in maps.items()
        },
    }
    rows = [
        Row(f"{label}{view} view", _seen(group, brains, VIEWS[view]), ABSENT)
        for label, group in groups.items()
        for view in SIDE_VIEWS
    ]
    return panel_grid(list(brains), rows, colour_bar=(scale, map_title("shape_index")))


@styled
def small_pictures(halves: Halves, *, side: str) -> Figure:
    """Draw a small picture without text: shape index from a side, and depth from above,
    0 to `SMALL_DEEP_MM`.

    All brains have one scale.
    """
    mesh, maps = whole_maps(halves, ("shape_index", "sulcal_depth_mm"))
    depth = colour_scale(VERTEX_MAPS["sulcal_depth_mm"].colours, 0.0, SMALL_DEEP_MM)
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


def region_colours(names: Iterable[str]) -> dict[str, tuple[float, float, float]]:
    """Return a colour for each region in the given order: those of runs, then their
    tints.

    On a scale from dark to pale, neighbours would look similar, and dark regions like
    shade. Colours repeat from the 22nd region on.
    """
    shades = [
        (
            part[0] + tint * (1 - part[0]),
            part[1] + tint * (1 - part[1]),
            part[2] + tint * (1 - part[2]),
        )
        for tint in TINTS
        for part in map(to_rgb, RUN_COLOURS)
    ]
    return dict(zip(dict.fromkeys(names), cycle(shades), strict=False))


@styled
def regions_picture(
    brains: Mapping[str, Sequence[tuple[TriangleMesh, tuple[Ints, Mapping[int, str]]]]],
) -> Figure:
    """Draw brains coloured by region, a column per brain and a row per view, with the
    regions' names.

    `brains` are by heading of the column the hemispheres, each with the numbers of its
    vertices' regions and their names. Numbers without a name mean no region.
    """
    colours = region_colours(
        name
        for halves in brains.values()
        for _, (_, table) in halves
        for name in table.values()
    )
    legend = [Patch(color=colour, label=name) for name, colour in colours.items()]
    painted, has_unnamed = {}, False
    for heading, halves in brains.items():
        shades = []
        for mesh, (numbers, table) in halves:
            side_colours = np.tile(
                np.array(to_rgb(NEUTRAL_COLOUR)), (len(mesh.vertices), 1)
            )
            for number, name in table.items():
                side_colours[numbers == number] = colours[name]
            shades.append(side_colours)
            has_unnamed |= not np.isin(numbers, list(table)).all()
        painted[heading] = merged(*(mesh for mesh, _ in halves)), np.concatenate(shades)
    if has_unnamed:
        legend.append(Patch(color=NEUTRAL_COLOUR, label="no region"))
    rows = [
        Row(
            f"{view.name} view",
            [Panel(mesh, shades, view=view) for mesh, shades in painted.values()],
        )
        for view in map(VIEWS.__getitem__, ROUND_VIEWS)
    ]
    return panel_grid(list(painted), rows, legend=legend)


@styled
def zones_picture(
    regions: tuple[TriangleMesh, Mapping[str, NDArray[np.integer]]],
    params: FoldingParameters,
) -> Figure:
    """Draw the zones of the brain's boundary from several sides, with their areas.

    `regions` are the boundary in RAS+ mm and the tags (m,) of its faces, where `zone`
    is an index into `ZONE_NAMES`; `fissure_x_mm` of the parameters separates the
    hemispheres in medial views.
    """
    (mesh, tags), fissure_x_mm = regions, params.fissure_x_mm
    zones = tags["zone"]
    colours = [ZONE_COLOURS[name] for name in ZONE_NAMES]
    areas = (
        np.bincount(zones, weights=face_areas(mesh), minlength=len(colours))
        * CM2_PER_MM2
    )
    present = [item for item in zip(ZONE_NAMES, colours, areas, strict=True) if item[2]]
    legend = [
        Patch(color=colour, label=f"{name} {area:.1f} cm²")
        for name, colour, area in present
    ]
    panels = [
        Panel(
            *restricted(
                mesh, to_rgba_array(colours)[zones, :3], view.hemisphere, fissure_x_mm
            ),
            view=view,
            light=MAP,
        )
        for view in map(VIEWS.__getitem__, MEDIAL_VIEWS)
    ]
    # a brain of one hemisphere has no medial view of the other
    panels = [panel for panel in panels if len(panel.mesh.faces)]
    return panel_grid(
        [f"{panel.view.name} view" for panel in panels],
        [Row("", panels)],
        legend=legend,
    )
