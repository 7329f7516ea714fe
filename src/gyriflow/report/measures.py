"""What pages and tables say of measured and predicted brains."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..quantities import METRICS, Shown, metrics_shown
from ..settings.terms import OBSERVED, OBSERVED_BRAIN, SIDES
from .labels import (
    SIMPLER_PREDICTIONS,
    atlas_label,
    cited_atlas,
    metric_title,
    week_label,
)
from .style import runs_by_name
from .tables import html_table

_FOLDERS = re.compile(r"(?<![\w.:/])/(?:[^/\n;:]*/)+")
"""Folders of a file: they may contain names, so they are stripped."""
FROM_ATLAS = "difference from"
"""Beginning of the names of columns with differences from an atlas."""
NOISE_HEAD = "in multiples of the noise of measuring again"
"""End of the names of these columns."""
MIN_TIMES_NOISE, MAX_TIMES_NOISE = 2.0, 10.0
"""A difference below so many times the noise of measuring is none; larger multiples are
not given, as other errors are then larger than this noise."""
DATED_METRICS = ("volume", "area", "gyrification_index", "mean_sulcal_depth")
"""Metrics of which a page says what a week of age is worth."""
DOUBTS = {
    "thickness_is_inaccurate": (
        "inaccurate",
        ("mean_thickness", "thickness_sd", "area_ratio"),
    ),
    "area_is_lower_bound": (
        "lower bound",
        (
            "area",
            "relative_area",
            "gyrification_index",
            "gyrification_index_envelope",
        ),
    ),
}
"""What a column of the quality table says of a brain's metrics, if it is true."""
ATLAS_ALONE = 0.2
"""Share of the individual difference below which a prediction is called nearly the
atlas' own brain."""
ERROR_HEAD = "error of such predictions, of averages"
INTERVAL_HEAD = "interval of ensemble and tests of averages"
"""Columns of `_predicted_table`. The tested brains are averages of many fetuses, which
says little of a single one."""


@dataclass(frozen=True, eq=False)
class Tables:
    """The tables of a study on its pages.

    `quality`, `metrics` and `centiles` are as for `brain_rows`, `curves` and
    `differences` those of `metrics.atlas_curves`; `warnings` has the columns subject,
    run, step, level, message. `runs` and `validation` are those of
    `page._scores_table`, None if nothing was simulated; `intervals` those of the
    ensemble of the one prediction, if any.
    """

    quality: pd.DataFrame
    metrics: pd.DataFrame
    centiles: pd.DataFrame
    curves: pd.DataFrame
    differences: pd.DataFrame
    warnings: pd.DataFrame
    runs: pd.DataFrame | None = None
    validation: pd.DataFrame | None = None
    intervals: pd.DataFrame | None = None

    def __post_init__(self) -> None:
        # messages name files without their folders
        for name in ("quality", "warnings"):
            table = getattr(self, name).replace(_FOLDERS, "", regex=True)
            object.__setattr__(self, name, table)


def _named(rows: pd.DataFrame) -> pd.Series:
    """Return the title of each row's metric, with its unit."""
    return rows["metric"].map(metric_title).astype(object)


