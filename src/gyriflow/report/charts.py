"""Charts over the weeks: metrics of brains and of their regions, norms, and the spectra of folds.

As in the other charts, `runs` are all runs of a study, which determine the colours, and `observed_name` is the name of
observed brains.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import Transform

from ..errors import InputError
from ..settings.terms import FOLD_BANDS, MEASURED, OBSERVED_BRAIN, PROXIES, SIDES
from .labels import metric_title, plain, value_labels
from .pictures import region_colours
from .style import (
    MUTED_COLOUR,
    NEUTRAL_COLOUR,
    OBSERVED_COLOUR,
    RUN_COLOURS,
    from_zero,
    panel_figure,
    run_colours,
    run_legend,
    runs_by_name,
    star,
    styled,
    week_axis,
)

OVERVIEW_METRICS = (
    *("volume", "area", "gyrification_index", "gyrification_index_envelope", "mean_curvedness", "mean_shape_index"),
    *("mean_sulcal_depth", "folding_index", "mean_thickness"),
)
NORM_METRICS = ("volume", "area", "gyrification_index", "mean_sulcal_depth", "mean_curvedness", "mean_thickness")
REGION_METRICS = ("area", "mean_sulcal_depth", "mean_curvature", "mean_local_gyrification_index", "mean_thickness")
"""The metrics of each chart, in their order."""
SUBJECT_MARKERS = ("s", "^", "D", "v", "P", "X", "<", ">")
"""Markers of the subjects of a cohort. With more subjects, none has a marker of its own."""
NO_SUBJECTS: Mapping[str, str] = {}
NOT_FROM_ZERO = ("mean_curvature", "mean_local_gyrification_index")
LINES: tuple[Literal["-", "--", ":"], ...] = ("-", "--", ":")
_FOLDS = {4: "primary", 5: "secondary", 6: "tertiary"}
_HATCH = "//////"


def _present(metrics: pd.DataFrame, names: Sequence[str]) -> list[str]:
    """Return the names of the metrics that a table has; InputError if it has none of them."""
    present = [name for name in names if (metrics["metric"] == name).any()]
    if not present:
        raise InputError("no metric to draw", found=sorted(set(metrics["metric"])), expected=list(names))
    return present


def _title(axes: Axes, rows: pd.DataFrame) -> None:
    axes.set_title(metric_title(rows["metric"].iloc[0]))


def _lines(axes: Axes, rows: pd.DataFrame, colours: Mapping[str, Any]) -> None:
    for run, run_rows in rows[rows["run"] != MEASURED].groupby("run", sort=False):
        ordered = run_rows.sort_values("week")
        axes.plot(ordered["week"], ordered["value"], "o-", color=colours[str(run)], markersize=2.5)


def _markers(rows: pd.DataFrame, subjects: Mapping[str, str]) -> dict[str, str]:
    """Return the marker of each subject with observed brains; none if there are more subjects than markers."""
    brains = rows.loc[rows["run"] == MEASURED, "subject"]
    people = list(dict.fromkeys(subjects[brain] for brain in brains if brain in subjects))
    return dict(zip(people, SUBJECT_MARKERS, strict=False)) if 1 < len(people) <= len(SUBJECT_MARKERS) else {}


def _stars(
    axes: Axes,
    rows: pd.DataFrame,
    colour: Any = OBSERVED_COLOUR,
    *,
    subjects: Mapping[str, str] = NO_SUBJECTS,
    markers: Mapping[str, str] = NO_SUBJECTS,
    shades: Mapping[str, Any] = NO_SUBJECTS,
    column: str = "value",
    **style: Any,
) -> None:
    """Draw observed brains, in their `shades` or else `colour`; scans of a subject are joined and have its marker."""
    for person, scans in rows.groupby(rows["subject"].map(lambda brain: subjects.get(brain, "")), sort=False):
        ordered, marker = scans.sort_values("week"), markers.get(str(person), "*")
        if person and len(scans) > 1:
            axes.plot(ordered["week"], ordered[column], "-", color=MUTED_COLOUR, linewidth=0.8, zorder=2.5)
        size = 7 if marker == "*" else 4.5
        own = ordered["subject"].map(lambda brain: shades.get(brain, colour))
        for shade, part in ordered.groupby(own, sort=False):
            axes.plot(part["week"], part[column], marker, **{"color": shade, "markersize": size, "zorder": 3} | style)


def _shades(groups: Mapping[str, str], colours: Mapping[str, Any]) -> tuple[dict[str, Any], list[Artist]]:
    """Return the colour of each brain in a group, not used by any run, and the legend entries."""
    free = [colour for colour in RUN_COLOURS if colour not in colours.values()]
    group_colours = dict(zip(dict.fromkeys(groups.values()), free, strict=False))
    entries: list[Artist] = [star(name, colour, marker="o", markersize=5) for name, colour in group_colours.items()]
    return {brain: group_colours[name] for brain, name in groups.items() if name in group_colours}, entries


@styled
def metrics_chart(
    metrics: pd.DataFrame,
    *,
    runs: Sequence[str] = (),
    observed_name: str = OBSERVED_BRAIN,
    subjects: Mapping[str, str] = NO_SUBJECTS,
    groups: Mapping[str, str] = NO_SUBJECTS,
) -> Figure:
    """Draw a panel per metric of whole brains over weeks: runs as lines, observed brains as black stars.

    The scans of a subject are joined. Subjects have markers if there are at most eight; groups of brains have colours.
    Metrics that the table lacks are left out.

    Parameters
    ----------
    metrics : columns subject, run, week, hemisphere, metric, value, unit
        `run` is "real" for observed brains; InputError if the table has none of the metrics.
    subjects : {brain: subject}, if known
    groups : {brain: its value of a covariate}
    """
    whole = runs_by_name(metrics[metrics["hemisphere"] == "whole"])
    present, colours = _present(whole, OVERVIEW_METRICS), run_colours(whole["run"], runs)
    markers, (shades, entries) = _markers(whole, subjects), _shades(groups, colours)
    figure, panels = panel_figure(len(present))
    for axes, name in zip(panels, present, strict=True):
        rows = whole[whole["metric"] == name]
        _lines(axes, rows, colours)
        _stars(axes, rows[rows["run"] == MEASURED], subjects=subjects, markers=markers, shades=shades)
        _title(axes, rows)
        week_axis(axes, whole["week"])
    named = [*(subjects if markers else ()), *shades]
    stars = whole.loc[(whole["run"] == MEASURED) & ~whole["subject"].isin(named), "run"]
    run_legend(figure, colours, observed_name=observed_name if len(stars) else "", markers=markers, extra=entries)
    return figure


@styled
def intervals_chart(ensemble: pd.DataFrame) -> Figure:
    """Draw the intervals of an ensemble over the weeks, a panel per metric, with its run and the observed brains.

    `ensemble` has columns week, metric, run, low, high, observed.
    """
    names = list(dict.fromkeys(ensemble["metric"]))
    figure, panels = panel_figure(len(names), per_row=2)
    for axes, name in zip(panels, names, strict=True):
        rows = ensemble[ensemble["metric"] == name].sort_values("week")
        axes.fill_between(rows["week"], rows["low"], rows["high"], color=NEUTRAL_COLOUR, linewidth=0)
        axes.plot(rows["week"], rows["run"], "o-", color=RUN_COLOURS[0], markersize=2.5)
        axes.plot(rows["week"], rows["observed"], "*", color=OBSERVED_COLOUR, markersize=7)
        _title(axes, rows)
        week_axis(axes, ensemble["week"])
    extra: list[Artist] = [
        Line2D([], [], color=RUN_COLOURS[0], marker="o", markersize=2.5, label="run"),
        Patch(color=NEUTRAL_COLOUR, label="interval"),
    ]
    extra += [star(OBSERVED_BRAIN)] if ensemble["observed"].notna().any() else []
    run_legend(figure, {}, extra=extra)
    return figure


MANY_BRAINS = 30
"""Number of reference brains above which their marks are small."""


@styled
def norms_chart(
    metrics: pd.DataFrame,
    curves: pd.DataFrame,
    *,
    reference: Sequence[str],
    brains: Sequence[str],
    runs: Sequence[str] = (),
    observed_name: str = OBSERVED_BRAIN,
    subjects: Mapping[str, str] = NO_SUBJECTS,
    groups: Mapping[str, str] = NO_SUBJECTS,
) -> Figure:
    """Draw a panel per metric of whole brains: reference brains, their norm curve, other brains and runs.

    Bands are between the 5th and 95th and the 25th and 75th centile, drawn if the spread of individuals is known. Stars
    are observed brains: black in the reference, else coloured, as are groups. Lines are runs.

    Parameters
    ----------
    metrics : columns subject, run, week, hemisphere, metric, value, unit
    curves : columns hemisphere, metric, week, expected, q05, q25, q75, q95
    reference
        Brains that the curves were fitted to.
    brains
        Brains with the same hemispheres as the reference. Only they, and simulations from them, are drawn.
    subjects, groups : as for `metrics_chart`

    InputError if the table has none of the metrics.
    """
    whole = runs_by_name(metrics[(metrics["hemisphere"] == "whole") & metrics["subject"].isin(brains)])
    present, colours = _present(whole, NORM_METRICS), run_colours(whole["run"], runs)
    markers, (shades, extra) = _markers(whole, subjects), _shades(groups, colours)
    figure, panels = panel_figure(len(present), panel_in=2.0, foot_in=0.6)
    has_other_brains = False
    for axes, name in zip(panels, present, strict=True):
        rows = whole[whole["metric"] == name]
        # without rows, the columns are not numeric
        if len(band := curves[(curves["hemisphere"] == "whole") & (curves["metric"] == name)]):
            for low, high, alpha in (("q05", "q95", 0.6), ("q25", "q75", 1.0)):
                axes.fill_between(band["week"], band[low], band[high], color=NEUTRAL_COLOUR, alpha=alpha, linewidth=0)
            axes.plot(band["week"], band["expected"], color=MUTED_COLOUR, zorder=4)
            for quantile in ("q05", "q25", "q75", "q95"):
                axes.plot(band["week"], band[quantile], color=MUTED_COLOUR, linewidth=0.6, zorder=4)
        _lines(axes, rows, colours)
        observed = rows[rows["run"] == MEASURED]
        within = observed["subject"].isin(reference)
        small: dict[str, Any] = {"markersize": 3.0} if within.sum() > MANY_BRAINS else {}
        _stars(axes, observed[within], subjects=subjects, markers=markers, shades=shades, **small)
        _stars(axes, observed[~within], RUN_COLOURS[-1], subjects=subjects, markers=markers, shades=shades)
        has_other_brains |= bool((~within & ~observed["subject"].isin(shades)).any())
        _title(axes, rows)
        week_axis(axes, rows["week"])
    extra += [star("other observed brains", RUN_COLOURS[-1])] if has_other_brains else []
    if curves["q05"].notna().any():
        extra.append(Patch(color=NEUTRAL_COLOUR, label="centiles 5, 25, 50, 75, 95"))
    elif len(curves):
        extra.append(Line2D([], [], color=MUTED_COLOUR, label="norm, spread unknown"))
    run_legend(figure, colours, observed_name=observed_name, markers=markers, extra=extra)
    return figure


@styled
def regions_chart(regions: pd.DataFrame, asymmetry: pd.DataFrame, *, observed_name: str = OBSERVED_BRAIN) -> Figure:
    """Draw a panel per metric over the weeks, a colour per region: both sides together, and the asymmetry of area.

    Observed brains are stars, the first three runs lines. Areas are sums of both sides, other values their means.

    Parameters
    ----------
    regions : columns subject, run, week, hemisphere, region, metric, value, unit
    asymmetry : columns subject, run, week, region, metric, asymmetry_index
    """
    regions, asymmetry = runs_by_name(regions), runs_by_name(asymmetry)
    colours, present = region_colours(regions["region"]), _present(regions, REGION_METRICS)
    lines = dict(zip(run_colours(regions["run"]), LINES, strict=False))
    figure, panels = panel_figure(len(present) + 1, foot_in=0.75)
    for axes, name in zip(panels, present, strict=False):
        rows = regions[regions["metric"] == name]
        sides = rows.groupby(["subject", "run", "week", "region"], sort=False)["value"]
        _region_lines(axes, (sides.sum() if name == "area" else sides.mean()).reset_index(), colours, lines)
        _title(axes, rows)
        if name == "area":
            axes.set_title(f"{axes.get_title()}, both sides")
        if name not in NOT_FROM_ZERO:
            from_zero(axes)
    rows = asymmetry[(asymmetry["metric"] == "area") & asymmetry["region"].isin(colours)]
    _region_lines(panels[-1], rows.rename(columns={"asymmetry_index": "value"}), colours, lines)
    panels[-1].axhline(0, color=MUTED_COLOUR, linewidth=0.8)
    panels[-1].set_title("asymmetry of area, 2 (L − R)/(L + R)")
    extra = [Line2D([], [], color=c, marker="s", linestyle="none", label=name) for name, c in colours.items()]
    extra += [Line2D([], [], color=MUTED_COLOUR, linestyle=line, label=run) for run, line in lines.items()]
    run_legend(figure, {}, extra=[*extra, star(observed_name, MUTED_COLOUR)])
    return figure


def _region_lines(axes: Axes, values: pd.DataFrame, colours: Mapping[Any, Any], lines: Mapping[str, str]) -> None:
    """Draw the value of each region over the weeks."""
    for (region, run), rows in values.groupby(["region", "run"], sort=False):
        ordered = rows.sort_values("week")
        if run == MEASURED:
            _stars(axes, ordered, colours[region], markersize=6)
        elif run in lines:
            axes.plot(ordered["week"], ordered["value"], lines[str(run)], color=colours[region], linewidth=1.1)
    week_axis(axes, values["week"])


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
def influence_spectra(
    members: Mapping[str, pd.DataFrame | None],
    observed: Sequence[pd.DataFrame],
    *,
    values: Mapping[str, Mapping[str, Any]],
    week: float,
    observed_name: str = OBSERVED_BRAIN,
) -> Figure:
    """Draw the relative power in B4 to B6 of the runs of a sweep and of the observed brain at one week.

    A panel per proxy and hemisphere. Runs are bars, from pale to dark in their order; observed brains are stars. They
    are hatched or open if the band, or one in the denominator of the relative power, is cut off, or if the surface does
    not resolve it. A band without any power is labelled as beyond the modes.

    Parameters
    ----------
    members : {run: columns subject, week, hemisphere, proxy, band, relative_power, complete, denominator_complete,
        resolved}. None for a run that ended before the week.
    observed : the same of observed brains, with run "real"
    values : {run: {parameter: value}}
        The varied parameters, in the order of the sweep.
    week : in GW
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

    Parameters
    ----------
    spectra
        Columns subject, run, week, hemisphere, proxy, band, relative_power, complete, denominator_complete, resolved.
    """
    with_power = set(spectra.loc[spectra["relative_power"].notna(), "band"])
    bands = [band for band in FOLD_BANDS if band in with_power] or list(FOLD_BANDS)
    rows = _band_rows(runs_by_name(spectra), bands, PROXIES[0])
    sides, colours = _sides_in(rows), run_colours(rows["run"], runs)
    shades, entries = _shades(groups, colours)
    layout: dict[str, Any] = {"per_row": len(bands), "panel_in": 1.75, "sharex": True, "sharey": "col"}
    figure, panels = panel_figure(len(sides) * len(bands), **layout)
    for axes, (hemisphere, band) in zip(panels, product(sides, bands), strict=True):
        cell = rows[(rows["hemisphere"] == hemisphere) & (rows["band"] == band)]
        for run in [*colours, MEASURED]:
            series = cell[cell["run"] == run].sort_values("week")
            if run == MEASURED:
                _stars(axes, series, subjects=subjects, column="relative_power", markersize=0)
            else:
                axes.plot(series["week"], series["relative_power"], color=colours[run])
            for trusted, part in series.groupby("trusted"):
                style: dict[str, Any] = {} if trusted else {"markerfacecolor": "white"}
                if run == MEASURED:
                    _stars(axes, part, shades=shades, column="relative_power", **style)
                else:
                    axes.plot(part["week"], part["relative_power"], "o", color=colours[run], markersize=3, **style)
        week_axis(axes, rows["week"])
        if not cell["relative_power"].notna().any():
            _beyond_the_modes(axes, 0.5, axes.transAxes)
            axes.set_yticks([])
        if hemisphere == sides[0]:
            axes.set_title(f"B{band}, {_FOLDS[band]} folds")
        if hemisphere != sides[-1]:
            axes.set_xlabel("")
        if band == bands[0]:
            axes.set_ylabel(f"{hemisphere} hemisphere\nrelative power")
    for axes in panels[: len(bands)]:
        from_zero(axes)
    _spectra_legend(figure, rows, colours, observed_name, entries, bars=False)
    return figure
