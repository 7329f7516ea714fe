"""Plane sections: outlines of surfaces over each other."""

from collections.abc import Mapping

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..geometry.alignment import fit_onto
from ..geometry.triangles import TriangleMesh, transformed
from ..settings.terms import REAL_BRAIN
from .labels import week_label
from .style import (
    FULL_WIDTH_IN,
    REAL_COLOUR,
    SINGLE_COLUMN_IN,
    add_letters,
    new_figure,
    run_colours,
    styled,
)

PLANES = {"coronal": (1, 0, 2), "axial": (2, 0, 1), "sagittal": (0, 1, 2)}
"""The axes across each plane, and to the right and up in its picture."""
MOST_WEEKS = 5
SCALE_BAR_MM = 20.0
BESIDE_IN, BEYOND_IN, WIDEST_IN = 0.7, 0.9, 2.3
"""Room beside and above the panels of outlines, and the most that one may be wide."""


def draw_outline(axes: Axes, surface: TriangleMesh, plane: str, at: float, colour: str, thickness: float = 0.8) -> None:
    """Draw the lines in which one of `PLANES` at a place in mm cuts a surface."""
    across, right, up = PLANES[plane]
    body = pv.PolyData.from_regular_faces(np.array(surface.vertices), np.array(surface.faces, dtype=int))
    cut = body.slice(normal=np.eye(3)[across], origin=np.eye(3)[across] * at)
    segments = np.asarray(cut.points)[cut.lines.reshape(-1, 3)[:, 1:]][..., [right, up]]
    axes.add_collection(LineCollection(list(segments), colors=colour, linewidths=thickness, capstyle="round"))


@styled
def outlines_chart(
    runs: Mapping[str, Mapping[float, TriangleMesh]],
    real: Mapping[float, TriangleMesh],
    *,
    measured: str = REAL_BRAIN,
) -> Figure:
    """Draw the outlines of runs over those of the measured brain, a row per plane, a column per week.

    The coronal and axial planes pass the middle of the measured brain, the sagittal one its right hemisphere. All
    panels have one scale. Of many weeks the last ones are shown.

    Parameters
    ----------
    runs : {run: {week: surface in RAS+ mm}}
        Each is moved rigidly onto the measured brain of its week.
    real : {week: measured surface in RAS+ mm}
    """
    weeks, colours = sorted(real)[-MOST_WEEKS:], run_colours(runs)
    runs = {
        run: {week: transformed(mesh, fit_onto(mesh, real[week])) for week, mesh in brains.items() if week in weeks}
        for run, brains in runs.items()
    }
    drawn = [brains[week] for brains in (real, *runs.values()) for week in weeks if week in brains]
    low = np.min([mesh.vertices.min(axis=0) for mesh in drawn], axis=0) - 1
    high = np.max([mesh.vertices.max(axis=0) for mesh in drawn], axis=0) + 1
    wide = max((high - low)[right] for _, right, _ in PLANES.values())
    tall = [(high - low)[up] for *_, up in PLANES.values()]
    inches_per_mm = min((FULL_WIDTH_IN - BESIDE_IN) / (len(weeks) * wide), WIDEST_IN / wide)
    width = max(SINGLE_COLUMN_IN, BESIDE_IN + inches_per_mm * len(weeks) * wide)
    figure = new_figure(width, inches_per_mm * sum(tall) + BEYOND_IN)
    panels = figure.subplots(len(tall), len(weeks), squeeze=False, gridspec_kw={"height_ratios": tall})
    for row, (plane, (across, right, up)) in zip(panels, PLANES.items(), strict=True):
        centre = (low[right] + high[right]) / 2
        # a sagittal plane in the middle would show the fissure alone
        part = 0.75 if plane == "sagittal" else 0.5
        for axes, week in zip(row, weeks, strict=True):
            ends = real[week].vertices[:, across].min(), real[week].vertices[:, across].max()
            at = float(ends[0] + part * (ends[1] - ends[0]))
            # wide enough to be seen under a run that meets it
            draw_outline(axes, real[week], plane, at, REAL_COLOUR, 1.7)
            for run in runs:
                if week in runs[run]:
                    draw_outline(axes, runs[run][week], plane, at, colours[run])
            axes.set(xlim=(centre - wide / 2, centre + wide / 2), ylim=(low[up], high[up]), aspect="equal")
            axes.set_axis_off()
        row[0].text(-0.02, 0.5, plane, transform=row[0].transAxes, rotation=90, ha="right", va="center")
    for axes, week in zip(panels[0], weeks, strict=True):
        axes.set_title(week_label(week), fontsize=8)
    foot = panels[-1, 0]
    start, bottom = foot.get_xlim()[0] + 2, low[PLANES["sagittal"][2]]
    foot.plot([start, start + SCALE_BAR_MM], [bottom] * 2, color="black", linewidth=2, clip_on=False)
    foot.text(start, bottom - 1, f"{SCALE_BAR_MM:g} mm", va="top", fontsize=7)
    add_letters(panels[:, 0])
    named = {**colours, measured: REAL_COLOUR}
    handles = [Line2D([], [], color=colour, label=label) for label, colour in named.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure
