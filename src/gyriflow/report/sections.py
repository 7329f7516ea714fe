"""Plane sections: superimposed outlines of surfaces, and fields of the model in its
elements."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ..geometry.alignment import align
from ..geometry.triangles import Floats, Ints, TriangleMesh
from .labels import week_label
from .pictures import Grid
from .style import (
    FULL_WIDTH_IN,
    MUTED_COLOUR,
    OBSERVED_COLOUR,
    SINGLE_COLUMN_IN,
    add_letters,
    entry,
    run_colours,
    styled,
)

PLANES = {
    "coronal": (1, 0, 2),
    "axial": (2, 0, 1),
    "sagittal": (0, 1, 2),
}
"""The axis normal to each plane, and those to the right and up in its picture."""
MAX_WEEKS = 5
SCALE_BAR_MM = 20.0
ARROW_MM = 3.0
"""Spacing and length of the arrows of normals."""
LEFT_IN, ABOVE_IN, MAX_PANEL_IN = 0.7, 0.9, 2.3
"""Space left of and above the panels of outlines, and the maximum width of a panel."""


def draw_outline(
    axes: Axes,
    surface: TriangleMesh,
    plane: str,
    at: float,
    colour: str,
    thickness: float = 0.8,
) -> None:
    """Draw the intersection of a surface with one of `PLANES` at a position in mm."""
    normal, right, up = PLANES[plane]
    heights = surface.vertices[:, normal] - at
    is_above = heights > 0
    # the plane meets two edges of a face that has vertices on both sides of it
    n_above = is_above[surface.faces].sum(axis=1)
    starts = surface.faces[n_above % 3 > 0]
    ends = starts[:, [1, 2, 0]]
    meets = is_above[starts] != is_above[ends]
    first, second = starts[meets], ends[meets]
    share = heights[first] / (heights[first] - heights[second])
    begin, end = (surface.vertices[side][:, [right, up]] for side in (first, second))
    points = begin + share[:, None] * (end - begin)
    style: dict[str, Any] = {"colors": colour, "linewidths": thickness}
    axes.add_collection(
        LineCollection(
            list(points.reshape(-1, 2, 2)),
            capstyle="round",
            **style,
        )
    )


def _coronal_section(
    positions: Floats,
    tets: Ints,
    fields: Mapping[str, Floats],
) -> Any:
    """Cut linear elements at the median y of their nodes: a polygon per element, with
    fields at its points."""
    # takes half a second, which outlines need not wait for
    import pyvista as pv

    body = pv.UnstructuredGrid(
        {pv.CellType.TETRA: np.asarray(tets)},
        positions,
    )
    for name, values in fields.items():
        body.point_data[name] = values
    middle = (
        0.0,
        float(np.median(positions[:, 1])),
        0.0,
    )
    # one polygon per element, not triangles
    return body.slice(normal="y", origin=middle, generate_triangles=False)


@styled
def model_figure(elements: tuple[Ints, Mapping[float, Mapping[str, Floats]]]) -> Figure:
    """Draw coronal sections through the elements of a run at its start and at its end.

    Columns are the cortical weight with the elements, the growth zone (0 or 1), the
    tangential growth in a step, and the normals in the cortex. `elements` are their
    nodes (m, 4) or (m, 10), and by week the arrays of `folding.growth.model_fields` at
    the nodes.
    """
    tets, weeks = elements
    largest = max(float(fields["increment"].max()) for fields in weeks.values())
    figure = Figure(figsize=(FULL_WIDTH_IN, 4.2), layout="constrained")
    rows = figure.subplots(2, 4, sharex="row", sharey="row")
    scales = {"weight": 1.0, "growing": 1.0, "increment": largest}
    titles = (
        "cortical weight",
        "growth zone",
        "tangential growth\nin a step",
        "normals",
    )
    for row, week in zip(
        rows,
        (min(weeks), max(weeks)),
        strict=True,
    ):
        fields = dict(weeks[week])
        section = _coronal_section(
            fields.pop("positions"),
            tets[:, :4],
            fields,
        )
        points, values = np.asarray(section.points)[:, [0, 2]], section.point_data
        polygons = [points[face] for face in section.irregular_faces]
        style: dict[str, Any] = {"linewidths": 0.05}
        for axes, (name, top) in zip(
            row,
            scales.items(),
            strict=False,
        ):
            means = [values[name][face].mean() for face in section.irregular_faces]
            colours: dict[str, Any] = {
                "cmap": "YlGnBu",
                "norm": Normalize(0, top),
            }
            filled = PolyCollection(
                polygons, array=np.array(means), edgecolors="black", **colours, **style
            )
            axes.add_collection(filled)
        edges = {"facecolors": "none", "edgecolors": MUTED_COLOUR, **style}
        row[3].add_collection(PolyCollection(polygons, **edges))
        # arrows at one point of the cortex in each square
        squares = np.floor(points / ARROW_MM)
        _, first = np.unique(squares, axis=0, return_index=True)
        arrows = first[values["weight"][first] > 0.5]
        normals = values["normals"][arrows][:, [0, 2]] * ARROW_MM
        row[3].quiver(
            *points[arrows].T,
            *normals.T,
            angles="xy",
            scale_units="xy",
            scale=1,
            width=0.005,
        )
        left, bottom = points.min(axis=0) - ARROW_MM
        right, top = points.max(axis=0) + ARROW_MM
        for axes in row:
            axes.set(
                xlim=(left, right),
                ylim=(bottom, top),
                aspect="equal",
            )
            axes.set_axis_off()
        _label_row(row[0], week_label(week))
    for axes, title in zip(
        rows[0],
        titles,
        strict=True,
    ):
        axes.set_title(title, fontsize=8)
    for column, top in enumerate(scales.values()):
        scale = ScalarMappable(Normalize(0, top), "YlGnBu")
        panels = list(rows[:, column])
        figure.colorbar(scale, ax=panels, location="bottom", shrink=0.8)
    add_letters(rows.flat)
    return figure


def _label_row(axes: Axes, text: str) -> None:
    """Write upwards at the left of the first panel of a row."""
    style: dict[str, Any] = {
        "rotation": 90,
        "ha": "right",
        "va": "center",
    }
    axes.text(
        -0.02,
        0.5,
        text,
        transform=axes.transAxes,
        **style,
    )


def _aligned(
    grid: Grid,
) -> tuple[dict[float, TriangleMesh], str, dict[str, dict[float, TriangleMesh]]]:
    """Return the observed brains of the last weeks of a grid, their name, and by run
    its brains of these weeks, aligned with them."""
    observed = {}
    name = ""
    for brain in grid:
        if not brain.is_simulated:
            observed[brain.column] = brain.surface
            name = brain.row
    last = {week: observed[week] for week in sorted(observed)[-MAX_WEEKS:]}
    runs: dict[str, dict[float, TriangleMesh]] = {}
    for brain in grid:
        if brain.is_simulated:
            aligned = runs.setdefault(brain.row, {})
            if brain.column in last:
                aligned[brain.column] = align(
                    brain.surface,
                    last[brain.column],
                )
    return last, name, runs


@styled
def outlines_figure(grid: Grid) -> Figure:
    """Draw the outlines of runs over those of the observed brain, a row per plane, a
    column per week.

    The coronal and axial planes pass through the middle of the observed brain, the
    sagittal plane through its right hemisphere. All panels have one scale. At most the
    last five weeks are shown. The grid has a row for each run and one of observed
    brains, by week; those of runs are aligned rigidly with the observed brain of their
    week.
    """
    observed, observed_name, runs = _aligned(grid)
    weeks = sorted(observed)
    colours = run_colours(runs)
    drawn = [mesh.vertices for mesh in observed.values()]
    for brains in runs.values():
        drawn += [mesh.vertices for mesh in brains.values()]
    every = np.concatenate(drawn)
    low, high = every.min(axis=0) - 1, every.max(axis=0) + 1
    wide = max((high - low)[right] for _, right, _ in PLANES.values())
    tall = [(high - low)[up] for *_, up in PLANES.values()]
    inches_per_mm = min(
        (FULL_WIDTH_IN - LEFT_IN) / (len(weeks) * wide), MAX_PANEL_IN / wide
    )
    width = max(SINGLE_COLUMN_IN, LEFT_IN + inches_per_mm * len(weeks) * wide)
    figure = Figure(
        figsize=(width, inches_per_mm * sum(tall) + ABOVE_IN), layout="constrained"
    )
    panels = figure.subplots(
        len(tall), len(weeks), squeeze=False, gridspec_kw={"height_ratios": tall}
    )
    for row, (plane, (normal, right, up)) in zip(
        panels,
        PLANES.items(),
        strict=True,
    ):
        centre = (low[right] + high[right]) / 2
        # a sagittal plane in the middle would only show the fissure
        part = 0.75 if plane == "sagittal" else 0.5
        for axes, week in zip(row, weeks, strict=True):
            along = observed[week].vertices[:, normal]
            at = float(along.min() + part * np.ptp(along))
            # wide enough to stay visible under a run
            draw_outline(axes, observed[week], plane, at, OBSERVED_COLOUR, 1.7)
            for run, brains in runs.items():
                if week in brains:
                    draw_outline(axes, brains[week], plane, at, colours[run])
            axes.set(
                xlim=(centre - wide / 2, centre + wide / 2),
                ylim=(low[up], high[up]),
                aspect="equal",
            )
            axes.set_axis_off()
        _label_row(row[0], plane)
    for axes, week in zip(
        panels[0],
        weeks,
        strict=True,
    ):
        axes.set_title(week_label(week), fontsize=8)
    foot = panels[-1, 0]
    start, bottom = foot.get_xlim()[0] + 2, low[PLANES["sagittal"][2]]
    ends = [start, start + SCALE_BAR_MM]
    foot.plot(
        ends,
        [bottom] * 2,
        color="black",
        linewidth=2,
        clip_on=False,
    )
    foot.text(
        start,
        bottom - 1,
        f"{SCALE_BAR_MM:g} mm",
        va="top",
        fontsize=7,
    )
    add_letters(panels[:, 0])
    named = {**colours, observed_name: OBSERVED_COLOUR}
    handles = [
        entry(
            label,
            colour,
        )
        for label, colour in named.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure
