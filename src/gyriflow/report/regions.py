"""Regions of the cortex: a picture of where they are, and a chart of their metrics over the weeks."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..errors import InputError
from ..geometry.triangles import Ints, TriangleMesh
from .panels import Panel, Row, panel_grid
from .scene import named_views
from .style import (
    FULL_WIDTH_IN,
    MEASURED,
    MUTED_COLOUR,
    NEUTRAL_COLOUR,
    PHANTOM,
    REAL_BRAIN,
    RUN_COLOURS,
    add_letters,
    from_zero,
    light_grid,
    new_figure,
    shown_unit,
    simulated_runs,
    styled,
    week_axis,
)

VIEWS = ("left", "right", "top", "bottom")
TITLES = {
    "area": "area, both sides",
    "mean_sulcal_depth": "mean depth below the hull",
    "mean_curvature": "mean curvature",
    "mean_local_gyrification_index": "local gyrification index",
    "mean_thickness": "mean cortical thickness",
}
"""The metrics of the chart and their titles."""
NOT_FROM_ZERO = ("mean_curvature", "mean_local_gyrification_index")
MOST_RUNS = 3
TINTS = (0.0, 0.4, 0.7)
"""How far towards white the colours of further regions are."""
STYLES: tuple[Literal["-", "--", ":"], ...] = ("-", "--", ":")

RegionMap = tuple[TriangleMesh, Ints]
"""A surface and the number of the region of each vertex, 0 for none."""


def region_colours(names: Iterable[str]) -> dict[str, tuple[float, float, float]]:
    """Returns a colour for each region in the order given: those of runs, then their tints.

    No scale from dark to pale, which would make neighbours alike, and dark ones like shade. From the 22nd region on the
    colours come again.
    """
    colours = {}
    for number, name in enumerate(dict.fromkeys(names)):
        tint = TINTS[number // len(RUN_COLOURS) % len(TINTS)]
        red, green, blue = (part + tint * (1.0 - part) for part in to_rgb(RUN_COLOURS[number % len(RUN_COLOURS)]))
        colours[name] = red, green, blue
    return colours


@styled
def regions_picture(
    brains: Mapping[str, RegionMap],
    names: Mapping[int, str],
    *,
    views: Sequence[str] = VIEWS,
    measured: str = PHANTOM,
    synthetic: bool = False,
) -> Figure:
    """Returns brains coloured by region, a column per brain and a row per view, with the regions' names.

    Parameters
    ----------
    brains : {heading of the column: (surface in RAS+ mm, regions of its vertices)}
    names
        Of the regions by number.

    InputError where there is no brain.
    """
    if not brains:
        raise InputError("no brain with regions")
    colours = region_colours(names.values())
    palette = {number: colours[name] for number, name in names.items()} | {0: to_rgb(NEUTRAL_COLOUR)}
    painted = {
        head: (mesh, np.array([palette[int(number)] for number in regions])) for head, (mesh, regions) in brains.items()
    }
    rows = [
        Row(f"{view.name} view", [Panel(mesh, shades, view) for mesh, shades in painted.values()])
        for view in named_views(views)
    ]
    legend = [Patch(color=colours[name], label=name) for name in names.values()]
    legend.append(Patch(color=NEUTRAL_COLOUR, label="no region"))
    return panel_grid(list(painted), rows, synthetic=synthetic, measured=measured, legend=legend)


@styled
def regions_chart(
    regions: pd.DataFrame,
    asymmetry: pd.DataFrame,
    *,
    measured: str = REAL_BRAIN,
    synthetic: bool = False,
) -> Figure:
    """Returns a panel per metric over the weeks, a colour per region: both sides together, and the asymmetry of area.

    Measured brains are stars, the first three runs lines. Areas are sums of both sides, other values their means.

    Parameters
    ----------
    regions : columns subject, run, week, hemisphere, region, metric, value, unit
    asymmetry : columns subject, run, week, region, metric, asymmetry_index
    """
    colours = region_colours(regions["region"])
    shown = [name for name in TITLES if (regions["metric"] == name).any()]
    runs = simulated_runs(regions["run"])[:MOST_RUNS]
    rows_of_panels = -(-(len(shown) + 1) // 3)
    figure = new_figure(FULL_WIDTH_IN, 0.6 + 1.9 * rows_of_panels, synthetic=synthetic, measured=measured)
    panels = figure.subplots(rows_of_panels, 3, squeeze=False).ravel()
    for axes, name in zip(panels, shown, strict=False):
        rows = regions[regions["metric"] == name]
        sides = rows.groupby(["subject", "run", "week", "region"], sort=False)["value"]
        values = (sides.sum() if name == "area" else sides.mean()).reset_index()
        _panel(axes, values, colours, runs)
        unit = shown_unit(rows["unit"].iloc[0])
        axes.set_title(TITLES[name] + (f" ({unit})" if unit else ""))
        if name not in NOT_FROM_ZERO:
            from_zero(axes)
    axes = panels[len(shown)]
    rows = asymmetry[(asymmetry["metric"] == "area") & asymmetry["region"].isin(colours)]
    _panel(axes, rows.rename(columns={"asymmetry_index": "value"}), colours, runs)
    axes.axhline(0, color=MUTED_COLOUR, linewidth=0.8)
    axes.set_title("asymmetry of area, 2 (L − R)/(L + R)")
    for axes in panels[len(shown) + 1 :]:
        axes.remove()
    add_letters(panels[: len(shown) + 1])
    handles = [
        Line2D([], [], color=colour, marker="s", linestyle="none", label=name) for name, colour in colours.items()
    ]
    handles += [
        Line2D([], [], color=MUTED_COLOUR, linestyle=line, label=run) for run, line in zip(runs, STYLES, strict=False)
    ]
    handles.append(Line2D([], [], color=MUTED_COLOUR, marker="*", linestyle="none", markersize=7, label=measured))
    columns = 4
    figure.set_figheight(figure.get_figheight() + 0.15 * (-(-len(handles) // columns)))
    figure.legend(handles=handles, loc="outside lower center", ncols=columns)
    return figure


def _panel(axes: Axes, values: pd.DataFrame, colours: Mapping[Any, Any], runs: Sequence[str]) -> None:
    """Draws the value of each region over the weeks."""
    for (region, run), rows in values.groupby(["region", "run"], sort=False):
        ordered = rows.sort_values("week")
        if run == MEASURED:
            axes.plot(ordered["week"], ordered["value"], "*", color=colours[region], markersize=6)
        elif run in runs:
            line = STYLES[list(runs).index(str(run))]
            axes.plot(ordered["week"], ordered["value"], line, color=colours[region], linewidth=1.1)
    week_axis(axes, values["week"])
    light_grid(axes)
