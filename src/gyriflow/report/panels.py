"""Pictures of surfaces side by side at one scale, with views, scale bar and colour
bar."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from string import ascii_lowercase
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.patches import Circle, Patch

from ..geometry.triangles import Floats, TriangleMesh, vertex_normals
from .scene import (
    PIXELS_PER_INCH,
    TISSUE,
    VIEWS,
    View,
    half_extents,
    picture_axes,
    render,
)
from .style import FULL_WIDTH_IN, SINGLE_COLUMN_IN, wrap

# sizes are whole dots of 300 to the inch: pictures then fall on the dots of PNG files
# of 300 or 600
_DOTS_PER_INCH = 300
# space around the largest brain, so that brains in neighbouring rows and columns do not
# touch
_MARGIN = 1.12
MAX_COLUMNS = 8
LINES_MM = 4.0
"""Spacing of the lines along directions."""
MIN_FACING_COSINE = 0.3
"""Minimum cosine between a normal and the view for lines: closer to the outline they
would be foreshortened."""
_PANEL_IN = 1.75
PAGE_IN_PER_MM, PAGE_BAR_MM = 0.0117, 20.0
"""Scale of pictures that are compared between pages, in inches per mm, and their scale
bar: at 38 GW, a brain from five sides is as wide as a page."""
_PAGE_COLUMN_IN = 0.8
"""Least width of their columns, for the headings of small brains."""
# no column is narrower than this part of the widest
_NARROWEST = 0.7
_EDGE_IN = 0.1
_TOP_IN = 0.1
# width of a letter of a heading
_LETTER_IN = 0.055
_LABEL_LETTERS = 26
# maximum share of the width for the scale bar; the colour bar is right of it
_SCALE_SHARE = 0.36
_END_NAMES = {
    "A": "anterior",
    "P": "posterior",
    "L": "left",
    "R": "right",
}


@dataclass(frozen=True, eq=False)
class Panel:
    """One surface of a grid.

    `mesh` is the visible part and `colours` its (n, 3) or (m, 3) colours; `light` is
    `TISSUE` or `MAP` of the scene. The vertex `mark` has a ring, dotted if it is on the
    far side; `directions` (n, 3) are vectors at the vertices, drawn as lines on the
    surface. The caption stands below.
    """

    mesh: TriangleMesh
    colours: Floats
    view: View = VIEWS["left"]
    caption: str = ""
    light: Mapping[str, Any] = field(default_factory=lambda: TISSUE)
    mark: int | None = None
    directions: Floats | None = None


@dataclass(frozen=True, eq=False)
class Row:
    """A row of a grid: its label, its panels (None if there is nothing to show), and
    the text of empty panels."""

    label: str
    panels: Sequence[Panel | None]
    absent: str = ""


def _round_length(limit_mm: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, 50 … that is at most `limit_mm`."""
    exponent = np.floor(np.log10(limit_mm))
    steps = np.array([1, 2, 5]) * 10.0**exponent
    is_short = steps <= limit_mm * (1 + 1e-9)
    return float(steps[is_short].max())


