"""Charts of the spectra of folds: bands over the weeks, and bands of the runs of a sweep."""

from collections.abc import Mapping, Sequence
from itertools import product, zip_longest
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.transforms import Transform

from ..settings.terms import FOLD_BANDS, MEASURED, OBSERVED_BRAIN, PROXIES, SIDES
from .labels import plain, value_labels
from .style import (
    MUTED_COLOUR,
    OBSERVED_COLOUR,
    from_zero,
    panel_figure,
    run_colours,
    run_legend,
    runs_by_name,
    star,
    styled,
)
from .weeks import NO_SUBJECTS, group_shades, observed_marks, run_lines, weeks_chart

_FOLDS = {4: "primary", 5: "secondary", 6: "tertiary"}
_HATCH = "//////"


def _band_rows(spectra: pd.DataFrame, bands: Sequence[int], proxy: str) -> pd.DataFrame:
    """Return the rows of some bands in the spectra of a proxy, with a column `trusted`."""
    trusted = spectra["complete"] & spectra["denominator_complete"] & spectra["resolved"]
    return spectra.assign(trusted=trusted)[spectra["band"].isin(bands) & (spectra["proxy"] == proxy)]


def _beyond_the_modes(axes: Axes, x: float, transform: Transform, *, rotation: float = 0.0) -> None:
    words = "beyond the\nmodes computed"
    axes.text(x, 0.5, words, transform=transform, ha="center", va="center", rotation=rotation)


def _spectra_legend(
    figure: Figure, rows: pd.DataFrame, colours: Mapping[str, Any], name: str, groups: list[Artist], *, bars: bool
) -> None:
    """Draw the legend of a chart of bands, with groups and the marks of bands that are cut off or not resolved."""
    untrusted = set(rows.loc[rows["relative_power"].notna() & ~rows["trusted"], "run"])
    label = "band cut off or not resolved"
    extra: list[Artist] = []
    if untrusted - {MEASURED}:
        hatched = Patch(facecolor=MUTED_COLOUR, edgecolor="white", hatch=_HATCH, label=label)
        hollow = star(label, MUTED_COLOUR, marker="o", markersize=5, markerfacecolor="white")
        extra.append(hatched if bars else hollow)
    if MEASURED in untrusted:
        words = "the same, observed brain" if extra else label
        extra.append(star(words, markersize=8, markerfacecolor="white"))
    name = name if (rows["run"] == MEASURED).any() else ""
    run_legend(figure, colours, observed_name=name, bars=bars, extra=[*groups, *extra])


def _sides_in(rows: pd.DataFrame) -> list[str]:
    """Return the hemispheres that occur in a table, left first."""
    return [side for side in SIDES if (rows["hemisphere"] == side).any()]


@styled
def spectra_weeks_chart(
    spectra: pd.DataFrame,
    *,
    runs: Sequence[str] = (),
    observed_name: str = OBSERVED_BRAIN,
    subjects: Mapping[str, str] = NO_SUBJECTS,
    groups: Mapping[str, str] = NO_SUBJECTS,
) -> Figure:
    """Draw the relative power of the fold bands of mean curvature over weeks: a row per hemisphere, a column per band.

    Runs are lines, observed brains black stars; scans of a subject are joined and groups coloured. Markers are open if
    the band, or one in the denominator of the relative power, is cut off, or if the surface does not resolve it.
    `spectra` has the columns subject, run, week, hemisphere, proxy, band, relative_power, complete,
    denominator_complete, resolved.
    """
    with_power = set(spectra.loc[spectra["relative_power"].notna(), "band"])
    bands = [band for band in FOLD_BANDS if band in with_power] or list(FOLD_BANDS)
    rows = _band_rows(runs_by_name(spectra), bands, PROXIES[0])
    rows = rows.assign(panel=rows["hemisphere"] + rows["band"].astype(str), value=rows["relative_power"])
    sides, colours = _sides_in(rows), run_colours(rows["run"], runs)
    shades, entries = group_shades(groups, colours)
    layers = run_lines(rows, colours) + observed_marks(rows[rows["run"] == MEASURED], subjects=subjects, shades=shades)
    cells = {f"{side}{band}": (side, band) for side, band in product(sides, bands)}
    heads = [f"B{band}, {_FOLDS[band]} folds" for band in bands]
    titles = dict(zip_longest(cells, heads, fillvalue=""))
    layout: dict[str, Any] = {"per_row": len(bands), "panel_in": 1.75, "sharex": True, "sharey": "col"}
    figure, panels = weeks_chart(titles, layers, rows["week"], **layout)
    for cell, (side, band) in cells.items():
        axes = panels[cell]
        if not rows.loc[rows["panel"] == cell, "value"].notna().any():
            _beyond_the_modes(axes, 0.5, axes.transAxes)
            axes.set_yticks([])
        if side != sides[-1]:
            axes.set_xlabel("")
        if band == bands[0]:
            axes.set_ylabel(f"{side} hemisphere\nrelative power")
        if side == sides[0]:
            from_zero(axes)
    _spectra_legend(figure, rows, colours, observed_name, entries, bars=False)
    return figure


