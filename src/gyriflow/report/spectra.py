"""Charts of the SpAnGy spectra: relative power of the folds' frequency bands."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import Transform

from ..errors import InputError
from ..parameters.metrics import FOLD_BANDS
from ..parameters.terms import SIDES
from .style import (
    FULL_WIDTH_IN,
    MEASURED,
    MUTED_COLOUR,
    REAL_BRAIN,
    REAL_COLOUR,
    add_letters,
    chosen_colours,
    from_zero,
    light_grid,
    new_figure,
    run_legend,
    styled,
    week_axis,
    week_label,
)

_FOLDS = {4: "primary", 5: "secondary", 6: "tertiary"}
_INCOMPLETE_HATCH = "//////"


def _with_band_numbers(spectra: pd.DataFrame, bands: Sequence[int]) -> pd.DataFrame:
    """Returns the rows of the bands, written as 4 or "B4", with whole numbers and a column `trusted`."""
    numbers = spectra["band"].astype(str).str.removeprefix("B").astype(int)
    trusted = spectra["complete"] & spectra["denominator_complete"] & spectra["resolved"]
    chosen = spectra.assign(band=numbers, trusted=trusted)
    return chosen[numbers.isin(bands)]


def _untrusted_bars(axes: Axes, bars: Sequence, trusted: Sequence[bool]) -> None:
    for bar, good in zip(bars, trusted, strict=True):
        if not good:
            bar.set(hatch=_INCOMPLETE_HATCH, edgecolor="white", linewidth=0)


def _beyond_the_modes(axes: Axes, x: float, transform: Transform, *, rotation: float = 0.0) -> None:
    text = axes.text(x, 0.5, "beyond the\nmodes computed", transform=transform, ha="center", va="center")
    text.set_rotation(rotation)


def _untrusted_legend(*, bars: bool = False, points: bool = False, stars: bool = False) -> list[Artist]:
    """Returns the entries of the legend for what is drawn of bands that are cut off or not resolved."""
    entries: list[Artist] = []
    label = "cut off or not resolved, or a share of such"
    if bars:
        entries.append(Patch(facecolor=MUTED_COLOUR, edgecolor="white", hatch=_INCOMPLETE_HATCH, label=label))
    for marker, size, drawn, colour in (("o", 5, points, MUTED_COLOUR), ("*", 8, stars, REAL_COLOUR)):
        if drawn:
            said = "the same, of the real brain" if entries else label
            hollow = Line2D([], [], color=colour, marker=marker, markersize=size, markerfacecolor="white", label=said)
            hollow.set_linestyle("none")
            entries.append(hollow)
    return entries


def _sides_of(rows: pd.DataFrame) -> list[str]:
    """Returns the hemispheres that some brain of a table has, left first."""
    return [side for side in SIDES if (rows["hemisphere"] == side).any()]


@styled
def spectra_chart(
    spectra: pd.DataFrame,
    *,
    week: float,
    bands: Sequence[int] = FOLD_BANDS,
    runs: Sequence[str] = (),
    colours: Mapping[str, Any] | None = None,
    measured: str = REAL_BRAIN,
    synthetic: bool = False,
) -> Figure:
    """Returns the relative power of the bands at one week: runs as bars, measured brains as stars, a panel per side.

    Bars of bands that are cut off or not resolved by the surface are hatched, such stars open, and so are all where a
    band that they are shares of is cut off. A band without any power is said to be beyond the modes.

    Parameters
    ----------
    spectra : columns run, week, hemisphere, band, relative_power, complete, denominator_complete, resolved
    week
        Week in GW.
    runs
        All runs of the study, which settle the colours.
    colours : {run: colour}
        Other colours, in this order.

    Raises
    ------
    InputError
        If the table has no such band at this week.
    """
    rows = _with_band_numbers(spectra, bands)
    rows = rows[(rows["week"] - week).abs() < 1e-6]
    if rows.empty:
        raise InputError(f"no spectrum at {week_label(week)}", found=sorted(set(spectra["week"])))
    colours = chosen_colours(rows["run"], runs) if colours is None else colours
    figure = new_figure(FULL_WIDTH_IN, 3.0, synthetic=synthetic, measured=measured)
    sides = _sides_of(rows)
    panels = figure.subplots(1, len(sides), sharey=True, squeeze=False)[0]
    width = 0.8 / max(len(colours), 1)
    for axes, hemisphere in zip(panels, sides, strict=True):
        side = rows[rows["hemisphere"] == hemisphere]
        for index, (run, colour) in enumerate(colours.items()):
            of_run = side[side["run"] == run]
            position = [bands.index(band) - 0.4 + (index + 0.5) * width for band in of_run["band"]]
            bars = axes.bar(position, of_run["relative_power"], width=0.92 * width, color=colour)
            _untrusted_bars(axes, list(bars), list(of_run["trusted"]))
        for _, real in side[side["run"] == MEASURED].iterrows():
            centre = bands.index(real["band"])
            axes.hlines(real["relative_power"], centre - 0.42, centre + 0.42, color=REAL_COLOUR, linewidth=0.9)
            face = REAL_COLOUR if real["trusted"] else "white"
            axes.plot(centre, real["relative_power"], "*", color=REAL_COLOUR, markerfacecolor=face, markersize=8)
        for place, band in enumerate(bands):
            if not side.loc[side["band"] == band, "relative_power"].notna().any():
                _beyond_the_modes(axes, place, axes.get_xaxis_transform(), rotation=90.0)
        axes.set_xticks(range(len(bands)), [f"B{band}\n{_FOLDS.get(band, '')}" for band in bands])
        axes.set_xlabel("SpAnGy band, and the folds that go with it")
        axes.set_xlim(-0.5, len(bands) - 0.5)
        axes.set_title(f"{hemisphere} hemisphere")
        light_grid(axes)
    panels[0].set_ylabel("relative power")
    from_zero(panels[0])
    untrusted = rows[rows["relative_power"].notna() & ~rows["trusted"]]
    marks = set((untrusted["run"] == MEASURED).to_list())
    extra = _untrusted_legend(bars=False in marks, stars=True in marks)
    add_letters(panels)
    name = measured if MEASURED in set(rows["run"]) else ""
    run_legend(figure, colours, measured=name, bars=True, extra=extra)
    return figure


@styled
def spectra_weeks_chart(
    spectra: pd.DataFrame,
    *,
    bands: Sequence[int] = FOLD_BANDS,
    runs: Sequence[str] = (),
    measured: str = REAL_BRAIN,
    synthetic: bool = False,
) -> Figure:
    """Returns the relative power of the bands over weeks: a row per hemisphere, a column per band.

    Runs are lines, measured brains black stars; bands that are cut off, are shares of such, or are not resolved have
    open markers.

    Parameters
    ----------
    spectra : columns run, week, hemisphere, band, relative_power, complete, denominator_complete, resolved
    """
    rows = _with_band_numbers(spectra, bands)
    colours = chosen_colours(rows["run"], runs)
    sides = _sides_of(rows)
    height = 4.2 if len(sides) == 2 else 2.6
    figure = new_figure(FULL_WIDTH_IN, height, synthetic=synthetic, measured=measured)
    panels = figure.subplots(len(sides), len(bands), sharex=True, sharey="col", squeeze=False)
    for line, hemisphere in zip(panels, sides, strict=True):
        for axes, band in zip(line, bands, strict=True):
            here = rows[(rows["hemisphere"] == hemisphere) & (rows["band"] == band)]
            for run in [*colours, MEASURED]:
                series = here[here["run"] == run].sort_values("week")
                colour, marker, size = (REAL_COLOUR, "*", 7) if run == MEASURED else (colours[run], "o", 3)
                if run != MEASURED:
                    axes.plot(series["week"], series["relative_power"], color=colour)
                for trusted, part in series.groupby("trusted"):
                    face = colour if trusted else "white"
                    axes.plot(
                        part["week"],
                        part["relative_power"],
                        marker,
                        color=colour,
                        markerfacecolor=face,
                        markersize=size,
                    )
            week_axis(axes, rows["week"])
            light_grid(axes)
            if not here["relative_power"].notna().any():
                _beyond_the_modes(axes, 0.5, axes.transAxes)
                axes.set_yticks([])
            if hemisphere == sides[0]:
                axes.set_title(f"B{band}, {_FOLDS[band]} folds" if band in _FOLDS else f"B{band}")
            if hemisphere != sides[-1]:
                axes.set_xlabel("")
        line[0].set_ylabel(f"{hemisphere} hemisphere\nrelative power")
    for axes in panels[0]:
        from_zero(axes)
    untrusted = rows[rows["relative_power"].notna() & ~rows["trusted"]]
    marks = set((untrusted["run"] == MEASURED).to_list())
    extra = _untrusted_legend(points=False in marks, stars=True in marks)
    add_letters(panels.flat)
    run_legend(figure, colours, measured=measured if MEASURED in set(rows["run"]) else "", extra=extra)
    return figure
