"""The chart of a calibration: scores over the parameters, the surrogate, the optimum and the sensitivities."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .style import FULL_WIDTH_IN, MUTED_COLOUR, RUN_COLOURS, add_letters, light_grid, new_figure, styled

LINE_COLOUR = RUN_COLOURS[0]
OPTIMUM_COLOUR = RUN_COLOURS[1]
UNITS = {"_mm": " (mm)", "_pa": " (Pa)", "_gw": " (GW)", "_per_s": " (1/s)"}
"""Units as shown, by the endings of names."""


@styled
def calibration_chart(
    runs: pd.DataFrame,
    optimum: pd.DataFrame,
    sensitivities: pd.DataFrame,
    profiles: pd.DataFrame,
    *,
    score: str,
    synthetic: bool = False,
) -> Figure:
    """Returns a panel for each parameter with the runs' scores and the surrogate, and one with the sensitivities.

    Parameters
    ----------
    runs : columns of the parameters, round, score (NaN: diverged)
    optimum, sensitivities, profiles
        Tables of `study.surrogate`.
    score
        What the score is called.
    """
    names = list(optimum["parameter"])
    figure = new_figure(FULL_WIDTH_IN, 2.7, synthetic=synthetic)
    panels = figure.subplots(1, len(names) + 1, width_ratios=[1.0] * len(names) + [0.7])
    rows = optimum.set_index("parameter")
    for number, (axes, name) in enumerate(zip(panels, names, strict=False)):
        _parameter_panel(axes, name, runs, rows.loc[name], profiles[profiles["parameter"] == name])
        if number == 0:
            axes.set_ylabel(f"score: {score.replace('_', ' ')}")
    _sensitivity_panel(panels[-1], sensitivities)
    add_letters(panels)
    entries = [panel.get_legend_handles_labels() for panel in (panels[0], panels[-1])]
    handles, labels = ([item for entry in entries for item in entry[part]] for part in (0, 1))
    figure.legend(handles, labels, loc="outside lower center", ncols=5)
    return figure


def shown_name(name: str) -> str:
    """Returns the name of a parameter as it is shown, with its unit in brackets."""
    for ending, unit in UNITS.items():
        if name.endswith(ending):
            name = name.removesuffix(ending) + unit
    return name.replace("_", " ")


def _parameter_panel(axes: Axes, name: str, runs: pd.DataFrame, best: pd.Series, line: pd.DataFrame) -> None:
    axes.axvspan(best["low"], best["high"], color=OPTIMUM_COLOUR, alpha=0.15, linewidth=0, label="95 % of the optima")
    axes.axvline(best["value"], color=OPTIMUM_COLOUR, linestyle="--", label="optimum")
    band = 2 * line["sd"]
    axes.fill_between(
        line["value"], line["mean"] - band, line["mean"] + band, color=LINE_COLOUR, alpha=0.15, linewidth=0
    )
    axes.plot(line["value"], line["mean"], color=LINE_COLOUR, label="surrogate")
    finished = runs[runs["score"].notna()]
    rounds = sorted(runs["round"].unique())
    for number in rounds:
        rows = finished[finished["round"] == number]
        # later rounds are darker
        shade = str(0.75 - 0.75 * rounds.index(number) / max(len(rounds) - 1, 1))
        axes.plot(rows[name], rows["score"], "o", color=shade, markeredgecolor="black", markeredgewidth=0.4,
                  label=f"round {number}")  # fmt: skip
    diverged = runs[runs["score"].isna()]
    if len(diverged):
        top = np.full(len(diverged), float(finished["score"].max()))
        axes.plot(diverged[name], top, "x", color=MUTED_COLOUR, label="diverged")
    axes.set_xlabel(shown_name(name))
    light_grid(axes)


def _sensitivity_panel(axes: Axes, sensitivities: pd.DataFrame) -> None:
    places = np.arange(len(sensitivities))
    for shift, column, label, colour in (
        (-0.18, "first_order", "variance by it alone", LINE_COLOUR),
        (0.18, "total", "and by its interactions", MUTED_COLOUR),
    ):
        values = sensitivities[column].clip(0, 1)
        axes.barh(places + shift, values, height=0.34, color=colour, label=label)
    axes.set_yticks(places, [shown_name(name).replace(" ", "\n") for name in sensitivities["parameter"]])
    axes.invert_yaxis()
    axes.set_xlim(0, 1)
    axes.set_xlabel("part of the variance")