def panel_grid(
    columns: Sequence[str],
    rows: Sequence[Row],
    *,
    colour_bar: tuple[ScalarMappable, str] | None = None,
    legend: Sequence[Patch] = (),
    at_page_scale: bool = False,
) -> Figure:
    """Draw rows of surfaces under column headings, all at one scale in mm, with a scale
    bar below.

    They are as large as the page allows, or `at_page_scale`, so that figures of several
    brains have one scale, in which a wider one is smaller.

    More than eight columns continue in a further block below. The row's label names the
    view, and the first panel of a view has the letters of its ends. Several rows, or
    the panels of a single row, have the letters a, b, c … for the caption. `colour_bar`
    is a colour scale and its label, `legend` the entries of a legend.
    """
    rows = [
        replace(
            row,
            label=wrap(row.label, _LABEL_LETTERS),
        )
        for row in rows
    ]
    lines = max(row.label.count("\n") for row in rows)
    label_in = 0.24 + (0.06 + 0.12 * lines if lines else 0.0)
    widths_in, blocks, inches_per_mm = _lay_out_columns(
        rows, FULL_WIDTH_IN - label_in, PAGE_IN_PER_MM if at_page_scale else np.inf
    )
    widest_in = max(widths_in[part].sum() for part in blocks)
    # a page shrinks all figures of one width by the same factor
    narrowest_in = FULL_WIDTH_IN if at_page_scale else SINGLE_COLUMN_IN
    width = _dots(max(narrowest_in, label_in + widest_in))
    left_in = _dots(label_in + (width - label_in - widest_in) / 2)
    heads = []
    for head, panel_in in zip(columns, widths_in, strict=True):
        heads.append(wrap(head, int(panel_in / _LETTER_IN)))
    head_in = 0.2 + 0.12 * max(head.count("\n") for head in heads)
    drawn = []
    for part in blocks:
        # without rows that are empty in this block
        shown = [row for row in rows if row.absent or any(row.panels[part])]
        heights_in = [head_in]
        for row in shown:
            heights_in += _heights_in(row, part, inches_per_mm)
        drawn.append(_Block(part, shown, _dots(heights_in)))
    legend_columns = 2 if width > 1.5 * SINGLE_COLUMN_IN else 1
    legend_in = 0.15 * math.ceil(len(legend) / legend_columns) + 0.16
    foot_in = max(0.66 if colour_bar or legend else 0.46, legend_in)
    total = _TOP_IN + _dots(foot_in) + sum(block.heights_in.sum() for block in drawn)
    figure = Figure(figsize=(width, total))
    top_in = total - _TOP_IN
    letters = iter(ascii_lowercase)
    for block in drawn:
        block_in = block.heights_in.sum()
        # a letter for each row, or for each panel of a single row
        per_row = 1 if len(rows) > 1 else len(columns) if len(columns) > 1 else 0
        block_heads, block_widths_in = heads[block.columns], widths_in[block.columns]
        grid = GridSpec(
            len(block.heights_in),
            len(block_heads),
            figure,
            left=left_in / width,
            right=(left_in + block_widths_in.sum()) / width,
            top=top_in / total,
            bottom=(top_in - block_in) / total,
            width_ratios=block_widths_in,
            height_ratios=block.heights_in,
            hspace=0,
            wspace=0,
        )
        top_in -= block_in
        for number, row in enumerate(block.rows):
            # pictures are between the headings or captions above and the captions below
            line = 2 * number + 1
            columns_in = range(len(block_heads))
            cells = [figure.add_subplot(grid[line, column]) for column in columns_in]
            sizes_in = [(part, block.heights_in[line]) for part in block_widths_in]
            panels = row.panels[block.columns]
            _draw_row(cells, row, panels, sizes_in, inches_per_mm)
            _write_letters(
                cells[:per_row],
                letters,
                is_labelled=bool(row.label),
            )
            if number == 0:
                for axes, head in zip(cells, block_heads, strict=True):
                    _write(
                        axes,
                        head,
                        (0.5, 1.0),
                        (0, 36 * head_in),
                    )
    bar_mm = PAGE_BAR_MM
    if not at_page_scale:
        longest_in = min(
            0.6 * widths_in.max(),
            _SCALE_SHARE * width - 2 * _EDGE_IN,
        )
        bar_mm = _round_length(longest_in / inches_per_mm)
    _draw_scale_bar(figure, rows, foot_in, bar_mm, inches_per_mm)
    if colour_bar:
        _draw_colour_bar(figure, *colour_bar)
    if legend:
        figure.legend(
            handles=legend,
            ncols=legend_columns,
            loc="lower right",
            borderaxespad=0.2,
        )
    return figure


@dataclass(frozen=True, eq=False)
class _Block:
    """Columns of a grid that stand side by side, with their rows.

    `heights_in` are those of the headings, and of the pictures and the captions of each
    row.
    """

    columns: slice
    rows: Sequence[Row]
    heights_in: Floats


def _write_letters(
    cells: Sequence[Axes],
    letters: Iterator[str],
    *,
    is_labelled: bool,
) -> None:
    """Write the next letters at the upper left of panels: next to the row's label, or
    above the letters of the ends."""
    for axes, letter in zip(cells, letters, strict=False):
        align: dict[str, Any] = {"ha": "left", "va": "bottom"}
        if is_labelled and axes is cells[0]:
            align = {"ha": "right", "va": "top"}
        at = (0.0, 1.0), (-2, 2)
        _write(
            axes,
            letter,
            *at,
            fontsize=9,
            fontweight="bold",
            **align,
        )


