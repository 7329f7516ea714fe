"""Displacement norms of the runs beside published values, as a table and as a chart."""

from collections.abc import Sequence

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .style import (
    FULL_WIDTH_IN,
    MUTED_COLOUR,
    add_letters,
    chosen_colours,
    from_zero,
    light_grid,
    new_figure,
    run_legend,
    styled,
    week_axis,
)

_PAPER = "FetalFoldSim"
_MEASURED = "Wang et al. 2021"
PUBLISHED = pd.DataFrame(
    [
        (source, from_week, from_week + 1.0, nodes, largest, mean)
        for source, nodes, maxima, means in (
            (_PAPER, "all", (2.51, 2.22, 2.37, 2.57), (0.42, 0.40, 0.38, 0.40)),
            (_MEASURED, "published", (1.24, 2.29, 3.65, 5.79), (0.45, 0.88, 1.91, 3.03)),
        )
        for from_week, largest, mean in zip((21.0, 22.0, 23.0, 24.0), maxima, means, strict=True)
    ],
    columns=["source", "from_week", "to_week", "nodes", "max_mm", "mean_mm"],
)
"""Weekly displacement norms in mm: the FetalFoldSim paper's simulation (all nodes) and its quotation of real brains."""


def displacement_table(displacement: pd.DataFrame) -> pd.DataFrame:
    """Returns the weekly displacement norms of the runs with the published ones appended, one row per interval.

    Parameters
    ----------
    displacement : columns run, from_week, to_week, nodes ("all" or "pial"), max_mm, mean_mm

    Returns
    -------
    DataFrame with columns source, from_week, to_week, nodes, max_mm, mean_mm
    """
    runs = displacement.rename(columns={"run": "source"})[list(PUBLISHED.columns)]
    return pd.concat([runs, PUBLISHED], ignore_index=True)


def displacement_summary(displacement: pd.DataFrame) -> pd.DataFrame:
    """Returns the table as the paper prints it: a row per source and nodes, a column per interval, "max / mean" in mm.

    Parameters
    ----------
    displacement : as for `displacement_table`
    """
    table = displacement_table(displacement)
    table["interval"] = [
        f"{first:g}–{last:g} GW" for first, last in zip(table["from_week"], table["to_week"], strict=True)
    ]
    table["max / mean |u| (mm)"] = [
        f"{largest:.2f} / {mean:.2f}" for largest, mean in zip(table["max_mm"], table["mean_mm"], strict=True)
    ]
    order = table.sort_values(["from_week", "to_week"])["interval"].drop_duplicates()
    rows = list(dict.fromkeys(zip(table["source"], table["nodes"], strict=True)))
    wide = table.pivot_table(
        index=["source", "nodes"], columns="interval", values="max / mean |u| (mm)", aggfunc="first"
    ).reindex(index=pd.MultiIndex.from_tuples(rows, names=["source", "nodes"]), columns=list(order))
    return wide.fillna("–").rename_axis(columns="max / mean |u| (mm)")


@styled
def displacement_chart(
    displacement: pd.DataFrame, *, nodes: str = "all", runs: Sequence[str] = (), synthetic: bool = False
) -> Figure:
    """Returns the maximal and the mean displacement norm per interval: runs as lines, published values in grey.

    Parameters
    ----------
    displacement : as for `displacement_table`
    nodes
        "all" nodes, as in the paper, or the "pial" ones.
    runs
        All runs of the study, which settle the colours.
    """
    shown = displacement[displacement["nodes"] == nodes]
    colours = chosen_colours(shown["run"], runs)
    figure = new_figure(FULL_WIDTH_IN, 2.6, synthetic=synthetic)
    panels = figure.subplots(1, 2)
    markers = {_PAPER: "s", _MEASURED: "^"}
    ends = pd.concat([shown, PUBLISHED])
    for axes, column, label in zip(panels, ("max_mm", "mean_mm"), ("maximal", "mean"), strict=True):
        for source, marker in markers.items():
            rows = PUBLISHED[PUBLISHED["source"] == source]
            middle = (rows["from_week"] + rows["to_week"]) / 2
            axes.plot(middle, rows[column], marker, linestyle="--", color=MUTED_COLOUR, label=source)
        for run, colour in colours.items():
            rows = shown[shown["run"] == run].sort_values("from_week")
            middle = (rows["from_week"] + rows["to_week"]) / 2
            axes.plot(middle, rows[column], "o-", color=colour, label=run)
        axes.set_title(f"{label} |u| per interval, {nodes} nodes")
        axes.set_ylabel("displacement (mm)")
        from_zero(axes)
        week_axis(axes, [*ends["from_week"], *ends["to_week"]])
        axes.set_xlabel("gestational age (GW), middle of the interval")
        light_grid(axes)
    extra = [
        Line2D([], [], color=MUTED_COLOUR, marker=marker, linestyle="--", label=source)
        for source, marker in markers.items()
    ]
    add_letters(panels)
    run_legend(figure, colours, extra=extra)
    return figure
