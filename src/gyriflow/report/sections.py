"""Plane sections: superimposed outlines of surfaces."""

from collections.abc import Mapping

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..geometry.alignment import align
from ..geometry.triangles import TriangleMesh
from ..settings.terms import OBSERVED_BRAIN
from .labels import week_label
from .style import (
    FULL_WIDTH_IN,
    OBSERVED_COLOUR,
    SINGLE_COLUMN_IN,
    add_letters,
    new_figure,
    run_colours,
    styled,
)

PLANES = {"coronal": (1, 0, 2), "axial": (2, 0, 1), "sagittal": (0, 1, 2)}
"""The axis normal to each plane, and those to the right and up in its picture."""
MAX_WEEKS = 5
SCALE_BAR_MM = 20.0
LEFT_IN, ABOVE_IN, MAX_PANEL_IN = 0.7, 0.9, 2.3
"""Space left of and above the panels of outlines, and the maximum width of a panel."""


def draw_outline(axes: Axes, surface: TriangleMesh, plane: str, at: float, colour: str, thickness: float = 0.8) -> None:
    """Draw the intersection of a surface with one of `PLANES` at a position in mm."""
    normal, right, up = PLANES[plane]
    body = pv.PolyData.from_regular_faces(np.array(surface.vertices), np.array(surface.faces, dtype=int))
    cut = body.slice(normal=np.eye(3)[normal], origin=np.eye(3)[normal] * at)
    segments = np.asarray(cut.points)[cut.lines.reshape(-1, 3)[:, 1:]][..., [right, up]]
    axes.add_collection(LineCollection(list(segments), colors=colour, linewidths=thickness, capstyle="round"))


@styled
def outlines_chart(
    runs: Mapping[str, Mapping[float, TriangleMesh]],
    observed: Mapping[float, TriangleMesh],
    *,
    observed_name: str = OBSERVED_BRAIN,
) -> Figure:
    """Draw the outlines of runs over those of the observed brain, a row per plane, a column per week.

    The coronal and axial planes pass through the middle of the observed brain, the sagittal plane through its right
    hemisphere. All panels have one scale. At most the last five weeks are shown.

    Parameters
    ----------
    runs : {run: {week: surface in RAS+ mm}}
        Each is rigidly aligned with the observed brain of its week.
    observed : {week: observed surface in RAS+ mm}
    """
    weeks, colours = sorted(observed)[-MAX_WEEKS:], run_colours(runs)
    runs = {
        run: {week: align(mesh, observed[week]) for week, mesh in brains.items() if week in weeks}
        for run, brains in runs.items()
    }
    drawn = [brains[week] for brains in (observed, *runs.values()) for week in weeks if week in brains]
    low = np.min([mesh.vertices.min(axis=0) for mesh in drawn], axis=0) - 1
    high = np.max([mesh.vertices.max(axis=0) for mesh in drawn], axis=0) + 1
    wide = max((high - low)[right] for _, right, _ in PLANES.values())
    tall = [(high - low)[up] for *_, up in PLANES.values()]
    inches_per_mm = min((FULL_WIDTH_IN - LEFT_IN) / (len(weeks) * wide), MAX_PANEL_IN / wide)
    width = max(SINGLE_COLUMN_IN, LEFT_IN + inches_per_mm * len(weeks) * wide)
    figure = new_figure(width, inches_per_mm * sum(tall) + ABOVE_IN)
    panels = figure.subplots(len(tall), len(weeks), squeeze=False, gridspec_kw={"height_ratios": tall})
    for row, (plane, (normal, right, up)) in zip(panels, PLANES.items(), strict=True):
        centre = (low[right] + high[right]) / 2
        # a sagittal plane in the middle would only show the fissure
        part = 0.75 if plane == "sagittal" else 0.5
        for axes, week in zip(row, weeks, strict=True):
            ends = observed[week].vertices[:, normal].min(), observed[week].vertices[:, normal].max()
            at = float(ends[0] + part * (ends[1] - ends[0]))
            # wide enough to stay visible under a run
            draw_outline(axes, observed[week], plane, at, OBSERVED_COLOUR, 1.7)
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
    named = {**colours, observed_name: OBSERVED_COLOUR}
    handles = [Line2D([], [], color=colour, label=label) for label, colour in named.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure
