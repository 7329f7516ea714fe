"""Tables of a study, and any table as HTML."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment
from markupsafe import Markup

from ..quantities import METRICS, Shown, metrics_shown
from ..settings.terms import (
    OBSERVED,
    OBSERVED_BRAIN,
    SIDES,
    element_error,
    is_too_coarse,
)
from .labels import (
    SIMPLER_PREDICTIONS,
    atlas_label,
    metric_title,
    parameter_label,
    plain,
    week_label,
)
from .style import run_colours, runs_by_name

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
NO_DOUBTS: Mapping[str, str] = {}
VERDICTS = ("fine", "needs review", "refused")
_WORD, _SENTENCE = 12, 60
NUMBER = re.compile(r"[+−]?\d[\d.]*(·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+| %| \([+−][\d.]+\))?|–")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_TABLE = Environment(autoescape=True).from_string(
    "<table><thead><tr>"
    "{% for head in heads %}<th>{{ head }}</th>{% endfor %}"
    "</tr></thead>\n"
    "<tbody>{% for row in rows %}<tr>"
    '{% for kind, text in row %}<td class="{{ kind }}">{{ text }}</td>{% endfor %}'
    "</tr>\n{% endfor %}</tbody></table>"
)

COMMON_PARAMETERS = (
    "thickness_mm",
    "shear_modulus_cortex_pa",
    "shear_modulus_core_pa",
    "material",
    "poisson_ratio",
    "growth_of",
    "growth_rate_per_s",
    "core_growth_rate_per_s",
    "stress_memory_gw",
    "support",
    "contact",
    "step_s",
    "tets",
    "order",
    "elements_through_cortex",
    "element_error_percent",
    "steps",
    "newton",
    "seconds",
    "peak_memory_MiB",
)
"""Parameters and summaries that are listed even if all runs share them."""
MESH_MEASURES = {
    "tets": "elements",
    "min_radius_ratio": "least radius ratio",
    "median_radius_ratio": "median radius ratio",
    "min_dihedral_deg": "smallest dihedral angle (°)",
    "max_dihedral_deg": "largest dihedral angle (°)",
    "min_volume_mm3": "smallest volume (mm³)",
    "surface_distance_mm": "99 % of the surface within (mm)",
    "crossing_faces": "crossing faces",
    "volume_change": "relative change of volume",
    "gap_kept": "share of narrow gaps that is open",
}
"""Measures of mesh quality, with their labels."""

ATLAS_ALONE = 0.2
"""Share of the individual difference below which a prediction is called nearly the
atlas' own brain."""
ERROR_HEAD = "error of such predictions, of averages"
INTERVAL_HEAD = "interval of ensemble and tests of averages"
"""Columns of `predicted_table`. The tested brains are averages of many fetuses, which
says little of a single one."""


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
    week = max(
        set(rows.loc[observed, "week"]) & set(rows.loc[~observed, "week"])
        or set(rows["week"])
    )
    rows = rows[rows["week"] == week].assign(name=_named)
    wide = rows.pivot_table(
        "value",
        "name",
        "run",
        aggfunc="mean",
    ).reindex(dict.fromkeys(rows["name"]))
    # of what may be zero, a difference in per cent is meaningless
    is_signed = wide.index.isin(rows.loc[_signed_metrics(rows), "name"])
    observed_values = (
        wide[OBSERVED] if OBSERVED in wide else pd.Series(np.nan, index=wide.index)
    )
    columns = {observed_name: observed_values}
    for run in run_colours(rows["run"]):
        differences = 100 * (wide[run] / observed_values - 1)
        columns |= {
            run: wide[run],
            f"{run}, difference (%)": differences.map(_signed).where(~is_signed, "–"),
        }
    return pd.DataFrame(columns).rename_axis(f"metric at {week_label(week)}")


def _signed(percent: float, unit: str = "") -> str:
    """Return a difference in per cent with its sign; no sign if it rounds to zero."""
    return (
        "–"
        if np.isnan(percent)
        else f"{percent:+z.1f}".replace("-", "−").replace("+0.0", "0.0") + unit
    )


def centile_text(centiles: pd.DataFrame) -> list[str]:
    """Return the text of each row of centiles: "centile (interval), z", the difference
    from the norm in %, or "–"."""
    differences = (centiles["value"] / centiles["expected"] - 1).where(
        ~_signed_metrics(centiles)
    )
    return [
        (
            f"{centile:.0f} ({low:.0f} to {high:.0f}), {z:+.1f}".replace("-", "−")
            if np.isfinite(centile)
            else _signed(100 * part, " %")
        )
        for centile, low, high, z, part in zip(
            *(
                centiles[name]
                for name in ("centile", "centile_low", "centile_high", "z")
            ),
            differences,
            strict=True,
        )
    ]


def doubtful_metrics(row: Mapping[Any, Any]) -> dict[str, str]:
    """Return the metrics of a brain that its warnings say are wrong, and how, by its
    row of the quality table."""
    doubts: dict[str, str] = {}
    for column, (words, names) in DOUBTS.items():
        # a refused brain has neither
        if row.get(column) is True or row.get(column) == "True":
            doubts |= dict.fromkeys(names, words)
    return doubts


def doubtful_title(name: str, doubts: Mapping[str, str]) -> str:
    """Return the title of a metric, with the doubt about it."""
    title = metric_title(name)
    return f"{title}: {doubts[name]}, see the warning" if name in doubts else title


def brain_table(
    metrics: pd.DataFrame,
    centiles: pd.DataFrame,
    differences: pd.DataFrame,
    doubts: Mapping[str, str] = NO_DOUBTS,
) -> pd.DataFrame:
    """Return the metrics of an observed brain, whole and by hemisphere, with the
    differences from the average brains of atlases, and the centiles of the whole brain.

    Metrics that only hemispheres have also have only their differences. `metrics` has
    the columns hemisphere, metric, value, unit, of this brain; `centiles`, of the
    study, subject, run, hemisphere, metric, value, expected, z, centile, flag;
    `differences` are those of `metrics.atlas_curves`, of the study; `doubts` the output
    of `doubtful_metrics`.
    """
    rows = _reported(metrics).assign(name=_named)
    wide = rows.pivot_table(
        "value",
        "name",
        "hemisphere",
        aggfunc="first",
    ).reindex(rows["name"].unique())
    table = wide[[part for part in ("whole", *SIDES) if part in wide]]
    brain = metrics["subject"].iloc[0]
    for atlas, texts in difference_texts(differences, brain, doubts).items():
        head = f"{FROM_ATLAS} {atlas_label(atlas)} ({NOISE_HEAD})"
        titled = {metric_title(name): text for name, text in texts.items()}
        table = table.assign(**{head: table.index.to_series().map(titled)})
    scores = _of_whole(centiles, brain)
    # without a norm there are only flags
    if scores["expected"].notna().any():
        scores = scores.assign(text=centile_text(scores)).set_index("name")
        columns = {
            "centile (90 % interval), z; or difference": scores["text"],
            "note": scores["flag"],
        }
        table = table.assign(norm=scores["expected"], **columns)
    named = {metric_title(name): doubtful_title(name, doubts) for name in doubts}
    return table.dropna(how="all").rename(index=named).rename_axis("metric")


def _of_whole(table: pd.DataFrame, brain: str) -> pd.DataFrame:
    """Return the rows of an observed brain as a whole, with titles as `name`."""
    is_own = (table["subject"] == brain) & (table["run"] == OBSERVED)
    return table[is_own & (table["hemisphere"] == "whole")].assign(name=_named)


def difference_texts(
    differences: pd.DataFrame,
    brain: str,
    doubts: Mapping[str, str] = NO_DOUBTS,
    *,
    with_noise: bool = True,
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
        if "whole" in by_part:
            text = by_part["whole"]
        else:
            text = "; ".join(f"{side} {words}" for side, words in by_part.items())
        texts.setdefault(atlas, {})[metric] = text
    return texts


def week_errors(curves: pd.DataFrame, week: float) -> list[str]:
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
                values = np.interp([week, *others], curve["week"], curve["value"])
                changes = 100 * (values[1:] / values[0] - 1)
                words = " and ".join(_signed(change, " %") for change in changes)
                label, *_ = METRICS[name].label.split(",")
                parts.append(f"{label} {words}")
        if parts:
            weeks = " and ".join(f"{other:g}" for other in others)
            texts.append(f"{atlas_label(str(atlas))} at {weeks} GW: {', '.join(parts)}")
    return texts


def _difference_text(row: Mapping[Any, Any], *, with_noise: bool) -> str:
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


def runs_table(parameters: Mapping[str, Mapping[str, object]]) -> pd.DataFrame:
    """Return the parameters of the runs with their units: a row per parameter, a column
    per run.

    `parameters` are by run and name. Those that differ between the runs come first,
    then `COMMON_PARAMETERS`. Nested names are joined by dots. A curve over weeks is
    shown by its first and last values.
    """
    flat = pd.DataFrame(
        {
            run: pd.Series(_flatten(values), dtype=object)
            for run, values in parameters.items()
        }
    )
    texts = flat.map(_text)
    # absent, zero and no count as equal
    differs = texts.ne(texts.iloc[:, 0], axis=0).any(axis=1) & ~texts.isin(
        ["–", "0", "no"]
    ).all(axis=1)
    names = [
        *texts.index[differs],
        *(
            name
            for name in COMMON_PARAMETERS
            if name in texts.index and not differs[name]
        ),
    ]
    return texts.loc[names].rename(index=parameter_label).rename_axis("parameter")


def resolution_over_steps(
    order: int,
    steps: pd.DataFrame,
    *,
    has_layers: bool,
) -> dict[str, float]:
    """Return how well the steps of a run with elements of an order resolved the cortex,
    for the table of runs.

    `steps` has a row per step with the columns week and elements_through_cortex: NaN if
    no element has its centre in the cortex, which counts as 0.

    Returns `order`, `element_error_percent` (`element_error` at the start),
    `least_elements_through_cortex`, and `unresolved_from_week`, the first week with
    fewer elements than `ELEMENTS_NEEDED` (NaN if there is none). Of growth without
    layers the error and that week are NaN.
    """
    through = steps["elements_through_cortex"].fillna(0.0)
    error, first_week = math.nan, math.nan
    if has_layers:
        error = round(
            element_error(order, through.iloc[0])[0],
            1,
        )
        too_coarse = [is_too_coarse(order, elements) for elements in through]
        first_week = float(steps.loc[too_coarse, "week"].min())
    return {
        "order": order,
        "element_error_percent": error,
        "least_elements_through_cortex": float(through.min()),
        "unresolved_from_week": first_week,
    }


def resources(jobs: pd.DataFrame) -> pd.DataFrame:
    """Sum up jobs: a row per rule, a row per run of the simulations, the longest first,
    and the sum of all.

    A job occupies at least one core, so its core hours are the longer of wall and CPU
    time. `jobs` has the columns rule, run, wall_s, cpu_s, memory_MiB: NaN if unknown;
    such jobs are counted, and add nothing to the sums.

    Columns stage, run, jobs, hours and core_hours (sums), memory_MiB (of the largest
    job).
    """
    hours = jobs[["wall_s", "cpu_s"]].astype(float) / 3600
    each = jobs.assign(
        hours=hours["wall_s"],
        core_hours=hours.max(axis=1),
        run=jobs["run"].fillna(""),
        jobs=1,
    )
    totals = {
        "jobs": "sum",
        "hours": "sum",
        "core_hours": "sum",
        "memory_MiB": "max",
    }
    stages = each.groupby(
        ["rule", "run"],
        sort=False,
        as_index=False,
    ).agg(totals)
    stages = stages.rename(columns={"rule": "stage"}).sort_values(
        "core_hours", ascending=False, kind="stable"
    )
    whole = pd.DataFrame(
        [
            {
                "stage": "all",
                "run": "",
                **stages.agg(totals),
            }
        ]
    )
    return pd.concat([stages, whole], ignore_index=True).astype({"jobs": int})


def atlas_ages(ages: pd.DataFrame) -> pd.DataFrame:
    """Return the ages by size of an atlas' brains, a row per stated week.

    `ages` has the columns stated_week, age_by_size, volume_ml and curve_ml.
    """
    return (
        ages.set_index("stated_week")
        .rename(columns=plain)
        .rename_axis("stated week (GW)")
        .round(2)
    )


def prediction_table(prediction: pd.DataFrame) -> pd.DataFrame:
    """Return the accuracy of predicted brains and of simpler predictions: a row per
    start, week and model.

    `prediction` is the study's prediction.csv.
    """
    models = prediction["model"].map(
        lambda name: SIMPLER_PREDICTIONS.get(name, plain(name))
    )
    table = prediction.assign(
        model=models.where(prediction["model"] != "run", prediction["run"])
    )
    # simpler predictions are the same for all runs
    table = table.drop_duplicates(["start", "week", "model"]).set_index(
        ["start", "week", "model"]
    )
    columns = [
        "r_shape_index",
        "distance_mm",
        "distance95_mm",
        "area_difference",
        "volume_difference",
    ]
    columns += ["crossing_faces", "roughness_ratio", "skill", "skill_low", "skill_high"]
    return table[
        [*columns, "r_less_atlas", "r_less_atlas_low", "r_less_atlas_high"]
    ].rename(columns=plain)


def predicted_table(
    metrics: pd.DataFrame,
    prediction: Mapping[str, Any],
    centiles: pd.DataFrame,
    intervals: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """Return the metrics of a predicted brain, its start and the atlas' brain, and the
    difference from the atlas in %.

    Centiles stand below the values if there is a norm of individuals, and the interval
    of an ensemble next to them. `metrics` is as for `metrics_table`, `centiles` as for
    `brain_table`; `prediction` is the output of `Study.prediction_facts` with `tests`,
    that of `compare.accuracy.prediction_facts`; `intervals` that of
    `compare.accuracy.interval_table`.
    """
    rows = metrics[
        (metrics["hemisphere"] == "whole")
        & metrics["metric"].isin(metrics_shown(Shown.PREDICTION))
    ]
    rows = rows.assign(name=_named).set_index("name")

    scores = centiles[
        (centiles["hemisphere"] == "whole") & centiles["centile"].notna()
    ].assign(name=_named)
    scores = scores.assign(text=centile_text(scores)).set_index("name")

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
            last = (
                intervals[intervals["week"] == prediction["week"]]
                .assign(name=_named)
                .set_index("name")
            )
            ends = zip(last["low"], last["high"], strict=True)
            columns[INTERVAL_HEAD] = pd.Series(
                [f"{a:.4g} to {b:.4g}" for a, b in ends], last.index
            )
    predicted = values["predicted"]
    differences = 100 * (predicted / values["the atlas' own brain"] - 1)
    columns["predicted less the atlas' (%)"] = differences.map(_signed)
    errors = {
        metric_title(metric): text
        for metric, text in prediction["tests"]["errors"].items()
    }
    columns[ERROR_HEAD] = predicted.index.to_series().map(errors)
    return pd.DataFrame(columns).reindex(predicted.index).rename_axis("metric")


def _rows_of(
    table: pd.DataFrame,
    brain: str,
    run: str,
    week: float,
) -> pd.DataFrame:
    is_brain = (table["subject"] == brain) & (table["week"] == week)
    return table[is_brain & (table["run"] == run)]


def kept_table(kept: pd.DataFrame, end_week: float) -> pd.DataFrame:
    """Return how much of the individual difference a prediction keeps: a row per week
    of the atlas up to the first one from `end_week` on.

    `kept` has week, smooth_share and finer_share of that difference
    (`growth.expected.Expectation`).
    """
    last = int(np.searchsorted(kept["week"], end_week - 1e-6)) + 1
    rows = kept.head(last)
    percent = {
        "smooth difference kept (w)": 100 * rows["smooth_share"],
        "finer differences kept": 100 * rows["finer_share"],
    }
    table = pd.DataFrame(percent).round().astype(int).astype(str) + " %"
    return table.set_index(rows["week"].map(week_label).rename("predicted for"))


def kept_sentence(kept: pd.DataFrame, end_week: float) -> str:
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


def accuracy_table(accuracy: Mapping[str, Any]) -> pd.DataFrame:
    """Return the accuracy of predictions and simpler predictions: a row per horizon,
    with the range over the starts.

    `accuracy` has rows (start, horizon in GW, model, distance_mm, r_shape_index, and
    area_difference and volume_difference as fractions of the observed brain's), of
    models `run` and of `SIMPLER_PREDICTIONS`.
    """
    table: dict[Any, dict[str, str]] = {}
    for (horizon, model), rows in pd.DataFrame(accuracy["rows"]).groupby(
        ["horizon", "model"]
    ):
        distance, r = range_text(rows["distance_mm"]), range_text(rows["r_shape_index"])
        if model == "run":
            errors = {
                f"{size} (%)": range_text(
                    100 * rows[f"{size}_difference"],
                    "+.1f",
                )
                for size in ("area", "volume")
            }
            table[horizon] = (
                {"prediction: distance (mm)": distance, "r": r}
                | errors
                | table.get(horizon, {})
            )
        else:
            table.setdefault(horizon, {})[SIMPLER_PREDICTIONS[str(model)]] = (
                f"{distance} mm, r {r}"
            )
    return pd.DataFrame.from_dict(table, orient="index").rename_axis("weeks ahead")


def range_text(values: pd.Series, pattern: str = ".2f") -> str:
    """Return the minimum and the maximum as text, once if they are equal; a dash
    without numbers."""
    ends = [
        format(value, pattern).replace("-", "−")
        for value in (values.min(), values.max())
        if np.isfinite(value)
    ]
    return " to ".join(dict.fromkeys(ends)) or "–"


def mesh_quality(
    quality: Sequence[Mapping[str, Any]],
    *,
    starts: Sequence[str],
    gates: Mapping[str, float],
) -> pd.DataFrame:
    """Return the quality of meshes: a row per measure with its limit, a column per
    brain.

    `quality` are the contents of quality.json of each of the start brains, `gates` the
    limits in the configuration, by their keys in the section mesh.
    """
    columns = {
        brain: {
            **values,
            "surface_distance_mm": values["surface_distance_mm"]["hausdorff99"],
        }
        for brain, values in zip(starts, quality, strict=True)
    }
    table = (
        pd.DataFrame(columns, dtype=object)
        .reindex(list(MESH_MEASURES))
        .rename(index=MESH_MEASURES)
    )
    table["limit"] = [
        gates.get(
            name,
            gates.get(
                f"max_{name}",
                gates.get(f"min_{name}"),
            ),
        )
        for name in MESH_MEASURES
    ]
    return table.rename_axis("measure")


def html_table(table: pd.DataFrame) -> Markup:
    """Return the table as HTML.

    Text is escaped, numbers have four significant digits and are aligned right, missing
    values are dashes. The index is shown if it has a name.
    """
    named = any(name is not None for name in table.index.names)
    flat = table.reset_index() if named else table
    texts = flat.map(lambda value: _text(value, 4))
    rows = [
        [
            (_kind(name, value, text), text)
            for name, value, text in zip(
                flat,
                row,
                words,
                strict=True,
            )
        ]
        for row, words in zip(
            flat.to_numpy(dtype=object), texts.to_numpy(), strict=True
        )
    ]
    return Markup(
        _TABLE.render(
            heads=list(flat),
            rows=rows,
        )
    )


def _kind(
    name: object,
    value: object,
    text: str,
) -> str:
    """Return the CSS class of a cell."""
    if (
        isinstance(
            value,
            int | float | np.number,
        )
        and not isinstance(value, bool)
    ) or NUMBER.fullmatch(text):
        return "number"
    if isinstance(text, Markup):
        return "composed"
    if name == "verdict" and text in VERDICTS:
        return f"verdict {text}"
    # sentences get wide columns; single words and numbers stay on one line
    return "wide" if len(text) > _SENTENCE else "whole" if len(text) <= _WORD else ""


def _flatten(values: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    flat: dict[str, object] = {}
    for name, value in values.items():
        if (
            isinstance(value, Mapping)
            and value
            and all(str(week).replace(".", "", 1).isdigit() for week in value)
        ):
            ends = [(week, value[week]) for week in sorted(value, key=float)]
            flat[f"{prefix}{name}"] = " to ".join(
                f"{_text(at, 4)} at {week} GW" for week, at in (ends[0], ends[-1])
            )
        elif isinstance(value, Mapping):
            flat.update(
                _flatten(
                    value,
                    f"{prefix}{name}.",
                )
            )
        else:
            flat[f"{prefix}{name}"] = value
    return flat


def _text(value: object, digits: int = 6) -> str:
    match value:
        case bool() | np.bool_():
            return "yes" if value else "no"
        case float() | np.floating():
            number, _, power = f"{value:.{digits}g}".partition("e")
            raised = f"·10{str(int(power)).translate(_RAISED)}" if power else ""
            return "–" if np.isnan(value) else number.replace("-", "−") + raised
        case None:
            return "–"
        case Markup():
            return value
        case list() | tuple():
            return ", ".join(_text(item, digits) for item in value)
        case _:
            return str(value)
