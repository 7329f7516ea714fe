"""Charts over the weeks: metrics of brains and of their regions, norms, and the spectra of folds."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Unpack

import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import Transform

from ..errors import InputError
from ..parameters.terms import FOLD_BANDS, MEASURED, SIDES
from .labels import METRICS, week_label, with_unit
from .pictures import region_colours
from .style import (
    MUTED_COLOUR,
    NEUTRAL_COLOUR,
    REAL_BRAIN,
    REAL_COLOUR,
    RUN_COLOURS,
    Shown,
    from_zero,
    light_grid,
    run_legend,
    run_panels,
    runs_by_name,
    simulated_runs,
    star,
    styled,
    week_axis,
)

OVERVIEW = (
    *("volume", "area", "gyrification_index", "gyrification_index_envelope", "mean_curvedness", "mean_shape_index"),
    *("mean_sulcal_depth", "folding_index", "mean_thickness"),
)
WITH_NORMS = ("volume", "area", "gyrification_index", "mean_sulcal_depth", "mean_curvedness", "mean_thickness")
OF_REGIONS = ("area", "mean_sulcal_depth", "mean_curvature", "mean_local_gyrification_index", "mean_thickness")
"""The metrics of each chart, in their order."""
NOT_FROM_ZERO = ("mean_curvature", "mean_local_gyrification_index")
LINES: tuple[Literal["-", "--", ":"], ...] = ("-", "--", ":")
HEMISPHERE_LINES = dict(zip(("whole", *SIDES), LINES, strict=True))
_FOLDS = {4: "primary", 5: "secondary", 6: "tertiary"}
_HATCH = "//////"


def _present(metrics: pd.DataFrame, names: Sequence[str]) -> list[str]:
    """Returns the names of the metrics that a table has; InputError where it has none of them."""
    present = [name for name in names if (metrics["metric"] == name).any()]
    if not present:
        raise InputError("no metric to draw", found=sorted(set(metrics["metric"])), expected=list(names))
    return present


def _title(axes: Axes, rows: pd.DataFrame, behind: str = "") -> None:
    axes.set_title(with_unit(METRICS[rows["metric"].iloc[0]], rows["unit"].iloc[0]) + behind)


def _name_of_real(rows: pd.DataFrame, shown: Shown) -> str:
    """Returns what the measured brains of a table are called, nothing where it has none."""
    return shown.get("measured", REAL_BRAIN) if MEASURED in set(rows["run"]) else ""


def _stars(axes: Axes, rows: pd.DataFrame, colour: Any = REAL_COLOUR, *, column: str = "value", **look: Any) -> None:
    if len(rows):
        axes.plot(rows["week"], rows[column], "*", **{"color": colour, "markersize": 7, "zorder": 3} | look)


@styled
def metrics_chart(metrics: pd.DataFrame, **shown: Unpack[Shown]) -> Figure:
    """Returns a panel per metric over weeks: runs as lines, measured brains as black stars.

    A metric that is known for the hemispheres only has dashed lines and full stars for the left one, dotted lines and
    open stars for the right one. Metrics that the table lacks are left out.

    Parameters
    ----------
    metrics : columns subject, run, week, hemisphere, metric, value, unit
        `run` is "real" for measured brains; InputError if the table has none of the metrics.
    """
    metrics = runs_by_name(metrics)
    present = _present(metrics, OVERVIEW)
    figure, panels, colours = run_panels(len(present), metrics["run"], shown)
    drawn: set[str] = set()
    for axes, name in zip(panels, present, strict=True):
        rows = metrics[metrics["metric"] == name]
        sides = {"whole"} if (rows["hemisphere"] == "whole").any() else set(SIDES)
        drawn |= sides
        for (run, side), group in rows[rows["hemisphere"].isin(sides)].groupby(["run", "hemisphere"], sort=False):
            ordered = group.sort_values("week")
            if run == MEASURED:
                _stars(axes, ordered, markerfacecolor="white" if side == "right" else REAL_COLOUR)
            else:
                look: dict[str, Any] = {"linestyle": HEMISPHERE_LINES[str(side)], "marker": "o", "markersize": 2.5}
                axes.plot(ordered["week"], ordered["value"], color=colours[str(run)], **look)
        _title(axes, rows)
        week_axis(axes, metrics["week"])
        light_grid(axes)
    extra = [
        Line2D([], [], color=MUTED_COLOUR, linestyle=HEMISPHERE_LINES[side], label=f"{side} hemisphere")
        for side in SIDES
        if side in drawn
    ]
    run_legend(figure, colours, measured=_name_of_real(metrics, shown), extra=extra)
    return figure


@styled
def norms_chart(
    metrics: pd.DataFrame,
    curves: pd.DataFrame,
    norms: pd.DataFrame,
    *,
    reference: Sequence[str],
    **shown: Unpack[Shown],
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

    InputError where none of the metrics is there.
    """
    whole = runs_by_name(metrics[metrics["hemisphere"] == "whole"])
    present = _present(whole, WITH_NORMS)
    figure, panels, colours = run_panels(len(present), whole["run"], shown, panel_in=2.0, foot_in=0.6)
    others = False
    for axes, name in zip(panels, present, strict=True):
        rows = whole[whole["metric"] == name]
        # a table without rows has no numbers to draw
        if len(band := curves[(curves["hemisphere"] == "whole") & (curves["metric"] == name)]):
            axes.fill_between(band["week"], band["low"], band["high"], color=NEUTRAL_COLOUR, linewidth=0)
            axes.plot(band["week"], band["expected"], color=MUTED_COLOUR)
        bars = norms[(norms["hemisphere"] == "whole") & (norms["metric"] == name)].dropna(subset=["q50"])
        for low, middle, high, week in bars[["q05", "q50", "q95", "week"]].to_numpy():
            axes.plot([week, week], [low, high], color=REAL_COLOUR, linewidth=1.0)
            axes.plot(week, middle, "_", color=REAL_COLOUR, markersize=7)
        for (run, _), brain in rows[rows["run"] != MEASURED].groupby(["run", "subject"], sort=False):
            ordered = brain.sort_values("week")
            axes.plot(ordered["week"], ordered["value"], "o-", color=colours[str(run)], markersize=2.5)
        real = rows[rows["run"] == MEASURED]
        known = real["subject"].isin(reference)
        _stars(axes, real[known], markersize=6)
        _stars(axes, real[~known], RUN_COLOURS[-1])
        others |= bool((~known).any())
        _title(axes, rows)
        week_axis(axes, rows["week"])
        light_grid(axes)
    extra: list[Artist] = [star("other measured brains", RUN_COLOURS[-1])] if others else []
    if len(curves):
        extra.append(Patch(color=NEUTRAL_COLOUR, label="90 % of further brains"))
    run_legend(figure, colours, measured=shown.get("measured", REAL_BRAIN), extra=extra)
    return figure


@styled
def regions_chart(regions: pd.DataFrame, asymmetry: pd.DataFrame, **shown: Unpack[Shown]) -> Figure:
    """Returns a panel per metric over the weeks, a colour per region: both sides together, and the asymmetry of area.

    Measured brains are stars, the first three runs lines. Areas are sums of both sides, other values their means.

    Parameters
    ----------
    regions : columns subject, run, week, hemisphere, region, metric, value, unit
    asymmetry : columns subject, run, week, region, metric, asymmetry_index
    """
    regions, asymmetry = runs_by_name(regions), runs_by_name(asymmetry)
    colours = region_colours(regions["region"])
    present = _present(regions, OF_REGIONS)
    lines = dict(zip(simulated_runs(regions["run"]), LINES, strict=False))
    figure, panels, _ = run_panels(len(present) + 1, (), shown, foot_in=0.75)
    for axes, name in zip(panels, present, strict=False):
        rows = regions[regions["metric"] == name]
        sides = rows.groupby(["subject", "run", "week", "region"], sort=False)["value"]
        _region_lines(axes, (sides.sum() if name == "area" else sides.mean()).reset_index(), colours, lines)
        _title(axes, rows, ", both sides" * (name == "area"))
        if name not in NOT_FROM_ZERO:
            from_zero(axes)
    rows = asymmetry[(asymmetry["metric"] == "area") & asymmetry["region"].isin(colours)]
    _region_lines(panels[-1], rows.rename(columns={"asymmetry_index": "value"}), colours, lines)
    panels[-1].axhline(0, color=MUTED_COLOUR, linewidth=0.8)
    panels[-1].set_title("asymmetry of area, 2 (L − R)/(L + R)")
    extra = [Line2D([], [], color=c, marker="s", linestyle="none", label=name) for name, c in colours.items()]
    extra += [Line2D([], [], color=MUTED_COLOUR, linestyle=line, label=run) for run, line in lines.items()]
    run_legend(figure, {}, extra=[*extra, star(shown.get("measured", REAL_BRAIN), MUTED_COLOUR)])
    return figure


def _region_lines(
    axes: Axes, values: pd.DataFrame, colours: Mapping[Any, Any], lines: Mapping[str, Literal["-", "--", ":"]]
) -> None:
    """Draws the value of each region over the weeks."""
    for (region, run), rows in values.groupby(["region", "run"], sort=False):
        ordered = rows.sort_values("week")
        if run == MEASURED:
            _stars(axes, ordered, colours[region], markersize=6)
        elif run in lines:
            axes.plot(ordered["week"], ordered["value"], lines[str(run)], color=colours[region], linewidth=1.1)
    week_axis(axes, values["week"])
    light_grid(axes)


def _of_bands(spectra: pd.DataFrame, bands: Sequence[int]) -> pd.DataFrame:
    """Returns the rows of the bands, written as 4 or "B4", with whole numbers and a column `trusted`."""
    numbers = spectra["band"].astype(str).str.removeprefix("B").astype(int)
    trusted = spectra["complete"] & spectra["denominator_complete"] & spectra["resolved"]
    return spectra.assign(band=numbers, trusted=trusted)[numbers.isin(bands)]


def _beyond_the_modes(axes: Axes, x: float, transform: Transform, *, rotation: float = 0.0) -> None:
    said = "beyond the\nmodes computed"
    axes.text(x, 0.5, said, transform=transform, ha="center", va="center", rotation=rotation)


def _spectra_legend(
    figure: Figure, rows: pd.DataFrame, colours: Mapping[str, Any], shown: Shown, *, bars: bool
) -> None:
    """Draws the legend of a chart of bands, with what is drawn of bands that are cut off or not resolved."""
    untrusted = rows[rows["relative_power"].notna() & ~rows["trusted"]]
    of_real = set((untrusted["run"] == MEASURED).to_list())
    label = "cut off or not resolved, or a share of such"
    extra: list[Artist] = []
    if False in of_real:
        hatched = Patch(facecolor=MUTED_COLOUR, edgecolor="white", hatch=_HATCH, label=label)
        hollow = star(label, MUTED_COLOUR, marker="o", markersize=5, markerfacecolor="white")
        extra.append(hatched if bars else hollow)
    if True in of_real:
        said = "the same, of the real brain" if extra else label
        extra.append(star(said, markersize=8, markerfacecolor="white"))
    run_legend(figure, colours, measured=_name_of_real(rows, shown), bars=bars, extra=extra)


def _sides_of(rows: pd.DataFrame) -> list[str]:
    """Returns the hemispheres that some brain of a table has, left first."""
    return [side for side in SIDES if (rows["hemisphere"] == side).any()]