@styled
def influence_spectra(
    members: Mapping[str, pd.DataFrame | None],
    observed: Sequence[pd.DataFrame],
    *,
    values: Mapping[str, Mapping[str, Any]],
    week: float,
    observed_name: str = OBSERVED_BRAIN,
) -> Figure:
    """Draw the relative power in B4 to B6 of the runs of a sweep and of the observed brain at one week (in GW).

    A panel per proxy and hemisphere. Runs are bars, from pale to dark in their order; observed brains are stars. They
    are hatched or open if the band, or one in the denominator of the relative power, is cut off, or if the surface does
    not resolve it. A band without any power is labelled as beyond the modes.

    `members` are by run tables as for `spectra_weeks_chart`, None for a run that ended before the week; `observed`
    those of observed brains, whose run is "real". `values` are by run the varied parameters with their values, in the
    order of the sweep.
    """
    labels = dict(zip(values, value_labels(list(values.values())), strict=True))
    simulated = [table.assign(run=labels[run]) for run, table in members.items() if table is not None]
    shades = mpl.colormaps["YlGnBu"](np.linspace(0.3, 0.95, max(len(labels), 2)))
    colours = dict(zip(labels.values(), shades, strict=False))
    spectra = pd.concat([*simulated, *observed])
    by_proxy = {proxy: _band_rows(spectra[spectra["week"] == week], FOLD_BANDS, proxy) for proxy in PROXIES}
    rows = pd.concat(by_proxy.values())
    sides = _sides_in(rows)
    figure, panels = panel_figure(len(sides) * len(PROXIES), per_row=len(sides), panel_in=2.3, sharey="row")
    width = 0.8 / len(colours)
    for axes, (proxy, hemisphere) in zip(panels, product(PROXIES, sides), strict=True):
        side = by_proxy[proxy][by_proxy[proxy]["hemisphere"] == hemisphere]
        for index, (run, colour) in enumerate(colours.items()):
            run_rows = side[side["run"] == run]
            position = [FOLD_BANDS.index(band) - 0.4 + (index + 0.5) * width for band in run_rows["band"]]
            bars = axes.bar(position, run_rows["relative_power"], width=0.92 * width, color=colour)
            for bar, trusted in zip(bars, run_rows["trusted"], strict=True):
                if not trusted:
                    bar.set(hatch=_HATCH, edgecolor="white", linewidth=0)
        for _, row in side[side["run"] == MEASURED].iterrows():
            centre, power = FOLD_BANDS.index(row["band"]), row["relative_power"]
            axes.hlines(power, centre - 0.42, centre + 0.42, color=OBSERVED_COLOUR, linewidth=0.9)
            face = OBSERVED_COLOUR if row["trusted"] else "white"
            axes.plot(centre, power, "*", color=OBSERVED_COLOUR, markerfacecolor=face, markersize=8)
        for place, band in enumerate(FOLD_BANDS):
            if not side.loc[side["band"] == band, "relative_power"].notna().any():
                _beyond_the_modes(axes, place, axes.get_xaxis_transform(), rotation=90.0)
        axes.set_xticks(range(len(FOLD_BANDS)), [f"B{band}\n{_FOLDS[band]}" for band in FOLD_BANDS])
        axes.set_xlabel("SpAnGy band, and the folds that go with it")
        axes.set_xlim(-0.5, len(FOLD_BANDS) - 0.5)
        axes.set_title(f"{hemisphere} hemisphere, {plain(proxy)}")
        if hemisphere == sides[0]:
            axes.set_ylabel("relative power")
            from_zero(axes)
    _spectra_legend(figure, rows, colours, observed_name, [], bars=True)
    return figure
