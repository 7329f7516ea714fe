"""Pictures of surfaces side by side at one scale, with views, scale bar and colour bar."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from string import ascii_lowercase
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch

from ..geometry.triangles import Floats, TriangleMesh
from .scene import PIXELS_PER_INCH, TISSUE, View, half_extents, is_visible, picture_axes, render
from .style import FULL_WIDTH_IN, SINGLE_COLUMN_IN, wrap

# sizes are whole dots of 300 to the inch: pictures then fall on the dots of PNG files of 300 or 600
_DOTS_PER_INCH = 300
# space around the largest brain, so that brains in neighbouring rows and columns do not touch
_MARGIN = 1.12
MAX_COLUMNS = 8
_PANEL_IN = 1.75
# no column is narrower than this part of the widest
_NARROWEST = 0.7
_EDGE_IN = 0.1
_TOP_IN = 0.1
# width of a letter of a heading
_LETTER_IN = 0.055
_LABEL_LETTERS = 26
# maximum share of the width for the scale bar; the colour bar is right of it
_SCALE_SHARE = 0.36
_END_NAMES = {"A": "anterior", "P": "posterior", "L": "left", "R": "right"}


@dataclass(frozen=True, eq=False)
class Panel:
    """One surface of a grid.

    Attributes
    ----------
    mesh, colours : the visible part, and its (n, 3) or (m, 3) colours
    caption : text below
    light : `TISSUE` or `MAP` of the scene
    mark : (3,) a point of the surface marked by a ring, dotted if the point is on the far side
    lines : (k, 2, 3) ends of lines on the surface
    """

    mesh: TriangleMesh
    colours: Floats
    view: View
    caption: str = ""
    light: Mapping[str, Any] = field(default_factory=lambda: TISSUE)
    mark: Floats | None = None
    lines: Floats | None = None


@dataclass(frozen=True, eq=False)
class Row:
    """A row of a grid: its label, its panels (None if there is nothing to show), and the text of empty panels."""

    label: str
    panels: Sequence[Panel | None]
    absent: str = ""


@dataclass(frozen=True)
class _Layout:
    """Sizes in inches.

    `left` is the left edge of the first panel, `panels` are the widths of all columns, `blocks` the columns of each
    block, one below the other. `foot` is the height below all blocks.
    """

    width: float
    left: float
    panels: Sequence[float]
    blocks: Sequence[slice]
    foot: float
    inches_per_mm: float


@dataclass(frozen=True, eq=False)
class _Block:
    """Adjacent columns: their headings and rows, and `heights` in inches of each row's pictures and captions."""

    columns: slice
    heads: Sequence[str]
    rows: Sequence[Row]
    heights: Sequence[tuple[float, float]]

    @property
    def height(self) -> float:
        """Height of all rows."""
        return sum(pictures + captions for pictures, captions in self.heights)