@styled
def spectra_chart(
    spectra: pd.DataFrame,
    *,
    week: float,
    bands: Sequence[int] = FOLD_BANDS,
    colours: Mapping[str, Any] | None = None,
    **shown: Unpack[Shown],
) -> Figure:
    """Returns the relative power of the bands at one week: runs as bars, measured brains as stars, a panel per side.

    Bars of bands that are cut off or not resolved by the surface are hatched, such stars open, and so are all where a
    band that they are shares of is cut off. A band without any power is said to be beyond the modes.

    Parameters
    ----------
    spectra : columns subject, run, week, hemisphere, band, relative_power, complete, denominator_complete, resolved
    week
        Week in GW; InputError if the table has no such band then.
    colours : {run: colour}
        Other colours than those of the study, in this order.
    """
    rows = _of_bands(runs_by_name(spectra), bands)
    rows = rows[(rows["week"] - week).abs() < 1e-6]
    if rows.empty:
        raise InputError(f"no spectrum at {week_label(week)}", found=sorted(set(spectra["week"])))
    sides = _sides_of(rows)
    figure, panels, own = run_panels(len(sides), rows["run"], shown, per_row=2, panel_in=2.3, sharey=True)
    colours = own if colours is None else colours
    width = 0.8 / max(len(colours), 1)
    for axes, hemisphere in zip(panels, sides, strict=True):
        side = rows[rows["hemisphere"] == hemisphere]
        for index, (run, colour) in enumerate(colours.items()):
            of_run = side[side["run"] == run]
            position = [bands.index(band) - 0.4 + (index + 0.5) * width for band in of_run["band"]]
            bars = axes.bar(position, of_run["relative_power"], width=0.92 * width, color=colour)
            for bar, trusted in zip(bars, of_run["trusted"], strict=True):
                if not trusted:
                    bar.set(hatch=_HATCH, edgecolor="white", linewidth=0)
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
    _spectra_legend(figure, rows, colours, shown, bars=True)
    return figure


@styled
def spectra_weeks_chart(spectra: pd.DataFrame, **shown: Unpack[Shown]) -> Figure:
    """Returns the relative power of the bands of the folds over weeks: a row per hemisphere, a column per band.

    Runs are lines, measured brains black stars; bands that are cut off, are shares of such, or are not resolved have
    open markers.

    Parameters
    ----------
    spectra : as for `spectra_chart`
    """
    known = spectra[spectra["relative_power"].notna()]["band"]
    bands = [band for band in FOLD_BANDS if (known == band).any()] or FOLD_BANDS
    rows = _of_bands(runs_by_name(spectra), bands)
    sides = _sides_of(rows)
    layout: dict[str, Any] = {"per_row": len(bands), "panel_in": 1.75, "sharex": True, "sharey": "col"}
    figure, panels, colours = run_panels(len(sides) * len(bands), rows["run"], shown, **layout)
    places = ((hemisphere, band) for hemisphere in sides for band in bands)
    for axes, (hemisphere, band) in zip(panels, places, strict=True):
        here = rows[(rows["hemisphere"] == hemisphere) & (rows["band"] == band)]
        for run in [*colours, MEASURED]:
            series = here[here["run"] == run].sort_values("week")
            colour, marker, size = (REAL_COLOUR, "*", 7) if run == MEASURED else (colours[run], "o", 3)
            if run != MEASURED:
                axes.plot(series["week"], series["relative_power"], color=colour)
            for trusted, part in series.groupby("trusted"):
                look: dict[str, Any] = {
                    "color": colour,
                    "markerfacecolor": colour if trusted else "white",
                    "markersize": size,
                }
                axes.plot(part["week"], part["relative_power"], marker, **look)
        week_axis(axes, rows["week"])
        light_grid(axes)
        if not here["relative_power"].notna().any():
            _beyond_the_modes(axes, 0.5, axes.transAxes)
            axes.set_yticks([])
        if hemisphere == sides[0]:
            axes.set_title(f"B{band}, {_FOLDS[band]} folds" if band in _FOLDS else f"B{band}")
        if hemisphere != sides[-1]:
            axes.set_xlabel("")
        if band == bands[0]:
            axes.set_ylabel(f"{hemisphere} hemisphere\nrelative power")
    for axes in panels[: len(bands)]:
        from_zero(axes)
    _spectra_legend(figure, rows, colours, shown, bars=False)
    return figure