def _lay_out_columns(
    rows: Sequence[Row], room_in: float, max_inches_per_mm: float
) -> tuple[Floats, list[slice], float]:
    """Return the widths of all columns in inches, the columns of each block (at most
    `MAX_COLUMNS` side by side), and the scale in inches per mm."""
    half_widths = []
    for column in zip(
        *(row.panels for row in rows),
        strict=True,
    ):
        panels = [
            half_extents(
                panel.mesh,
                panel.view,
            )[0]
            for panel in column
            if panel
        ]
        half_widths.append(max(panels, default=0.0))
    half_widths_mm = np.array(half_widths)
    narrowest_mm = _NARROWEST * half_widths_mm.max()
    widths_mm = 2 * _MARGIN * np.maximum(half_widths_mm, narrowest_mm)
    widths_mm = np.maximum(widths_mm, _PAGE_COLUMN_IN / max_inches_per_mm)
    # blocks with as equal numbers of columns as possible
    n_blocks = math.ceil(len(widths_mm) / MAX_COLUMNS)
    size = math.ceil(len(widths_mm) / n_blocks)
    blocks = [
        slice(start, start + size)
        for start in range(
            0,
            len(widths_mm),
            size,
        )
    ]
    inches_per_mm = min(
        max_inches_per_mm,
        _PANEL_IN / widths_mm.max(),
        room_in / max(widths_mm[block].sum() for block in blocks),
    )
    return _dots(widths_mm * inches_per_mm), blocks, inches_per_mm


def _heights_in(
    row: Row,
    block: slice,
    inches_per_mm: float,
) -> tuple[float, float]:
    """Return the heights of a row's pictures and captions."""
    panels = [panel for panel in row.panels[block] if panel]
    halves_mm = [
        half_extents(
            panel.mesh,
            panel.view,
        )[1]
        for panel in panels
    ]
    picture = _MARGIN * 2 * max(halves_mm, default=0.0) * inches_per_mm
    captions = [len(panel.caption.splitlines()) for panel in panels]
    # the label is written along the height
    longest_line = max(map(len, row.label.split("\n")))
    label = 0.06 * longest_line + 0.1
    return max(picture, label), 0.13 * max(captions, default=0)


def _dots(inches: Any) -> Any:
    """Round lengths in inches to whole dots."""
    return np.round(np.asarray(inches) * _DOTS_PER_INCH) / _DOTS_PER_INCH


def _write(
    axes: Axes,
    text: str,
    at: tuple[float, float],
    shift_pt: tuple[float, float] = (0, 0),
    **style: Any,
) -> None:
    """Write at a place in fractions of a panel, shifted by points."""
    style = {"fontsize": 7, "ha": "center", "va": "center", **style}
    style |= {"xycoords": "axes fraction", "textcoords": "offset points"}
    axes.annotate(text, at, shift_pt, **style)


def _draw_row(
    cells: Sequence[Axes],
    row: Row,
    panels: Sequence[Panel | None],
    sizes_in: Sequence[tuple[float, float]],
    inches_per_mm: float,
) -> None:
    """Draw the pictures of a row in its cells, whose widths and heights are given, with
    the row's label on the left."""
    previous = None
    _write(
        cells[0],
        row.label,
        (0.0, 0.5),
        (-4.3, 0),
        rotation=90,
        ha="right",
    )
    for index, (axes, panel, size_in) in enumerate(
        zip(cells, panels, sizes_in, strict=True)
    ):
        axes.set_label(f"{row.label}, column {index}")
        axes.set_axis_off()
        if panel is None:
            _write(axes, row.absent, (0.5, 0.5), fontsize=6.5)
            continue
        right, up = (float(length / inches_per_mm) / 2 for length in size_in)
        lines = None
        if panel.directions is not None:
            lines = _direction_lines(panel.mesh, panel.directions, panel.view)
        image = render(
            panel.mesh,
            panel.colours,
            panel.view,
            (right, up),
            PIXELS_PER_INCH * inches_per_mm,
            light=panel.light,
            lines=lines,
        )
        axes.imshow(
            image,
            extent=(-right, right, -up, up),
            aspect="auto",
        )
        if panel.view != previous:
            first, last = panel.view.ends
            _write(
                axes,
                first,
                (0.04, 1.0),
                ha="left",
                va="top",
                fontsize=6,
            )
            _write(
                axes,
                last,
                (0.96, 1.0),
                ha="right",
                va="top",
                fontsize=6,
            )
        previous = panel.view
        if panel.mark is not None:
            _draw_ring(axes, panel, panel.mark)
        _write(
            axes,
            panel.caption,
            (0.5, -0.01),
            va="top",
            fontsize=6.5,
        )


