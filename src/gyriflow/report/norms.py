"""Norms over the weeks with the brains that are compared with them, and their centiles as a table."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..errors import InputError
from .style import (
    FULL_WIDTH_IN,
    MEASURED,
    MUTED_COLOUR,
    NEUTRAL_COLOUR,
    REAL_BRAIN,
    REAL_COLOUR,
    RUN_COLOURS,
    add_letters,
    chosen_colours,
    light_grid,
    new_figure,
    shown_unit,
    styled,
    week_axis,
)

TITLES = {
    "volume": "volume",
    "area": "pial area",
    "gyrification_index": "gyrification index",
    "mean_sulcal_depth": "mean depth below the hull",
    "mean_curvedness": "mean curvedness",
    "mean_thickness": "mean cortical thickness",
}
"""The metrics that are shown, and their titles."""


@styled
def norms_chart(
    metrics: pd.DataFrame,
    curves: pd.DataFrame,
    norms: pd.DataFrame,
    reference: Sequence[str],
    *,
    runs: Sequence[str] = (),
    measured: str = REAL_BRAIN,
    synthetic: bool = False,
) -> Figure:
    """Returns a panel per metric of whole brains: reference brains, the curve through them, and the others.

    The band holds 90 % of further brains by Student's distribution; quantiles are drawn as bars where a week has five
    brains or more. Stars are measured brains, of the reference black, others coloured; lines are runs.

    Parameters
    ----------
    metrics : columns subject, run, week, hemisphere, metric, value, unit
    curves : columns hemisphere, metric, week, expected, low, high
    norms : columns hemisphere, metric, week, brains, q05, q50, q95
    reference
        Subjects that the curves go through.
    runs
        All runs of the study, which settle the colours.

    InputError where none of the metrics is there.
    """
    whole = metrics[metrics["hemisphere"] == "whole"]
    shown = [name for name in TITLES if (whole["metric"] == name).any()]
    if not shown:
        raise InputError("no metric of whole brains to show", expected=list(TITLES))
    colours = chosen_colours(whole["run"], runs)
    rows_of_panels = -(-len(shown) // 3)
    figure = new_figure(FULL_WIDTH_IN, 0.6 + 2.0 * rows_of_panels, synthetic=synthetic, measured=measured)
    panels = figure.subplots(rows_of_panels, 3, squeeze=False).ravel()
    others = False
    for axes, name in zip(panels, shown, strict=False):
        rows = whole[whole["metric"] == name]
        band = curves[(curves["hemisphere"] == "whole") & (curves["metric"] == name)]
        # a table without rows has no numbers to draw
        if len(band):
            axes.fill_between(band["week"], band["low"], band["high"], color=NEUTRAL_COLOUR, linewidth=0)
            axes.plot(band["week"], band["expected"], color=MUTED_COLOUR)
        bars = norms[(norms["hemisphere"] == "whole") & (norms["metric"] == name)].dropna(subset=["q50"])
        for low, middle, high, week in bars[["q05", "q50", "q95", "week"]].to_numpy():
            axes.plot([week, week], [low, high], color=REAL_COLOUR, linewidth=1.0)
            axes.plot(week, middle, "_", color=REAL_COLOUR, markersize=7)
        for run, own in rows.groupby("run", sort=False):
            if run != MEASURED:
                for _, brain in own.groupby("subject", sort=False):
                    ordered = brain.sort_values("week")
                    axes.plot(ordered["week"], ordered["value"], "o-", color=colours[str(run)], markersize=2.5)
                continue
            known = own["subject"].isin(reference)
            axes.plot(own.loc[known, "week"], own.loc[known, "value"], "*", color=REAL_COLOUR, markersize=6, zorder=3)
            axes.plot(
                own.loc[~known, "week"], own.loc[~known, "value"], "*", color=RUN_COLOURS[-1], markersize=7, zorder=3
            )
            others |= bool((~known).any())
        unit = shown_unit(rows["unit"].iloc[0])
        axes.set_title(TITLES[name] + (f" ({unit})" if unit else ""))
        week_axis(axes, rows["week"])
        light_grid(axes)
    for axes in panels[len(shown) :]:
        axes.remove()
    add_letters(panels[: len(shown)])
    star = {"marker": "*", "linestyle": "none", "markersize": 7}
    handles: list = [Line2D([], [], color=colours[run], marker="o", label=run) for run in colours]
    handles.append(Line2D([], [], color=REAL_COLOUR, label=measured, **star))  # type: ignore[arg-type]
    if others:
        handles.append(Line2D([], [], color=RUN_COLOURS[-1], label="other measured brains", **star))  # type: ignore[arg-type]
    if len(curves):
        handles.append(Patch(color=NEUTRAL_COLOUR, label="90 % of further brains"))
    figure.legend(handles=handles, loc="outside lower center", ncols=min(4, len(handles)))
    return figure


def centiles_table(centiles: pd.DataFrame) -> pd.DataFrame:
    """Returns the centiles of whole brains: a row per brain and week, a column per metric, with the number of brains.

    Parameters
    ----------
    centiles : columns subject, run, week, hemisphere, metric, z, centile, brains, brains_of_week, flag

    Returns
    -------
    DataFrame indexed by brain, run and week (GW): "centile (z)" of the metrics of the chart, brains compared with,
    those of the same week, and the note that goes with them
    """
    rows = centiles[(centiles["hemisphere"] == "whole") & centiles["metric"].isin(TITLES)]
    text = [
        f"{centile:.0f} ({z:+.1f})" if np.isfinite(centile) else "–"
        for centile, z in zip(rows["centile"], rows["z"], strict=True)
    ]
    index = ["subject", "run", "week"]
    wide = rows.assign(text=text).pivot_table("text", index, "metric", aggfunc="first")
    brains = pd.MultiIndex.from_frame(rows[index].drop_duplicates())
    wide = wide.reindex(index=brains, columns=[name for name in TITLES if name in wide]).rename(columns=TITLES)
    first = rows.drop_duplicates(index).set_index(index)
    wide["brains"], wide["of the week"], wide["note"] = first["brains"], first["brains_of_week"], first["flag"]
    return wide.rename_axis(["brain", "run", "week (GW)"])