def _reported(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of metrics that the report shows."""
    return rows[rows["metric"].map(lambda name: METRICS[name].is_reported).astype(bool)]


def _signed_metrics(rows: pd.DataFrame) -> pd.Series:
    return rows["metric"].map(lambda name: METRICS[name].is_signed).astype(bool)


def metrics_table(
    metrics: pd.DataFrame, *, observed_name: str = OBSERVED_BRAIN
) -> pd.DataFrame:
    """Return the metrics of whole brains: the observed brain, each run, and each run's
    difference in %.

    The week is the last that runs and observed brains share, or the last of all.
    Quantiles and metrics of the measurement itself are left out. `metrics` has the
    columns subject, run, week, hemisphere, metric, value, unit; `run` is "observed" for
    observed brains, several of which in a week give their mean. `observed_name` is the
    heading of their column.

    The rows are by metric (with its unit); cells without a value are NaN, without a
    difference "–".
    """
    rows = runs_by_name(_reported(metrics[metrics["hemisphere"] == "whole"]))
    observed = rows["run"] == OBSERVED
    shared = set(rows.loc[observed, "week"]) & set(rows.loc[~observed, "week"])
    week = max(shared or set(rows["week"]))
    rows = rows[rows["week"] == week].assign(name=_named)
    wide = rows.pivot_table(
        "value",
        "name",
        "run",
    ).reindex(rows["name"].unique())
    # of what may be zero, a difference in per cent is meaningless
    is_signed = wide.index.isin(rows.loc[_signed_metrics(rows), "name"])
    wide = wide.reindex(columns=dict.fromkeys([OBSERVED, *rows["run"]]))
    table = pd.DataFrame({observed_name: wide[OBSERVED]})
    for run in wide.columns[1:]:
        table[run] = wide[run]
        differences = 100 * (wide[run] / wide[OBSERVED] - 1)
        texts = differences.map(_signed).where(~is_signed, "–")
        table[f"{run}, difference (%)"] = texts
    return table.rename_axis(f"metric at {week_label(week)}")


def _signed(percent: float, unit: str = "") -> str:
    """Return a difference in per cent with its sign; no sign if it rounds to zero."""
    if np.isnan(percent):
        return "–"
    return (
        f"{percent:+z.1f}".replace("-", "−").replace(
            "+0.0",
            "0.0",
        )
        + unit
    )


def _centile_text(centiles: pd.DataFrame) -> list[str]:
    """Return the text of each row of centiles: "centile (interval), z", the difference
    from the norm in %, or "–"."""
    shares = (centiles["value"] / centiles["expected"] - 1).where(
        ~_signed_metrics(centiles)
    )
    texts = []
    for row in centiles.assign(share=shares).to_dict("records"):
        text = _signed(100 * row["share"], " %")
        if np.isfinite(row["centile"]):
            interval = f"{row['centile_low']:.0f} to {row['centile_high']:.0f}"
            text = f"{row['centile']:.0f} ({interval}), {row['z']:+.1f}"
            text = text.replace("-", "−")
        texts.append(text)
    return texts


def _doubtful_metrics(row: Mapping[Any, Any]) -> dict[str, str]:
    """Return the metrics of a brain that its warnings say are wrong, and how, by its
    row of the quality table."""
    doubts: dict[str, str] = {}
    for column, (words, names) in DOUBTS.items():
        # a refused brain has neither
        if row.get(column) is True or row.get(column) == "True":
            doubts |= dict.fromkeys(names, words)
    return doubts


def _doubtful_title(name: str, doubts: Mapping[str, str]) -> str:
    """Return the title of a metric, with the doubt about it."""
    title = metric_title(name)
    return f"{title}: {doubts[name]}, see the warning" if name in doubts else title


def _brain_table(
    metrics: pd.DataFrame,
    centiles: pd.DataFrame,
    differences: pd.DataFrame,
    doubts: Mapping[str, str],
) -> pd.DataFrame:
    """Return the metrics of an observed brain, whole and by hemisphere, with the
    differences from the average brains of atlases, and the centiles of the whole brain.

    Metrics that only hemispheres have also have only their differences. `metrics` has
    the columns hemisphere, metric, value, unit, of this brain; `centiles`, of the
    study, subject, run, hemisphere, metric, value, expected, z, centile, flag;
    `differences` are those of `metrics.atlas_curves`, of the study; `doubts` the output
    of `_doubtful_metrics`.
    """
    rows = _reported(metrics).assign(name=_named)
    wide = rows.pivot_table("value", "name", "hemisphere").reindex(
        rows["name"].unique()
    )
    table = wide[[part for part in ("whole", *SIDES) if part in wide]]
    brain = metrics["subject"].iloc[0]
    texts_by_atlas = _difference_texts(differences, brain, doubts, with_noise=True)
    for atlas, texts in texts_by_atlas.items():
        head = f"{FROM_ATLAS} {atlas_label(atlas)} ({NOISE_HEAD})"
        titled = {metric_title(name): text for name, text in texts.items()}
        table = table.assign(**{head: table.index.to_series().map(titled)})
    is_own = (centiles["subject"] == brain) & (centiles["run"] == OBSERVED)
    is_whole = centiles["hemisphere"] == "whole"
    scores = centiles[is_own & is_whole].assign(name=_named)
    # without a norm there are only flags
    if scores["expected"].notna().any():
        scores = scores.assign(text=_centile_text(scores)).set_index("name")
        table = table.assign(norm=scores["expected"])
        table["centile (90 % interval), z; or difference"] = scores["text"]
        table["note"] = scores["flag"]
    named = {metric_title(name): _doubtful_title(name, doubts) for name in doubts}
    return table.dropna(how="all").rename(index=named).rename_axis("metric")


def _difference_texts(
    differences: pd.DataFrame,
    brain: str,
    doubts: Mapping[str, str],
    *,
    with_noise: bool,
) -> dict[str, dict[str, str]]:
    """Return the differences of an observed brain from atlases as text, by atlas and
    metric: those of the whole brain, or else of both hemispheres."""
    own = differences["subject"] == brain
    rows = differences[own & (differences["run"] == OBSERVED)]
    texts: dict[str, dict[str, str]] = {}
    for names, parts in rows.groupby(
        ["atlas", "metric"],
        sort=False,
    ):
        atlas, metric = map(str, names)
        doubt = doubts.get(metric, "")
        by_part = {}
        for row in parts.to_dict("records"):
            words = _difference_text(row, with_noise=with_noise and not doubt)
            by_part[row["hemisphere"]] = f"{words} ({doubt})" if doubt else words
        sides = "; ".join(f"{side} {words}" for side, words in by_part.items())
        texts.setdefault(atlas, {})[metric] = by_part.get(
            "whole",
            sides,
        )
    return texts


def _week_errors(curves: pd.DataFrame, week: float) -> list[str]:
    """Return by how much `DATED_METRICS` of each atlas differ a week earlier and later,
    as far as it has these weeks: what an error of a week in a brain's age is worth.

    `curves` are those of `metrics.atlas_curves`.
    """
    whole = curves[curves["hemisphere"] == "whole"]
    texts = []
    for atlas, rows in whole.groupby("atlas", sort=False):
        first, last = rows["week"].min(), rows["week"].max()
        others = [other for other in (week - 1, week + 1) if first <= other <= last]
        parts = []
        for name in DATED_METRICS:
            curve = rows[rows["metric"] == name]
            if others and len(curve):
                values = np.interp(
                    [week, *others],
                    curve["week"],
                    curve["value"],
                )
                changes = 100 * (values[1:] / values[0] - 1)
                words = " and ".join(_signed(change, " %") for change in changes)
                label, *_ = METRICS[name].label.split(",")
                parts.append(f"{label} {words}")
        if parts:
            weeks = " and ".join(f"{other:g}" for other in others)
            texts.append(f"{atlas_label(str(atlas))} at {weeks} GW: {', '.join(parts)}")
    return texts


def _difference_text(
    row: Mapping[Any, Any],
    *,
    with_noise: bool,
) -> str:
    """Return a difference from an atlas in %, or in the metric's unit if it may be
    negative, and as a multiple of the noise of measuring."""
    text = _signed(100 * row["relative_difference"], " %")
    if np.isnan(row["relative_difference"]):
        text = f"{row['difference']:+.2g}".replace("-", "−")
    times = abs(row["times_noise"])
    if not with_noise or np.isnan(times):
        return text
    if times < MIN_TIMES_NOISE:
        return f"{text} (within noise)"
    if times > MAX_TIMES_NOISE:
        return f"{text} (> {MAX_TIMES_NOISE:.0f} × noise)"
    return f"{text} ({times:.0f} × noise)"


def brain_rows(
    brains: Sequence[Mapping[str, Any]],
    tables: Tables,
    linked: Collection[str],
) -> list[dict[str, Any]]:
    """Return what a page says of each brain: its facts, its numbers, and its verdict
    with the cause or the warnings.

    Numbers are by title of the metric, each with the texts below it: doubts about it,
    and its `_centile_text` or else its differences from atlases. Brains have id, week,
    population, source, licence, covariates and whether they are synthetic, as
    configured. The table `quality` has the columns subject, verdict, cause, warnings.
    `linked` are the ids of the brains whose source is on a page of their own.
    """
    judged = tables.quality.set_index("subject").fillna("")
    measured = _by_brain(tables.metrics)
    values = measured["value"].to_dict()
    names = set(measured["metric"])
    rated = _by_brain(tables.centiles)
    texts = dict(
        zip(
            rated.index,
            _centile_text(rated),
            strict=True,
        )
    )
    shown = [name for name in metrics_shown(Shown.BRAINS) if name in names]
    rows = []
    for brain in brains:
        key = brain["id"]
        doubts = _doubtful_metrics(judged.loc[key].to_dict())
        from_atlases = _difference_texts(tables.differences, key, {}, with_noise=False)
        numbers = {}
        for name in shown:
            number: tuple[str, list[str]] = ("–", [])
            if (key, name) in values:
                below = [doubts[name]] if name in doubts else []
                centile = texts.get((key, name), "–")
                if centile != "–":
                    below.append(centile)
                else:
                    below += [
                        f"{words[name]} {atlas_label(atlas)}"
                        for atlas, words in from_atlases.items()
                        if name in words
                    ]
                number = (METRICS[name].text(values[key, name]), below)
            numbers[metric_title(name)] = number
        is_linked, is_synthetic = key in linked, brain["synthetic"]
        licence = brain["licence"] or (
            "made here" if is_synthetic else "" if is_linked else "your own data"
        )
        covariates = [f"{key}: {value}" for key, value in brain["covariates"].items()]
        facts = [
            week_label(brain["week"]),
            brain["population"] or ("synthetic" if is_synthetic else ""),
            *covariates,
        ]
        facts += ["" if is_linked else brain["source"], licence]
        cause = judged.loc[key, "cause"] or judged.loc[key, "warnings"]
        row = {
            "numbers": numbers,
            "facts": list(filter(None, facts)),
            "cause": cause,
        }
        rows.append(
            {
                **brain,
                **row,
                "verdict": judged.loc[key, "verdict"],
            }
        )
    return rows


def _by_brain(table: pd.DataFrame) -> pd.DataFrame:
    """Return the values of whole observed brains, by brain and metric."""
    is_observed = table["run"] == OBSERVED
    is_whole = table["hemisphere"] == "whole"
    has_value = table["value"].notna()
    rows = table[is_observed & is_whole & has_value]
    return rows.set_index(["subject", "metric"], drop=False)


def accuracy_sentence(prediction: Mapping[str, Any]) -> str:
    """Describe how accurate predictions over as many weeks were for brains with a later
    scan.

    Where the atlas' own brain was better, that comes first.
    """
    rows = pd.DataFrame(prediction["accuracy"]["rows"])
    weeks_ahead = prediction["week"] - prediction["start_week"]
    # the next longer horizon that was tested, or the longest
    tested = rows["horizon"]
    is_longer = tested >= weeks_ahead - 1e-6
    horizon = tested[is_longer].min() if is_longer.any() else tested.max()
    models = rows[rows["horizon"] == horizon].groupby("model")
    distances = models["distance_mm"].agg(_range_text)
    correlations = models["r_shape_index"].agg(_range_text)
    run, atlas, scaled = (
        f"{distances[model]} mm (r {correlations[model]})"
        for model in ("run", "atlas", "scaled")
    )
    means = models[["distance_mm", "r_shape_index"]].mean()
    better = []
    if means.loc["atlas", "distance_mm"] < means.loc["run", "distance_mm"]:
        better.append("closer")
    if means.loc["atlas", "r_shape_index"] > means.loc["run", "r_shape_index"]:
        better.append("more similar in shape index")
    advantage, simpler, beyond = prediction["tests"]["advantage"], "", ""
    if better and not advantage:
        simpler = (
            f" On average the atlas' own brain was {' and '.join(better)}; it is stored"
            " with the prediction."
        )
    if weeks_ahead > horizon + 1e-6:
        beyond = f" No test went as far as {weeks_ahead:.3g} weeks."
    return (
        f"{advantage} This is a prediction, not a scan. In tests over {horizon:g}"
        " weeks, the mean distance from the observed brain and the correlation of"
        f" shape index with it were {run} for predictions, {atlas} for the atlas' own"
        f" brain and {scaled} for the scaled start.{simpler}{beyond} The test brains"
        " were averages of many normal fetuses; the accuracy for a single fetus is"
        " unknown."
    ).lstrip()


def _predicted_table(
    prediction: Mapping[str, Any],
    tables: Tables,
) -> pd.DataFrame:
    """Return the metrics of a predicted brain, its start and the atlas' brain, and the
    difference from the atlas in %.

    Centiles stand beside the values if there is a norm of individuals, and the interval
    of an ensemble next to them. `prediction` is the output of `Study.prediction_facts`
    with `tests`, that of `compare.accuracy.prediction_facts`.
    """
    metrics, centiles, intervals = tables.metrics, tables.centiles, tables.intervals
    is_shown = metrics["metric"].isin(metrics_shown(Shown.PREDICTION))
    rows = metrics[is_shown & (metrics["hemisphere"] == "whole")]
    rows = rows.set_index(_named(rows))

    is_rated = centiles["centile"].notna()
    scores = centiles[is_rated & (centiles["hemisphere"] == "whole")]
    scores = scores.assign(text=_centile_text(scores)).set_index(_named(scores))

    start, atlas_brain = prediction["brain"], prediction["atlas_brain"]
    brains = {
        "start": (start, OBSERVED, prediction["start_week"]),
        "predicted": (start, prediction["run"], prediction["week"]),
        "the atlas' own brain": (atlas_brain, OBSERVED, prediction["atlas_week"]),
    }
    columns: dict[str, pd.Series] = {}
    values = {}
    for name, (brain, run, week) in brains.items():
        head = f"{name}, {week_label(week)}"
        values[name] = _rows_of(rows, brain, run, week)["value"]
        columns[head] = values[name]
        texts = _rows_of(scores, brain, run, week)["text"]
        if len(texts):
            columns[f"{head}: centile (90 % interval), z"] = texts
        if intervals is not None and run == prediction["run"]:
            last = intervals[intervals["week"] == week]
            ends = zip(last["low"], last["high"], strict=True)
            intervals_shown = [f"{low:.4g} to {high:.4g}" for low, high in ends]
            columns[INTERVAL_HEAD] = pd.Series(intervals_shown, _named(last))
    predicted = values["predicted"]
    differences = 100 * (predicted / values["the atlas' own brain"] - 1)
    columns["predicted less the atlas' (%)"] = differences.map(_signed)
    errors = pd.Series(prediction["tests"]["errors"])
    columns[ERROR_HEAD] = errors.rename(index=metric_title)
    return pd.DataFrame(columns).reindex(predicted.index).rename_axis("metric")


def _rows_of(
    table: pd.DataFrame,
    brain: str,
    run: str,
    week: float,
) -> pd.DataFrame:
    is_brain = (table["subject"] == brain) & (table["week"] == week)
    return table[is_brain & (table["run"] == run)]


def _kept_sentence(kept: pd.DataFrame, end_week: float) -> str:
    """Describe how much of the individual difference a prediction keeps."""
    weeks = kept["week"].to_numpy()
    smooth = np.interp(end_week, weeks, kept["smooth_share"])
    finer = np.interp(end_week, weeks, kept["finer_share"])
    difference_mm = kept["difference_mm"].iloc[0]
    words = (
        f"The start differs from the atlas at its week by {difference_mm:.2f} mm (root"
        f" mean square). Of what is smooth {100 * smooth:.0f} % is kept at"
        f" {week_label(end_week)}, and {100 * finer:.0f} % of finer differences; the"
        " rest of the prediction is the atlas."
    )
    if smooth < ATLAS_ALONE:
        words += (
            " So small a difference is hardly more than the error of the match, and the"
            " prediction is nearly the atlas' own brain with the same volume curve."
        )
    return words


def _accuracy_table(accuracy: Mapping[str, Any]) -> pd.DataFrame:
    """Return the accuracy of predictions and simpler predictions: a row per horizon,
    with the range over the starts.

    `accuracy` has rows (start, horizon in GW, model, distance_mm, r_shape_index, and
    area_difference and volume_difference as fractions of the observed brain's), of
    models `run` and of `SIMPLER_PREDICTIONS`.
    """
    table: dict[Any, dict[str, str]] = {}
    every = pd.DataFrame(accuracy["rows"])
    # by horizon, the prediction first
    every["is_simpler"] = every["model"] != "run"
    for (horizon, _, model), rows in every.groupby(["horizon", "is_simpler", "model"]):
        row = table.setdefault(horizon, {})
        distance, r = (
            _range_text(rows["distance_mm"]),
            _range_text(rows["r_shape_index"]),
        )
        if model == "run":
            row |= {"prediction: distance (mm)": distance, "r": r}
            for size in ("area", "volume"):
                errors = 100 * rows[f"{size}_difference"]
                row[f"{size} (%)"] = _range_text(errors, "+.1f")
        else:
            row[SIMPLER_PREDICTIONS[str(model)]] = f"{distance} mm, r {r}"
    return pd.DataFrame.from_dict(table, orient="index").rename_axis("weeks ahead")


def _range_text(values: pd.Series, pattern: str = ".2f") -> str:
    """Return the minimum and the maximum as text, once if they are equal; a dash
    without numbers."""
    ends = [
        format(value, pattern).replace("-", "−")
        for value in (values.min(), values.max())
        if np.isfinite(value)
    ]
    return " to ".join(dict.fromkeys(ends)) or "–"


def brain_content(
    brain: Mapping[str, Any],
    tables: Tables,
) -> dict[str, Any]:
    """Return what the page of an observed brain says of its metrics, for its
    template."""
    key = brain["id"]
    is_own = tables.metrics["subject"] == key
    metrics = tables.metrics[is_own & (tables.metrics["run"] == OBSERVED)]
    quality = tables.quality[tables.quality["subject"] == key]
    doubts = _doubtful_metrics(quality.iloc[0].to_dict())
    every = _brain_table(metrics, tables.centiles, tables.differences, doubts)
    sheet = [_doubtful_title(name, doubts) for name in metrics_shown(Shown.SHEET)]
    differences = tables.differences[tables.differences["subject"] == key]
    atlases = differences["atlas"].unique()
    curves = tables.curves[tables.curves["atlas"].isin(atlases)]
    names = set(metrics["metric"])
    return {
        "usual": html_table(every.loc[[name for name in sheet if name in every.index]]),
        "atlases": list(map(cited_atlas, atlases)),
        "has_parts": "volume_tissue" in names,
        "has_thickness": "mean_thickness" in names,
        "week_errors": _week_errors(curves, brain["week"]),
        "numbers": html_table(every),
    }


def prediction_content(
    prediction: Mapping[str, Any], tables: Tables, norm: str
) -> dict[str, Any]:
    """Return what the report of a prediction says of it, for its template."""
    numbers = _predicted_table(prediction, tables)
    has_centiles = any("centile" in str(head) for head in numbers)
    return {
        **prediction,
        "numbers": html_table(numbers),
        "accuracy_table": html_table(_accuracy_table(prediction["accuracy"])),
        "kept_sentence": _kept_sentence(prediction["kept"], prediction["week"]),
        "individuals": norm if has_centiles else "",
    }