def _direction_lines(mesh: TriangleMesh, directions: Floats, view: View) -> Floats:
    """Return the (k, 2, 3) ends of lines along (n, 3) vectors, one per cube of
    `LINES_MM` that faces a view.

    Vectors of length 1 or more give lines as long as a cube.
    """
    normals = vertex_normals(mesh)
    cubes = np.floor(mesh.vertices / LINES_MM)
    _, first = np.unique(
        cubes,
        axis=0,
        return_index=True,
    )
    is_facing = normals[first] @ view.towards > MIN_FACING_COSINE
    vertices = first[is_facing]
    lines = directions[vertices]
    lengths = np.linalg.norm(
        lines,
        axis=1,
        keepdims=True,
    )
    half = lines * (LINES_MM / 2) / lengths.clip(1)
    # slightly above the surface, which would otherwise hide parts of them
    at = mesh.vertices[vertices] + LINES_MM / 8 * normals[vertices]
    return np.stack([at - half, at + half], axis=1)


def _draw_ring(axes: Axes, panel: Panel, vertex: int) -> None:
    """Draw a ring around a vertex."""
    vertices, view = panel.mesh.vertices, panel.view
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    right, up = picture_axes(view)
    away = vertices[vertex] - middle
    is_near = vertex_normals(panel.mesh)[vertex] @ view.towards > 0
    line = "-" if is_near else ":"
    # a white margin below the black ring
    for colour, thickness, style in (("white", 2.0, "-"), ("black", 1.0, line)):
        ring = Circle(
            (float(away @ right), float(away @ up)),
            0.025 * np.ptp(axes.get_xlim()),
            fill=False,
            edgecolor=colour,
            linewidth=thickness,
            linestyle=style,
            clip_on=False,
            zorder=5,
        )
        axes.add_patch(ring)


def _draw_colour_bar(
    figure: Figure,
    scale: ScalarMappable,
    label: str,
) -> None:
    width, total = figure.get_size_inches()
    start = _SCALE_SHARE * width + 0.1
    place = start / width, 0.5 / total, (width - start - 0.3) / width, 0.08 / total
    bar = figure.colorbar(
        scale,
        cax=figure.add_axes(place),
        orientation="horizontal",
    )
    bar.set_label(label, labelpad=1)
    bar.ax.tick_params(pad=1, length=2)
    bar.outline.set_linewidth(0.5)


def _draw_scale_bar(
    figure: Figure,
    rows: Sequence[Row],
    foot_in: float,
    length: float,
    inches_per_mm: float,
) -> None:
    """Draw the scale bar of a length in mm, and below it what the letters of the views
    mean."""
    width, total = figure.get_size_inches()
    left, bottom = _EDGE_IN / width, (foot_in - 0.2) / total
    axes = figure.add_axes(
        (
            left,
            bottom,
            length * inches_per_mm / width,
            0.04 / total,
        )
    )
    axes.set_label("scale bar")
    axes.set_xlim(0, length)
    axes.axvspan(0, length, color="black", linewidth=0)
    axes.set_axis_off()
    label = f"{length:g} mm"
    axes.text(
        0.0,
        -0.6,
        label,
        transform=axes.transAxes,
        va="top",
        fontsize=7,
    )
    ends: set[str] = set()
    for row in rows:
        ends.update(*(panel.view.ends for panel in row.panels if panel))
    words = [
        f"{letter} {name}" for letter, name in _END_NAMES.items() if letter in ends
    ]
    figure.text(
        _EDGE_IN / width,
        0.02 / total,
        ", ".join(words),
        fontsize=6,
    )