def round_length(limit_mm: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, 50 … that is at most `limit_mm`."""
    decade = 10.0 ** np.floor(np.log10(limit_mm))
    return float(max(step * decade for step in (1, 2, 5) if step * decade <= limit_mm * (1 + 1e-9)))


def panel_grid(
    columns: Sequence[str],
    rows: Sequence[Row],
    *,
    colour_bar: tuple[ScalarMappable, str] | None = None,
    legend: Sequence[Patch] = (),
) -> Figure:
    """Draw rows of surfaces under column headings, all at one scale in mm, with a scale bar below.

    More than eight columns continue in a further block below. The row's label names the view, and the first panel of a
    view has the letters of its ends. Several rows, or the panels of a single row, have the letters a, b, c … for the
    caption.

    Parameters
    ----------
    colour_bar : a colour scale and its label
    legend : entries of a legend
    """
    rows = [replace(row, label=wrap(row.label, _LABEL_LETTERS)) for row in rows]
    layout = _layout(rows, has_bar=colour_bar is not None, entries=len(legend))
    heads = [wrap(head, int(panel / _LETTER_IN)) for head, panel in zip(columns, layout.panels, strict=True)]
    blocks = [_block(rows, heads, block, layout.inches_per_mm) for block in layout.blocks]
    head_in = _dots(0.2 + 0.12 * max(head.count("\n") for head in heads))
    total = _TOP_IN + layout.foot + len(blocks) * head_in + sum(block.height for block in blocks)
    figure = Figure(figsize=(layout.width, total))
    top, letters = total - _TOP_IN, iter(ascii_lowercase)
    for block in blocks:
        _draw_heads(figure, block, layout, middle=top - head_in / 2)
        top -= head_in
        for row, (pictures, captions) in zip(block.rows, block.heights, strict=True):
            # a letter for each row, or for each panel of a single row
            count = 1 if len(rows) > 1 else len(block.heads) if len(columns) > 1 else 0
            _draw_row(
                figure, row, block.columns, layout, list(islice(letters, count)), bottom=top - pictures, height=pictures
            )
            top -= pictures + captions
    _draw_scale_bar(figure, layout, {end for row in rows for panel in row.panels if panel for end in panel.view.ends})
    if colour_bar:
        _draw_colour_bar(figure, layout, *colour_bar)
    if legend:
        figure.legend(handles=legend, ncols=_legend_columns(layout.width), loc="lower right", borderaxespad=0.2)
    return figure


def _layout(rows: Sequence[Row], *, has_bar: bool, entries: int) -> _Layout:
    """Return the sizes of a grid above a legend with so many entries: one scale, as large as the page allows."""
    # half the width of each column in mm: its widest brain and a margin
    columns = zip(*(row.panels for row in rows), strict=True)
    widest = [max((half_extents(p.mesh, p.view)[0] for p in column if p), default=0.0) for column in columns]
    halves = _MARGIN * np.maximum(widest, _NARROWEST * max(widest))
    # blocks with as equal numbers of columns as possible
    size = -(-len(halves) // -(-len(halves) // MAX_COLUMNS))
    blocks = [slice(start, start + size) for start in range(0, len(halves), size)]
    lines = max(row.label.count("\n") for row in rows)
    label_in = 0.24 + (0.06 + 0.12 * lines if lines else 0.0)
    most_mm = max(2 * halves[block].sum() for block in blocks)
    inches_per_mm = min(_PANEL_IN / (2 * halves.max()), (FULL_WIDTH_IN - label_in) / most_mm)
    panels = [_dots(2 * half * inches_per_mm) for half in halves]
    most_in = max(sum(panels[block]) for block in blocks)
    width = _dots(max(SINGLE_COLUMN_IN, label_in + most_in))
    left = _dots(label_in + (width - label_in - most_in) / 2)
    foot = max(0.66 if has_bar or entries else 0.46, 0.15 * -(-entries // _legend_columns(width)) + 0.16)
    return _Layout(width, left, panels, blocks, _dots(foot), inches_per_mm)


def _legend_columns(width: float) -> int:
    return 2 if width > 1.5 * SINGLE_COLUMN_IN else 1


def _block(rows: Sequence[Row], heads: Sequence[str], columns: slice, inches_per_mm: float) -> _Block:
    """Return a block without its empty rows."""
    visible = [row for row in rows if row.absent or any(row.panels[columns])]
    return _Block(columns, heads[columns], visible, [_heights_in(row, columns, inches_per_mm) for row in visible])


def _heights_in(row: Row, block: slice, inches_per_mm: float) -> tuple[float, float]:
    """Return the heights of a row's pictures and captions."""
    panels = [panel for panel in row.panels[block] if panel is not None]
    tallest = max((half_extents(panel.mesh, panel.view)[1] for panel in panels), default=0.0)
    # the label is written along the height
    label = 0.06 * max(len(line) for line in row.label.split("\n")) + 0.1
    lines = max((len(panel.caption.splitlines()) for panel in panels), default=0)
    return _dots(max(2 * _MARGIN * tallest * inches_per_mm, label)), _dots(0.13 * lines)


def _dots(inches: float) -> float:
    """Round a length in inches to whole dots."""
    return round(inches * _DOTS_PER_INCH) / _DOTS_PER_INCH


def _draw_heads(figure: Figure, block: _Block, layout: _Layout, *, middle: float) -> None:
    left, height = layout.left, figure.get_figheight()
    for head, panel in zip(block.heads, layout.panels[block.columns], strict=True):
        place = (left + panel / 2) / layout.width, middle / height
        figure.text(*place, head, ha="center", va="center", fontsize=7)
        left += panel


def _draw_row(
    figure: Figure, row: Row, block: slice, layout: _Layout, letters: Sequence[str], *, bottom: float, height: float
) -> None:
    total = figure.get_figheight()
    middle = (bottom + height / 2) / total
    figure.text(
        (layout.left - 0.06) / layout.width, middle, row.label, rotation=90, ha="right", va="center", fontsize=7
    )
    half_height = height / layout.inches_per_mm / 2
    previous, left = None, layout.left
    for index, (panel, wide) in enumerate(zip(row.panels[block], layout.panels[block], strict=True)):
        axes = figure.add_axes((left / layout.width, bottom / total, wide / layout.width, height / total))
        left += wide
        half_width = wide / layout.inches_per_mm / 2
        axes.set_label(f"{row.label}, column {index}")
        axes.set_axis_off()
        if index < len(letters):
            # next to the row's label, or above the letters of the ends
            style: dict[str, Any] = {"ha": "left", "va": "bottom"}
            if row.label and not index:
                style = {"ha": "right", "va": "top"}
            style |= {"xytext": (-2, 2), "textcoords": "offset points", "xycoords": "axes fraction"}
            axes.annotate(letters[index], (0.0, 1.0), fontsize=9, fontweight="bold", **style)
        if panel is None:
            axes.text(0.5, 0.5, row.absent, transform=axes.transAxes, ha="center", va="center", fontsize=6.5)
            continue
        size = (half_width, half_height), PIXELS_PER_INCH * layout.inches_per_mm
        image = render(panel.mesh, panel.colours, panel.view, *size, light=panel.light, lines=panel.lines)
        axes.imshow(image, extent=(-half_width, half_width, -half_height, half_height), aspect="auto")
        if panel.view != previous:
            for place, align, end in ((0.04, "left", panel.view.ends[0]), (0.96, "right", panel.view.ends[1])):
                axes.text(place, 1.0, end, transform=axes.transAxes, ha=align, va="top", fontsize=6)
        previous = panel.view
        if panel.mark is not None:
            _draw_ring(axes, panel, panel.mark)
        if panel.caption:
            axes.text(0.5, -0.01, panel.caption, transform=axes.transAxes, ha="center", va="top", fontsize=6.5)


def _draw_ring(axes: Axes, panel: Panel, point: Floats) -> None:
    middle = (panel.mesh.vertices.min(axis=0) + panel.mesh.vertices.max(axis=0)) / 2
    right, up = (float((point - middle) @ axis) for axis in picture_axes(panel.view))
    line = "-" if is_visible(panel.mesh, point, panel.view) else ":"
    for colour, thickness in (("white", 2.0), ("black", 1.0)):
        ring = Circle((right, up), 0.05 * np.ptp(axes.get_xlim()) / 2, fill=False)
        ring.set(edgecolor=colour, linewidth=thickness, linestyle=line if colour == "black" else "-")
        ring.set(clip_on=False, zorder=5)
        axes.add_patch(ring)


def _draw_colour_bar(figure: Figure, layout: _Layout, scale: ScalarMappable, label: str) -> None:
    start, total = _SCALE_SHARE * layout.width + 0.1, figure.get_figheight()
    place = start / layout.width, 0.5 / total, (layout.width - start - 0.3) / layout.width, 0.08 / total
    bar = figure.colorbar(scale, cax=figure.add_axes(place), orientation="horizontal")
    bar.set_label(label, labelpad=1)
    bar.ax.tick_params(pad=1, length=2)
    bar.outline.set_linewidth(0.5)


def _draw_scale_bar(figure: Figure, layout: _Layout, ends: set[str]) -> None:
    total = figure.get_figheight()
    room_mm = (_SCALE_SHARE * layout.width - 2 * _EDGE_IN) / layout.inches_per_mm
    length = round_length(min(0.6 * max(layout.panels) / layout.inches_per_mm, room_mm))
    size = (length * layout.inches_per_mm / layout.width, 0.04 / total)
    axes = figure.add_axes((_EDGE_IN / layout.width, (layout.foot - 0.2) / total, *size))
    axes.set_label("scale bar")
    axes.set_xlim(0, length)
    axes.axvspan(0, length, color="black", linewidth=0)
    axes.set_axis_off()
    axes.text(0.0, -0.6, f"{length:g} mm", transform=axes.transAxes, ha="left", va="top", fontsize=7)
    words = ", ".join(f"{letter} {name}" for letter, name in _END_NAMES.items() if letter in ends)
    figure.text(_EDGE_IN / layout.width, 0.02 / total, words, ha="left", va="bottom", fontsize=6)
