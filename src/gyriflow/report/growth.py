"""Chart of growth: areas, volumes and growth rates of series of brains."""

from collections.abc import Collection, Mapping
from itertools import cycle

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..settings.terms import OBSERVED_BRAIN
from .style import RUN_COLOURS, from_zero, panel_figure, styled, week_axis, wrap

SERIES_COLOURS = (RUN_COLOURS[0], *RUN_COLOURS[2:])
"""Colours of the series, without that of the simulations."""
MAX_RATE_PANELS = 4
"""Of more series, no rates are drawn."""


@styled
def growth_figure(
    areas: pd.DataFrame,
    rates: pd.DataFrame,
    *,
    folding_rate_per_s: Mapping[float, float] | None = None,
    observed_name: str = OBSERVED_BRAIN,
) -> Figure:
    """Draw cortical area and volume over weeks, and the tangential growth rate of each
    interval as bars.

    Series of brains share the panels of area and volume. Up to four series with rates
    have a panel of bars each, on one scale.

    `areas` has the columns series, subject, week, area_cm2, volume_ml; `rates` series,
    from_week, to_week, rate_per_s (1/s). `folding_rate_per_s` is the growth rate of the
    simulations in 1/s by week, drawn as a line over the bars, linear in between and
    constant beyond.
    """
    names = list(dict.fromkeys(areas["series"]))
    colours = dict(zip(names, cycle(SERIES_COLOURS), strict=False))
    with_rates = list(rates["series"].unique())
    shown = with_rates if len(with_rates) <= MAX_RATE_PANELS else []
    figure, (area_axes, volume_axes, *rate_axes) = panel_figure(
        2 + len(shown), panel_in=2.4, foot_in=0.0
    )
    _sizes_panel(area_axes, areas, "area_cm2", colours, with_rates)
    area_axes.set_ylabel("pial area (cm²)")
    _sizes_panel(volume_axes, areas, "volume_ml", colours, with_rates)
    volume_axes.set_ylabel("volume, with ventricles (mL)")
    title = "tangential growth rate"
    if len(names) == 1:
        area_axes.set_title(wrap(observed_name, 32))
        volume_axes.set_title(wrap(observed_name, 32))
    for axes in rate_axes[1:]:
        axes.sharey(rate_axes[0])
    for axes, name in zip(rate_axes, shown, strict=True):
        own = rates[rates["series"] == name]
        _rates_panel(axes, own, colours[name], folding_rate_per_s)
        # the legend stands below the title
        axes.set_title(
            title
            if len(names) == 1
            else wrap(
                f"{title}: {name}",
                28,
            ),
            pad=6.0 if folding_rate_per_s is None else 16.0,
        )
    return figure


def _sizes_panel(
    axes: Axes,
    areas: pd.DataFrame,
    column: str,
    colours: Mapping[str, str],
    with_rates: Collection[str],
) -> None:
    """Draw areas or volumes over weeks, a colour per series.

    Only the brains of series `with_rates` are joined: others may be different fetuses.
    """
    for number, (name, colour) in enumerate(reversed(list(colours.items()))):
        rows = areas[areas["series"] == name].sort_values("week")
        # series often agree: smaller marks of later series stay visible within those of
        # earlier ones
        axes.plot(
            rows["week"],
            rows[column],
            "o-" if name in with_rates else "o",
            color=colour,
            zorder=2 - 0.1 * number,
            label=name,
            markersize=3 + 2.5 * number,
            markerfacecolor="white" if number else colour,
        )
    from_zero(axes)
    week_axis(axes, areas["week"])
    if 1 < len(colours) <= len(SERIES_COLOURS):
        # in place of a title, so that it hides no curve
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(-0.01, 1.01),
            borderaxespad=0,
            reverse=True,
        )


def _rates_panel(
    axes: Axes,
    rates: pd.DataFrame,
    colour: str,
    folding_rate_per_s: Mapping[float, float] | None,
) -> None:
    """Draw the growth rate of each interval of one series as a bar, and the simulated
    rate as a line."""
    weeks = zip(rates["from_week"], rates["to_week"], strict=True)
    labels = [f"{first:g}–{last:g}" for first, last in weeks]
    bars = axes.bar(
        labels,
        rates["rate_per_s"] * 1e7,
        width=0.7,
        color=colour,
    )
    crowded = len(rates) > 8
    axes.bar_label(
        bars,
        fmt=lambda rate: f"{rate:.2f}".replace(
            "-",
            "−",
        ),
        fontsize=6.5,
        padding=2,
        rotation=90 if crowded else 0,
        # in front of the line of the simulated rate
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
        zorder=3,
    )
    axes.axhline(0, color="black", linewidth=0.6)
    if folding_rate_per_s is not None:
        _folding_line(axes, rates, folding_rate_per_s)
        # above the axes, so that it hides no bar
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.01),
            borderaxespad=0,
        )
    axes.set_ylabel("growth rate (10⁻⁷ s⁻¹)")
    axes.margins(y=0.25 if crowded else 0.12)
    axes.set_xlabel("gestational interval (GW)")
    axes.tick_params(
        axis="x",
        rotation=45 if len(labels) > 6 else 0,
    )
    # room for at least three bars, so that a single one does not fill the panel
    spare = max(0.0, 3 - len(labels)) / 2
    axes.set_xlim(-0.6 - spare, len(labels) - 0.4 + spare)


def _folding_line(
    axes: Axes, rates: pd.DataFrame, rate_per_s: Mapping[float, float]
) -> None:
    """Draw the simulated growth rate over bars of equal width, one per interval."""
    weeks = np.array(sorted(rate_per_s))
    ends = np.array([*rates["from_week"], rates["to_week"].iloc[-1]])
    is_inside = (weeks > ends[0]) & (weeks < ends[-1])
    drawn = np.union1d(ends, weeks[is_inside])
    bar_edges = np.arange(len(ends)) - 0.5
    values = [1e7 * rate_per_s[week] for week in weeks]
    axes.plot(
        np.interp(drawn, ends, bar_edges),
        np.interp(drawn, weeks, values),
        label="folding",
        color=RUN_COLOURS[1],
        linestyle="--",
    )
