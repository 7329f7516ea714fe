"""Charts over the weeks, a panel for each quantity: metrics, norms, regions,
predictions, displacement, spectra.

As in the other charts, `runs` are all runs of a study, which determine the colours, and
`observed_name` is the name of observed brains. Spectra of the runs of a sweep have bars
instead.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle, product, zip_longest
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.transforms import Transform

from ..errors import InputError
from ..quantities import METRICS, Shown, metrics_shown
from ..settings.terms import FOLD_BANDS, OBSERVED, OBSERVED_BRAIN, PROXIES, SIDES
from .labels import (
    SIMPLER_PREDICTIONS,
    cited_atlas,
    metric_title,
    plain,
    value_labels,
)
from .style import (
    MUTED_COLOUR,
    NEUTRAL_COLOUR,
    OBSERVED_COLOUR,
    RUN_COLOURS,
    entry,
    from_zero,
    legend_below,
    panel_figure,
    region_colours,
    run_colours,
    run_entries,
    runs_by_name,
    star,
    styled,
    week_axis,
)

SUBJECT_MARKERS = ("s", "^", "D", "v", "P", "X", "<", ">")
"""Markers of the subjects of a cohort. With more subjects, none has a marker of its
own."""
PUBLISHED_MARKERS = ("s", "^", "D", "v")
NO_SUBJECTS: Mapping[str, str] = {}
LINES: tuple[Literal["-", "--", ":"], ...] = ("-", "--", ":")
JOINED: Mapping[str, Any] = {
    "color": MUTED_COLOUR,
    "linewidth": 0.8,
    "zorder": 2.5,
}
"""Line through the scans of a subject."""
NEAR_GW = 2.0
"""The lines of atlases go on so far beyond the brains of a chart."""
MANY_BRAINS = 30
"""Number of reference brains above which their marks are small."""
UNTRUSTED = "band cut off or not resolved"
_FOLDS = {4: "primary", 5: "secondary", 6: "tertiary"}
_HATCH = "//////"


@dataclass(frozen=True, eq=False)
class Layer:
    """Points of one look, in all panels that have some.

    The rows have the columns panel, week, and the `value`: the name of a column, or
    those of the lower and the upper edge of a band. If there is a column `trusted`,
    marks are open where it is False. `style` are the arguments of `Axes.plot`, of a
    band those of `Axes.fill_between`.
    """

    rows: pd.DataFrame
    style: Mapping[str, Any]
    value: str | tuple[str, str] = "value"


def _weeks_chart(
    titles: Mapping[str, str],
    layers: Sequence[Layer],
    weeks: Sequence[float] | pd.Series,
    **layout: Any,
) -> tuple[Figure, dict[str, Axes]]:
    """Draw layers over the weeks, the first at the back, in a panel for each title;
    `layout` of `panel_figure`."""
    figure, panels = panel_figure(len(titles), **layout)
    for axes, (panel, title) in zip(
        panels,
        titles.items(),
        strict=True,
    ):
        for layer in layers:
            rows = layer.rows[layer.rows["panel"] == panel].sort_values("week")
            if isinstance(layer.value, tuple):
                # without rows, columns are not numeric
                weeks_at, low, high = (
                    rows[column].astype(float) for column in ("week", *layer.value)
                )
                axes.fill_between(
                    weeks_at,
                    low,
                    high,
                    linewidth=0,
                    **layer.style,
                )
            elif len(rows):
                axes.plot(
                    rows["week"],
                    rows[layer.value],
                    **layer.style,
                )
            if "trusted" in rows and not rows["trusted"].all():
                doubtful = rows[~rows["trusted"]]
                style = {**layer.style, "markerfacecolor": "white", "linestyle": ""}
                axes.plot(doubtful["week"], doubtful["value"], **style)
        axes.set_title(title)
        week_axis(axes, weeks)
    return figure, dict(zip(titles, panels, strict=True))


def _run_lines(
    rows: pd.DataFrame,
    colours: Mapping[str, Any],
) -> list[Layer]:
    """Return the line of each run."""
    layers = []
    for run, colour in colours.items():
        style = {"color": colour, "marker": "o", "markersize": 2.5}
        layers.append(
            Layer(
                rows[rows["run"] == run],
                style,
            )
        )
    return layers


def _observed_marks(
    rows: pd.DataFrame,
    colour: Any = OBSERVED_COLOUR,
    *,
    subjects: Mapping[str, str] = NO_SUBJECTS,
    markers: Mapping[str, str] = NO_SUBJECTS,
    shades: Mapping[str, Any] = NO_SUBJECTS,
    **style: Any,
) -> list[Layer]:
    """Return observed brains in their `shades`, else `colour`; scans of a subject are
    joined and have its marker."""
    layers = []
    people = rows["subject"].map(
        lambda brain: subjects.get(
            brain,
            "",
        )
    )
    for person, scans in rows.groupby(people, sort=False):
        if person and len(set(scans["week"])) > 1:
            layers.append(Layer(scans.assign(trusted=True), JOINED))
        marker = markers.get(str(person), "*")
        look = {
            "marker": marker,
            "markersize": 7 if marker == "*" else 4.5,
            "linestyle": "",
            "zorder": 3,
            **style,
        }
        colours = scans["subject"].map(
            lambda brain: shades.get(
                brain,
                colour,
            )
        )
        for shade, part in scans.groupby(colours, sort=False):
            layers.append(Layer(part, {"color": shade, **look}))
    return layers


def _subject_markers(
    rows: pd.DataFrame,
    subjects: Mapping[str, str],
) -> dict[str, str]:
    """Return the marker of each subject with observed brains; none if there are more
    subjects than markers."""
    brains = rows.loc[rows["run"] == OBSERVED, "subject"]
    people = brains.map(subjects).dropna().unique()
    if not 1 < len(people) <= len(SUBJECT_MARKERS):
        return {}
    return dict(zip(people, SUBJECT_MARKERS, strict=False))


def _subject_entries(markers: Mapping[str, str]) -> list[Artist]:
    """Return the legend entries of subjects."""
    return [
        star(
            name,
            marker=mark,
            markersize=5,
        )
        for name, mark in markers.items()
    ]


def _group_shades(
    groups: Mapping[str, str], colours: Mapping[str, Any]
) -> tuple[dict[str, Any], list[Artist]]:
    """Return the colour of each brain in a group, not used by any run, and the legend
    entries."""
    free = [colour for colour in RUN_COLOURS if colour not in colours.values()]
    group_colours = dict(
        zip(
            dict.fromkeys(groups.values()),
            free,
            strict=False,
        )
    )
    entries: list[Artist] = []
    for name, colour in group_colours.items():
        entries.append(
            star(
                name,
                colour,
                marker="o",
                markersize=5,
            )
        )
    shades = {
        brain: group_colours[name]
        for brain, name in groups.items()
        if name in group_colours
    }
    return shades, entries


def _shown(
    metrics: pd.DataFrame,
    where: Shown,
) -> tuple[pd.DataFrame, dict[str, str]]:
    """Return the rows of metrics that are shown in a chart, and its titles; InputError
    if there are none."""
    present, expected = set(metrics["metric"]), metrics_shown(where)
    titles = {name: metric_title(name) for name in expected if name in present}
    if not titles:
        found = sorted(present)
        raise InputError("no metric to draw", found=found, expected=expected)
    rows = metrics.assign(panel=metrics["metric"])
    return rows[rows["panel"].isin(titles)], titles


def _atlas_lines(
    atlases: pd.DataFrame,
    panels: Mapping[tuple[str, str], str],
    weeks: pd.Series,
) -> tuple[list[Layer], list[Artist]]:
    """Return the thin lines of atlases over the weeks of a chart, and their legend
    entries.

    `panels` are those of a hemisphere, or "whole", and a metric.
    """
    keys = zip(atlases["hemisphere"], atlases["metric"], strict=True)
    # of no panel, of hemispheres or metrics that the chart does not show
    rows = atlases.assign(
        panel=[
            panels.get(
                key,
                "",
            )
            for key in keys
        ]
    )
    is_near = rows["week"].between(
        weeks.min() - NEAR_GW,
        weeks.max() + NEAR_GW,
    )
    rows = rows[(rows["panel"] != "") & is_near]
    layers = []
    entries: list[Artist] = []
    # an atlas may have no brain of these weeks
    parts = rows.groupby("atlas", sort=False)
    for (name, part), line in zip(
        parts,
        cycle(LINES[1:]),
        strict=False,
    ):
        style = {"color": MUTED_COLOUR, "linewidth": 0.8, "linestyle": line}
        style["zorder"] = 1.5
        layers.append(Layer(part, style))
        label = f"{cited_atlas(str(name))}: average of many fetuses"
        entries.append(entry(label, **style))
    return layers, entries


@styled
def metrics_figure(
    metrics: pd.DataFrame,
    atlases: pd.DataFrame,
    *,
    runs: Sequence[str] = (),
    observed_name: str = OBSERVED_BRAIN,
    subjects: Mapping[str, str] = NO_SUBJECTS,
    groups: Mapping[str, str] = NO_SUBJECTS,
) -> Figure:
    """Draw a panel per metric of whole brains over weeks: runs as lines, observed
    brains as black stars.

    The scans of a subject are joined. Subjects have markers if there are at most eight;
    groups of brains have colours. Metrics that the table lacks are left out. Thin lines
    are the average brains of `atlases`, the table of `metrics.atlas_curves`.

    `metrics` has the columns subject, run, week, hemisphere, metric, value, unit; `run`
    is "observed" for observed brains. InputError if the table has none of the metrics.
    `subjects` are the subjects of brains, if known, `groups` their values of a
    covariate, both by brain.
    """
    whole = runs_by_name(metrics[metrics["hemisphere"] == "whole"])
    rows, titles = _shown(whole, Shown.CHART)
    colours, observed = (
        run_colours(
            whole["run"],
            runs,
        ),
        rows[rows["run"] == OBSERVED],
    )
    markers = _subject_markers(whole, subjects)
    shades, groups_shown = _group_shades(groups, colours)
    look = {"subjects": subjects, "markers": markers, "shades": shades}
    panels = {("whole", name): name for name in titles}
    lines, atlases_shown = _atlas_lines(atlases, panels, whole["week"])
    marks = _observed_marks(observed, **look)
    layers = [*lines, *_run_lines(rows, colours), *marks]
    figure, _ = _weeks_chart(titles, layers, whole["week"])
    entries = run_entries(colours)
    named = [*(subjects if markers else ()), *shades]
    if not observed["subject"].isin(named).all():
        entries.append(star(observed_name))
    entries += _subject_entries(markers)
    legend_below(figure, [*entries, *groups_shown, *atlases_shown])
    return figure


@styled
def intervals_figure(ensemble: pd.DataFrame) -> Figure:
    """Draw the intervals of an ensemble over the weeks, a panel per metric, with its
    run and the observed brains.

    `ensemble` has columns week, metric, run, low, high, observed_value.
    """
    rows, titles = _shown(ensemble, Shown.INTERVALS)
    run = {"color": RUN_COLOURS[0], "marker": "o", "markersize": 2.5}
    brain = {
        "color": OBSERVED_COLOUR,
        "marker": "*",
        "markersize": 7,
        "linestyle": "",
    }
    layers = [
        Layer(rows, {"color": NEUTRAL_COLOUR}, ("low", "high")),
        Layer(rows, run, "run"),
        Layer(rows, brain, "observed_value"),
    ]
    figure, _ = _weeks_chart(
        titles,
        layers,
        rows["week"],
        per_row=2,
    )
    entries = run_entries({"run": RUN_COLOURS[0]})
    entries.append(Patch(color=NEUTRAL_COLOUR, label="interval"))
    if ensemble["observed_value"].notna().any():
        entries.append(star(OBSERVED_BRAIN))
    legend_below(figure, entries)
    return figure


@styled
def norms_figure(
    metrics: pd.DataFrame,
    curves: pd.DataFrame,
    *,
    reference: Sequence[str],
    brains: Sequence[str],
    runs: Sequence[str] = (),
    norm_name: str = OBSERVED_BRAIN,
    subjects: Mapping[str, str] = NO_SUBJECTS,
    groups: Mapping[str, str] = NO_SUBJECTS,
) -> Figure:
    """Draw a panel per metric of whole brains: reference brains, their norm curve,
    other brains and runs.

    Bands are between the 5th and 95th and the 25th and 75th centile, drawn if the
    spread of individuals is known. Stars are observed brains: black in the reference,
    else coloured, as are groups. Lines are runs.

    Metrics, subjects and groups are as for `metrics_figure`; `curves` has the columns
    hemisphere, metric, week, expected, q05, q25, q75, q95, which were fitted to the
    `reference` brains, called `norm_name`. `brains` have the same hemispheres as the
    reference: only they, and simulations from them, are drawn. InputError if the table
    has none of the metrics.
    """
    whole = runs_by_name(
        metrics[(metrics["hemisphere"] == "whole") & metrics["subject"].isin(brains)]
    )
    rows, titles = _shown(whole, Shown.NORMS)
    norm = curves[(curves["hemisphere"] == "whole") & curves["metric"].isin(titles)]
    norm = norm.assign(panel=norm["metric"])
    colours = run_colours(whole["run"], runs)
    markers = _subject_markers(whole, subjects)
    shades, groups_shown = _group_shades(groups, colours)
    look = {"subjects": subjects, "markers": markers, "shades": shades}
    observed = rows[rows["run"] == OBSERVED]
    is_own = observed["subject"].isin(reference)
    own, others = observed[is_own], observed[~is_own]
    small: dict[str, Any] = (
        {"markersize": 3.0} if own["subject"].nunique() > MANY_BRAINS else {}
    )
    line = {"color": MUTED_COLOUR, "linewidth": 1.3, "zorder": 4}
    thin = line | {"linewidth": 0.6}
    layers = [
        Layer(
            norm,
            {"color": NEUTRAL_COLOUR, "alpha": 0.6},
            ("q05", "q95"),
        ),
        Layer(norm, {"color": NEUTRAL_COLOUR}, ("q25", "q75")),
        Layer(norm, line, "expected"),
        *(
            Layer(
                norm,
                thin,
                quantile,
            )
            for quantile in ("q05", "q25", "q75", "q95")
        ),
        *_run_lines(rows, colours),
        *_observed_marks(own, **look, **small),
        *_observed_marks(others, RUN_COLOURS[-1], **look),
    ]
    figure, _ = _weeks_chart(
        titles,
        layers,
        rows["week"],
        panel_in=2.0,
        foot_in=0.6,
    )
    entries = [
        *run_entries(colours),
        star(norm_name),
        *_subject_entries(markers),
    ]
    entries += groups_shown
    if not others["subject"].isin(shades).all():
        entries.append(star("other observed brains", RUN_COLOURS[-1]))
    if curves["q05"].notna().any():
        bands = Patch(color=NEUTRAL_COLOUR, label="centiles 5, 25, 50, 75, 95")
        entries.append(bands)
    elif len(curves):
        entries.append(entry("norm, spread unknown"))
    legend_below(figure, entries)
    return figure


@styled
def regions_chart(
    regions: pd.DataFrame,
    asymmetry: pd.DataFrame,
    *,
    observed_name: str = OBSERVED_BRAIN,
) -> Figure:
    """Draw a panel per metric over the weeks, a colour per region: both sides together,
    and the asymmetry of area.

    Observed brains are stars, the first three runs lines. Areas are sums of both sides,
    other values their means. `regions` has the columns subject, run, week, hemisphere,
    region, metric, value, unit; `asymmetry` subject, run, week, region, metric,
    asymmetry_index.
    """
    rows, titles = _shown(runs_by_name(regions), Shown.REGIONS)
    colours = region_colours(rows["region"])
    lines = dict(
        zip(
            run_colours(rows["run"]),
            LINES,
            strict=False,
        )
    )
    # both sides together
    keys = ["panel", "subject", "run", "week", "region"]
    rows = rows.groupby(
        keys,
        sort=False,
    )["value"].agg(["sum", "mean"])
    rows = rows.reset_index()
    rows["value"] = rows["sum"].where(
        rows["panel"] == "area",
        rows["mean"],
    )
    is_shown = (asymmetry["metric"] == "area") & asymmetry["region"].isin(colours)
    indices = runs_by_name(asymmetry[is_shown]).assign(panel="asymmetry")
    indices = indices.rename(columns={"asymmetry_index": "value"})
    rows = pd.concat([rows, indices])
    if "area" in titles:
        titles["area"] += ", both sides"
    titles["asymmetry"] = "asymmetry of area, 2 (L − R)/(L + R)"
    layers = []
    for (region, run), part in rows.groupby(
        ["region", "run"],
        sort=False,
    ):
        if run == OBSERVED:
            layers += _observed_marks(part, colours[str(region)], markersize=6)
        elif run in lines:
            style = {
                "color": colours[str(region)],
                "linestyle": lines[str(run)],
            }
            layers.append(Layer(part, style | {"linewidth": 1.1}))
    figure, panels = _weeks_chart(
        titles,
        layers,
        rows["week"],
        foot_in=0.75,
    )
    panels.pop("asymmetry").axhline(
        0,
        color=MUTED_COLOUR,
        linewidth=0.8,
    )
    for name, axes in panels.items():
        # signed numbers and ratios are not compared with 0
        if not METRICS[name].is_signed and METRICS[name].unit != "1":
            from_zero(axes)
    squares = {"marker": "s", "linestyle": "none"}
    entries = [
        entry(
            name,
            colour,
            **squares,
        )
        for name, colour in colours.items()
    ]
    entries += [
        entry(
            run,
            linestyle=line,
        )
        for run, line in lines.items()
    ]
    legend_below(figure, [*entries, star(observed_name, MUTED_COLOUR)])
    return figure


@styled
def prediction_figure(
    prediction: pd.DataFrame,
    *,
    runs: Sequence[str] = (),
) -> Figure:
    """Draw correlation with and distance from the observed brain by weeks after the
    start: a row of panels per start.

    Runs are solid lines, simpler predictions dashed. `prediction` has the columns run,
    start, horizon, model (`run` or a simpler prediction), r_shape_index and
    distance_mm.
    """
    columns = {
        "r_shape_index": "shape index, r with the observed brain",
        "distance_mm": "distance from it (mm)",
    }
    colours = run_colours(prediction["run"], runs)
    # simpler predictions are the same for all runs
    is_run = prediction["model"] == "run"
    line = prediction["run"].where(is_run, prediction["model"])
    rows = prediction.assign(line=line, week=prediction["horizon"])
    rows = rows.drop_duplicates(["start", "line", "horizon"])
    shades = run_colours([*colours, *line])
    others = [name for name in shades if name not in colours]
    simpler = dict(
        zip(
            others,
            reversed(shades.values()),
            strict=False,
        )
    )
    layers = []
    for name, colour in simpler.items():
        style = {"color": colour, "marker": ".", "linestyle": "--"}
        layers.append((name, style))
    for name, colour in colours.items():
        layers.append((name, {"color": colour, "marker": "o"}))
    titles = {}
    parts = []
    for start, own in rows.groupby("start", sort=False):
        for name, title in columns.items():
            panel = f"{start}: {title}"
            titles[panel] = panel
            parts.append(
                own.assign(
                    panel=panel,
                    value=own[name],
                )
            )
    rows = pd.concat(parts)
    figure, panels = _weeks_chart(
        titles,
        [
            Layer(
                rows[rows["line"] == name],
                style,
            )
            for name, style in layers
        ],
        rows["week"],
        per_row=2,
        panel_in=2.4,
        foot_in=0.9,
        sharex=True,
        sharey="col",
    )
    for axes in panels.values():
        axes.set_xlabel("weeks after the start")
    from_zero(list(panels.values())[1])
    entries = run_entries(colours)
    for name, colour in simpler.items():
        label = SIMPLER_PREDICTIONS.get(name, plain(name))
        entries.append(entry(label, colour, linestyle="--"))
    legend_below(figure, entries)
    return figure


@styled
def displacement_figure(
    displacement: pd.DataFrame,
    *,
    runs: Sequence[str] = (),
    published: Mapping[str, Any] | None = None,
) -> Figure:
    """Draw the maximal and the mean displacement norm of all nodes per week.

    Norms are divided by the weeks between output weeks. Runs are lines, published
    values grey. `displacement` has the columns run, subject, from_week, to_week, nodes
    ("all" or "pial"), max_mm, mean_mm; that of `published` has `from_weeks` (intervals
    of one week) and rows with `source`, `max_mm` and `mean_mm`.
    """
    named = runs_by_name(displacement)
    moved = (
        published["displacement"]
        if published
        else {
            "from_weeks": [],
            "rows": [],
        }
    )
    colours = run_colours(named["run"], runs)
    weeks = np.array(moved["from_weeks"], dtype=float)
    tables = [named[named["nodes"] == "all"]]
    styles: dict[str, dict[str, Any]] = {}
    for row, marker in zip(
        moved["rows"],
        cycle(PUBLISHED_MARKERS),
        strict=False,
    ):
        table = pd.DataFrame(
            {
                **row,
                "from_week": weeks,
                "to_week": weeks + 1,
            }
        )
        tables.append(table.assign(run=row["source"]))
        style = {"color": MUTED_COLOUR, "marker": marker, "linestyle": "--"}
        styles[row["source"]] = style
    sources = dict(styles)
    for run, colour in colours.items():
        styles[run] = {"color": colour, "marker": "o"}
    rows = pd.concat(tables)
    rows["week"] = (rows["from_week"] + rows["to_week"]) / 2
    duration = rows["to_week"] - rows["from_week"]
    titles = {
        "max_mm": "maximal displacement, all nodes",
        "mean_mm": "mean displacement, all nodes",
    }
    rows = pd.concat(
        rows.assign(
            panel=column,
            value=rows[column] / duration,
        )
        for column in titles
    )
    layers = []
    for run, style in styles.items():
        layers.append(
            Layer(
                rows[rows["run"] == run],
                style,
            )
        )
    figure, panels = _weeks_chart(
        titles, layers, [*rows["from_week"], *rows["to_week"]], per_row=2
    )
    for axes in panels.values():
        axes.set_ylabel("displacement (mm per week)")
        axes.set_xlabel("gestational age (GW), middle of the interval")
        from_zero(axes)
    entries = run_entries(colours)
    entries += [
        entry(
            source,
            **style,
        )
        for source, style in sources.items()
    ]
    legend_below(figure, entries)
    return figure


paper_displacement_figure = displacement_figure
"""Of a rule with the values of the paper as `published`."""


def _band_rows(
    spectra: pd.DataFrame,
    bands: Sequence[int],
    proxy: str,
) -> pd.DataFrame:
    """Return the rows of some bands in the spectra of a proxy, with a column
    `trusted`."""
    trusted = (
        spectra["complete"] & spectra["denominator_complete"] & spectra["resolved"]
    )
    is_shown = spectra["band"].isin(bands) & (spectra["proxy"] == proxy)
    return spectra.assign(trusted=trusted)[is_shown]


def _beyond_the_modes(
    axes: Axes,
    x: float,
    transform: Transform,
    *,
    rotation: float = 0.0,
) -> None:
    style: dict[str, Any] = {
        "ha": "center",
        "va": "center",
        "rotation": rotation,
    }
    axes.text(x, 0.5, "beyond the\nmodes computed", transform=transform, **style)


def _spectra_entries(
    rows: pd.DataFrame, name: str, untrusted_run: Artist
) -> list[Artist]:
    """Return the legend entries of observed brains, and of bands that are cut off or
    not resolved, of which that of runs is given."""
    entries: list[Artist] = []
    if (rows["run"] == OBSERVED).any():
        entries.append(star(name))
    is_untrusted = rows["relative_power"].notna() & ~rows["trusted"]
    untrusted = set(rows.loc[is_untrusted, "run"])
    if untrusted - {OBSERVED}:
        entries.append(untrusted_run)
    if OBSERVED in untrusted:
        label = f"{UNTRUSTED}, observed brain"
        entries.append(star(label, markersize=8, markerfacecolor="white"))
    return entries


def _sides_in(rows: pd.DataFrame) -> list[str]:
    """Return the hemispheres that occur in a table, left first."""
    return [side for side in SIDES if (rows["hemisphere"] == side).any()]


@styled
def spectra_figure(
    spectra: pd.DataFrame,
    atlases: pd.DataFrame,
    *,
    runs: Sequence[str] = (),
    observed_name: str = OBSERVED_BRAIN,
    subjects: Mapping[str, str] = NO_SUBJECTS,
    groups: Mapping[str, str] = NO_SUBJECTS,
) -> Figure:
    """Draw the relative power of the fold bands of mean curvature over weeks: a row per
    hemisphere, a column per band.

    Runs are lines, observed brains black stars; scans of a subject are joined and
    groups coloured. Thin lines are the `atlases`, as in `metrics_figure`. Markers are
    open if the band, or one in the denominator of the
    relative power, is cut off, or if the surface does not resolve it. `spectra` has the
    columns subject, run, week, hemisphere, proxy, band, relative_power, complete,
    denominator_complete, resolved.
    """
    with_power = set(spectra.loc[spectra["relative_power"].notna(), "band"])
    bands = [band for band in FOLD_BANDS if band in with_power] or list(FOLD_BANDS)
    rows = _band_rows(runs_by_name(spectra), bands, PROXIES[0])
    rows = rows.assign(
        panel=rows["hemisphere"] + rows["band"].astype(str),
        value=rows["relative_power"],
    )
    sides, colours = _sides_in(rows), run_colours(rows["run"], runs)
    shades, groups_shown = _group_shades(groups, colours)
    cells = {
        f"{side}{band}": (side, band)
        for side, band in product(
            sides,
            bands,
        )
    }
    curves = {
        (side, f"spangy_B{band}_relative_power"): cell
        for cell, (side, band) in cells.items()
    }
    lines, atlases_shown = _atlas_lines(atlases, curves, rows["week"])
    marks = _observed_marks(
        rows[rows["run"] == OBSERVED], subjects=subjects, shades=shades
    )
    layers = [*lines, *_run_lines(rows, colours), *marks]
    heads = [f"B{band}, {_FOLDS[band]} folds" for band in bands]
    titles = dict(zip_longest(cells, heads, fillvalue=""))
    figure, panels = _weeks_chart(
        titles,
        layers,
        rows["week"],
        per_row=len(bands),
        panel_in=1.75,
        sharex=True,
        sharey="col",
    )
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
    hollow = star(UNTRUSTED, MUTED_COLOUR, marker="o", markersize=5)
    hollow.set_markerfacecolor("white")
    entries = run_entries(colours) + _spectra_entries(rows, observed_name, hollow)
    legend_below(figure, [*entries, *groups_shown, *atlases_shown])
    return figure


@styled
def influence_spectra(
    members: Sequence[pd.DataFrame],
    observed: Sequence[pd.DataFrame],
    *,
    values: Mapping[str, Mapping[str, Any]],
    week: float,
    observed_name: str = OBSERVED_BRAIN,
) -> Figure:
    """Draw the relative power in B4 to B6 of the runs of a sweep and of the observed
    brain at one week (in GW).

    A panel per proxy and hemisphere. Runs are bars, from pale to dark in their order;
    observed brains are stars. They are hatched or open if the band, or one in the
    denominator of the relative power, is cut off, or if the surface does not resolve
    it. A band without any power is labelled as beyond the modes.

    `members` are tables as for `spectra_figure` of the runs that reached the week,
    `observed` those of observed brains, whose run is so named. `values` are by run the
    varied parameters with their values, in the order of the sweep.
    """
    labels = dict(
        zip(
            values,
            value_labels(list(values.values())),
            strict=True,
        )
    )
    simulated = [table.assign(run=table["run"].map(labels)) for table in members]
    shades = mpl.colormaps["YlGnBu"](
        np.linspace(
            0.3,
            0.95,
            max(len(labels), 2),
        )
    )
    colours = dict(
        zip(
            labels.values(),
            shades,
            strict=False,
        )
    )
    spectra = pd.concat([*simulated, *observed])
    by_proxy = {
        proxy: _band_rows(spectra[spectra["week"] == week], FOLD_BANDS, proxy)
        for proxy in PROXIES
    }
    rows = pd.concat(by_proxy.values())
    sides = _sides_in(rows)
    figure, panels = panel_figure(
        len(sides) * len(PROXIES),
        per_row=len(sides),
        panel_in=2.3,
        sharey="row",
    )
    width = 0.8 / len(colours)
    cells = product(PROXIES, sides)
    for axes, (proxy, hemisphere) in zip(
        panels,
        cells,
        strict=True,
    ):
        side = by_proxy[proxy][by_proxy[proxy]["hemisphere"] == hemisphere]
        for index, (run, colour) in enumerate(colours.items()):
            run_rows = side[side["run"] == run]
            places = run_rows["band"] - FOLD_BANDS[0] - 0.4 + (index + 0.5) * width
            bars = axes.bar(
                places, run_rows["relative_power"], width=0.92 * width, color=colour
            )
            for bar, trusted in zip(
                bars,
                run_rows["trusted"],
                strict=True,
            ):
                if not trusted:
                    bar.set(hatch=_HATCH, edgecolor="white", linewidth=0)
        for _, row in side[side["run"] == OBSERVED].iterrows():
            centre, power = FOLD_BANDS.index(row["band"]), row["relative_power"]
            ends = centre - 0.42, centre + 0.42
            axes.hlines(power, *ends, color=OBSERVED_COLOUR, linewidth=0.9)
            face = OBSERVED_COLOUR if row["trusted"] else "white"
            style: dict[str, Any] = {"markerfacecolor": face, "markersize": 8}
            axes.plot(centre, power, "*", color=OBSERVED_COLOUR, **style)
        for place, band in enumerate(FOLD_BANDS):
            if not side.loc[side["band"] == band, "relative_power"].notna().any():
                transform = axes.get_xaxis_transform()
                _beyond_the_modes(axes, place, transform, rotation=90.0)
        ticks = [f"B{band}\n{_FOLDS[band]}" for band in FOLD_BANDS]
        axes.set_xticks(range(len(ticks)), ticks)
        axes.set_xlabel("SpAnGy band, and the folds that go with it")
        axes.set_xlim(-0.5, len(FOLD_BANDS) - 0.5)
        axes.set_title(f"{hemisphere} hemisphere, {plain(proxy)}")
        if hemisphere == sides[0]:
            axes.set_ylabel("relative power")
            from_zero(axes)
    hatched = Patch(
        facecolor=MUTED_COLOUR, edgecolor="white", hatch=_HATCH, label=UNTRUSTED
    )
    bars_shown = [
        Patch(
            color=colour,
            label=run,
        )
        for run, colour in colours.items()
    ]
    marks_shown = _spectra_entries(rows, observed_name, hatched)
    legend_below(figure, [*bars_shown, *marks_shown])
    return figure
