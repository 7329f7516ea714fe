"""What a folding solve did: its steps, its displacement, and how its mesh resolved the cortex."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..parameters.terms import ELEMENTS_NEEDED
from .labels import week_label
from .style import (
    MUTED_COLOUR,
    from_zero,
    panel_figure,
    run_colours,
    run_legend,
    runs_by_name,
    styled,
    week_axis,
)

_MARKERS = {"FetalFoldSim": "s", "Wang et al. 2021": "^"}
PUBLISHED = pd.DataFrame(
    {
        "run": np.repeat(list(_MARKERS), 4),
        "from_week": [21.0, 22, 23, 24] * 2,
        "to_week": [22.0, 23, 24, 25] * 2,
        "max_mm": [2.51, 2.22, 2.37, 2.57, 1.24, 2.29, 3.65, 5.79],
        "mean_mm": [0.42, 0.40, 0.38, 0.40, 0.45, 0.88, 1.91, 3.03],
    }
)
"""Weekly displacement norms in mm: the FetalFoldSim paper's simulation (all nodes) and its quotation of real brains."""


@styled
def displacement_chart(displacement: pd.DataFrame, *, runs: Sequence[str] = ()) -> Figure:
    """Draw the maximal and the mean displacement norm of all nodes, as in the paper, per week.

    Norms between output weeks that lie further apart are divided by the weeks between them. Runs are lines, published
    values grey.

    Parameters
    ----------
    displacement : columns run, subject, from_week, to_week, nodes ("all" or "pial"), max_mm, mean_mm
    runs
        All runs of the study, which settle the colours.
    """
    named = runs_by_name(displacement)
    rows = pd.concat([PUBLISHED, named[named["nodes"] == "all"]])
    rows["middle"], span = (rows["from_week"] + rows["to_week"]) / 2, rows["to_week"] - rows["from_week"]
    colours = run_colours(named["run"], runs)
    figure, panels = panel_figure(2, per_row=2)
    for axes, column, label in zip(panels, ("max_mm", "mean_mm"), ("maximal", "mean"), strict=True):
        per_week = rows.assign(per_week=rows[column] / span).sort_values("middle")
        for run, line in per_week.groupby("run", sort=False):
            look: dict[str, Any] = {"marker": "o", "color": colours.get(str(run), MUTED_COLOUR)}
            if run in _MARKERS:
                look |= {"marker": _MARKERS[str(run)], "linestyle": "--"}
            axes.plot(line["middle"], line["per_week"], label=run, **look)
        axes.set_title(f"{label} displacement, all nodes")
        axes.set_ylabel("displacement (mm per week)")
        from_zero(axes)
        week_axis(axes, [*rows["from_week"], *rows["to_week"]])
        axes.set_xlabel("gestational age (GW), middle of the interval")
    extra = [
        Line2D([], [], color=MUTED_COLOUR, marker=marker, linestyle="--", label=source)
        for source, marker in _MARKERS.items()
    ]
    run_legend(figure, colours, extra=extra)
    return figure


def resolution_over_steps(order: int, steps: pd.DataFrame) -> dict[str, float]:
    """Return how well the steps of a run resolved the cortex, as the table of runs has it.

    Parameters
    ----------
    order
        Of the elements.
    steps : columns week, elements_through_cortex
        One row per step; no number where no element has its centre in the cortex, which counts as none.

    Returns
    -------
    dict
        `order`, `least_elements_through_cortex`, and `unresolved_from_week`, the first week with fewer elements than
        `ELEMENTS_NEEDED` (NaN: there is none).
    """
    through = steps["elements_through_cortex"].fillna(0.0)
    return {
        "order": order,
        "least_elements_through_cortex": float(through.min()),
        "unresolved_from_week": float(steps.loc[through < ELEMENTS_NEEDED[order], "week"].min()),
    }


def resolution_verdict(run: Mapping[str, Any] | pd.Series) -> str:
    """Return what is to be said of a run whose mesh is too coarse, at the start or later; empty where it is not.

    Parameters
    ----------
    run : elements_through_cortex (before the first step), and what `resolution_over_steps` returns
    """
    needed = ELEMENTS_NEEDED[int(run["order"])]
    at_start, week = run["elements_through_cortex"], run["unresolved_from_week"]
    if not at_start >= needed:  # not a number: no element lies in the cortex
        return f"cortex not resolved ({at_start:.3g} elements through it, {needed:g} needed): folds are the mesh's"
    if math.isnan(week):
        return ""
    return (
        f"cortex not resolved from {week_label(round(week, 2))} on "
        f"(down to {run['least_elements_through_cortex']:.3g} elements through it, {needed:g} needed): "
        "folds may be the mesh's from then on"
    )
