"""Chart of growth: areas, volumes and growth rates of series of brains."""

from collections.abc import Collection, Mapping
from itertools import cycle
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..settings.terms import OBSERVED_BRAIN
from .style import RUN_COLOURS, from_zero, panel_figure, styled, week_axis, wrap

SERIES_COLOURS = (RUN_COLOURS[0], *RUN_COLOURS[2:])
"""Colours of the series, without that of the simulations."""
MAX_RATE_PANELS = 4
"""Up to so many series have a panel of rates each; more share one."""


@styled
def growth_figure(
    areas: pd.DataFrame,
    rates: pd.DataFrame,
    *,
    folding_rate_per_s: float | Mapping[float, float] | None = None,
    observed_name: str = OBSERVED_BRAIN,
) -> Figure:
    """Draw cortical area and volume over weeks, and the tangential growth rate of each
    interval as bars.

    Series of brains share the panels of area and volume. Up to four series with rates
    have a panel of bars each, on one scale.

    `areas` has the columns series, subject, week, area_cm2, volume_ml; `rates` series,
    from_week, to_week, rate_per_s (1/s). `folding_rate_per_s` is the growth rate of the
    simulations in 1/s, drawn as a line over the bars: a number, or values by week,
    linear in between and constant beyond.
    """
    names = list(dict.fromkeys(areas["series"]))
    colours = dict(zip(names, cycle(SERIES_COLOURS), strict=False))
    with_rates = rates["series"].unique()
    is_shared = len(with_rates) > MAX_RATE_PANELS
    panels = 1 if is_shared else len(with_rates)
    figure, (area_axes, volume_axes, *rate_axes) = panel_figure(
        2 + panels, panel_in=2.4, foot_in=0.0
    )
    labels = {
        "area_cm2": "pial area (cm²)",
        "volume_ml": "volume, with ventricles (mL)",
    }
    for axes, (column, label) in zip(
        (area_axes, volume_axes), labels.items(), strict=True
    ):
        _sizes_panel(axes, areas, column, colours, set(with_rates))
        axes.set_ylabel(label)
        if len(names) == 1:
            axes.set_title(wrap(observed_name, 32))
    if is_shared:
        _rates_together(rate_axes[0], rates, colours)
        return figure
    for axes, name in zip(rate_axes, with_rates, strict=True):
        _rates_panel(
            axes, rates[rates["series"] == name], colours[name], folding_rate_per_s
        )
        title = (
            "tangential growth rate"
            if len(names) == 1
            else wrap(f"tangential growth rate: {name}", 28)
        )
        # the legend stands below the title
        axes.set_title(title, pad=6.0 if folding_rate_per_s is None else 16.0)
    limits = [axes.get_ylim() for axes in rate_axes]
    for axes in rate_axes:
        axes.set_ylim(
            min(low for low, _ in limits),
            max(high for _, high in limits),
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
        style: dict[str, Any] = {
            "markersize": 3 + 2.5 * number,
            "markerfacecolor": "white" if number else colour,
        }
        axes.plot(
            rows["week"],
            rows[column],
            "o-" if name in with_rates else "o",
            color=colour,
            zorder=2 - 0.1 * number,
            label=name,
            **style,
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


def _rates_together(
    axes: Axes,
    rates: pd.DataFrame,
    colours: Mapping[str, str],
) -> None:
    """Draw the growth rate of each interval of many series as a line from week to
    week."""
    for name, colour in colours.items():
        for _, row in rates[rates["series"] == name].iterrows():
            axes.plot(
                [row["from_week"], row["to_week"]],
                [1e7 * row["rate_per_s"]] * 2,
                color=colour,
            )
    axes.axhline(0, color="black", linewidth=0.6)
    axes.set_ylabel("growth rate (10⁻⁷ s⁻¹)")
    axes.set_title("tangential growth rate")
    week_axis(axes, [*rates["from_week"], *rates["to_week"]])


def _rates_panel(
    axes: Axes,
    rates: pd.DataFrame,
    colour: str,
    folding_rate_per_s: float | Mapping[float, float] | None,
) -> None:
    """Draw the growth rate of each interval of one series as a bar, and the simulated
    rate as a line."""
    labels = [
        f"{first:g}–{last:g}"
        for first, last in zip(
            rates["from_week"],
            rates["to_week"],
            strict=True,
        )
    ]
    bars = axes.bar(
        labels,
        rates["rate_per_s"] * 1e7,
        width=0.7,
        color=colour,
    )
    # in front of the line of the simulated rate
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
    crowded = len(rates) > 8
    texts = axes.bar_label(
        bars,
        fmt=lambda rate: f"{rate:.2f}".replace("-", "−"),
        fontsize=6.5,
        padding=2,
    )
    for text in texts:
        text.set(
            bbox=box,
            zorder=3,
            rotation=90 if crowded else 0,
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
    axes: Axes,
    rates: pd.DataFrame,
    rate_per_s: float | Mapping[float, float],
) -> None:
    """Draw the simulated growth rate over bars of equal width, one per interval."""
    style: dict[str, Any] = {
        "color": RUN_COLOURS[1],
        "linestyle": "--",
    }
    if not isinstance(rate_per_s, Mapping):
        rate = rate_per_s * 1e7
        axes.axhline(
            rate,
            label=f"folding: {rate:.3g}·10⁻⁷ s⁻¹",
            **style,
        )
        return
    weeks = np.array(sorted(rate_per_s))
    values = 1e7 * np.array([rate_per_s[week] for week in weeks])
    ends = np.array([*rates["from_week"], rates["to_week"].iloc[-1]])
    is_inside = (weeks > ends[0]) & (weeks < ends[-1])
    drawn = np.union1d(ends, weeks[is_inside])
    bar_edges = np.arange(len(ends)) - 0.5
    places = np.interp(drawn, ends, bar_edges)
    axes.plot(
        places,
        np.interp(drawn, weeks, values),
        label="folding",
        **style,
    )
