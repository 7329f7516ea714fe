"""Outlines of simulated and measured brains over each other, in plane sections."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..geometry.triangles import TriangleMesh
from .overlay import section_lines
from .sections import PLANES, known
from .style import (
    FULL_WIDTH_IN,
    REAL_BRAIN,
    REAL_COLOUR,
    RUN_COLOURS,
    add_letters,
    new_figure,
    styled,
    week_label,
)

MOST_COLUMNS = 5
_SHOWN = ("coronal", "axial", "sagittal")
# a sagittal plane in the middle would show the fissure alone
_PART = {"coronal": 0.5, "axial": 0.5, "sagittal": 0.75}


@styled
def outlines_chart(
    pairs: Mapping[float, tuple[TriangleMesh, TriangleMesh]],
    *,
    planes: Sequence[str] = _SHOWN,
    measured: str = REAL_BRAIN,
    synthetic: bool = False,
) -> Figure:
    """Returns the outlines of the simulated over those of the measured brain, a row per plane, a column per week.

    The coronal and axial planes pass the middle of the measured brain, the sagittal one its right hemisphere. All
    panels have one scale. Of many weeks the last ones are shown.

    Parameters
    ----------
    pairs : {week: (simulated, measured surface in RAS+ mm, laid onto each other)}
    """
    weeks = sorted(pairs)[-MOST_COLUMNS:]
    low = np.min([np.minimum(*(mesh.vertices.min(axis=0) for mesh in pairs[week])) for week in weeks], axis=0) - 1
    high = np.max([np.maximum(*(mesh.vertices.max(axis=0) for mesh in pairs[week])) for week in weeks], axis=0) + 1
    span = high - low
    wide = max(span[PLANES[plane][1]] for plane in known(planes))
    tall = [span[PLANES[plane][2]] for plane in planes]
    inches_per_mm = min((FULL_WIDTH_IN - 0.7) / len(weeks), 2.3) / wide
    width = max(0.7 + len(weeks) * wide * inches_per_mm, 3.5)
    figure = new_figure(width, inches_per_mm * sum(tall) + 0.9, synthetic=synthetic, measured=measured)
    panels = figure.subplots(len(planes), len(weeks), squeeze=False, sharex=False, gridspec_kw={"height_ratios": tall})
    for line, plane in zip(panels, planes, strict=True):
        across, right, up = PLANES[plane]
        centre = (low[right] + high[right]) / 2
        for axes, week in zip(line, weeks, strict=True):
            simulated, real = pairs[week]
            bottom, top = real.vertices[:, across].min(), real.vertices[:, across].max()
            at = float(bottom + _PART[plane] * (top - bottom))
            for mesh, colour in ((real, REAL_COLOUR), (simulated, RUN_COLOURS[0])):
                axes.add_collection(LineCollection(section_lines(mesh, plane, at), colors=colour, linewidths=0.7))
            axes.set(xlim=(centre - wide / 2, centre + wide / 2), ylim=(low[up], high[up]))
            axes.set_aspect("equal")
            axes.set_axis_off()
            if axes is line[0]:
                axes.text(-0.02, 0.5, plane, transform=axes.transAxes, rotation=90, ha="right", va="center")
            if plane == planes[0]:
                axes.set_title(week_label(week), fontsize=8)
    length = 20.0
    foot = panels[-1, 0]
    start = foot.get_xlim()[0] + 2
    foot.plot([start, start + length], [low[PLANES[planes[-1]][2]]] * 2, color="black", linewidth=2, clip_on=False)
    foot.text(start, low[PLANES[planes[-1]][2]] - 1, f"{length:g} mm", va="top", fontsize=7)
    add_letters(panels[:, 0] if len(planes) > 1 and len(weeks) > 1 else panels.flat)
    handles = [
        Line2D([], [], color=RUN_COLOURS[0], label="simulated"),
        Line2D([], [], color=REAL_COLOUR, label=measured),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure
