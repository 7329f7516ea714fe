"""Tables of a study, and any table as HTML."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment
from markupsafe import Markup

from ..quantities import METRICS
from ..settings.terms import CARBON_INTENSITY_G_PER_KWH, CORE_POWER_W, ELEMENTS_NEEDED, MEASURED, REAL_BRAIN, SIDES
from .labels import SIMPLER_WAYS, metric_title, parameter_label, plain, week_label
from .style import run_colours, runs_by_name

VERDICTS = ("fine", "look", "refused")
_WORD, _SENTENCE = 12, 60
NUMBER = re.compile(r"[+−]?\d[\d.]*(·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+| %| \([+−][\d.]+\))?|–")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_TABLE = Environment(autoescape=True).from_string(
    "<table><thead><tr>{% for head in heads %}<th>{{ head }}</th>{% endfor %}</tr></thead>\n<tbody>"
    '{% for row in rows %}<tr>{% for kind, text in row %}<td class="{{ kind }}">{{ text }}</td>{% endfor %}</tr>\n'
    "{% endfor %}</tbody></table>"
)

OF_EVERY_RUN = (
    *("thickness_mm", "shear_modulus_cortex_pa", "shear_modulus_core_pa", "material", "poisson_ratio"),
    *(
        "growth_of",
        "growth_rate_per_s",
        "core_growth_rate_per_s",
        "stress_memory_gw",
        "support",
        "contact.kind",
        "no_growth.kind",
    ),
    *("step_s", "tets", "order", "elements_through_cortex", "steps", "newton", "seconds", "peak_memory_MiB"),
)
"""Parameters and summaries that are told of runs even where all have the same."""
OF_PREDICTIONS = ("volume", "area", "gyrification_index", "mean_sulcal_depth", "mean_curvedness")
"""Metrics of predicted brains: the thickness of their cortex is a setting."""
AROUND_ZERO = "mean_shape_index"
"""A metric that may be zero, so that a difference in per cent says nothing."""
OF_THE_MESH = {
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
"""What is told of the quality of a mesh."""


def _named(rows: pd.DataFrame) -> pd.Series:
    """Return the metric of each row as in figures, with its unit."""
    return rows["metric"].map(metric_title).astype(object)


def _reported(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of metrics that are shown in the report."""
    return rows[rows["metric"].map(lambda name: METRICS[name].is_reported).astype(bool)]


def metrics_table(metrics: pd.DataFrame, *, measured: str = REAL_BRAIN) -> pd.DataFrame:
    """Return the metrics of whole brains: each run, the measured brain, and each run's difference in %.

    They are those of the last week that runs and measured brains share, else of the last of all. What says how a
    surface was measured, not what it is like, is left out, and so are quantiles.

    Parameters
    ----------
    metrics : columns subject, run, week, hemisphere, metric, value, unit
        `run` is "real" for measured brains; several measured brains of a week give their mean.
    measured : heading of the measured brains' column

    Returns
    -------
    DataFrame indexed by metric (with its unit); cells without a value are NaN, without a difference "–"
    """
    rows = runs_by_name(_reported(metrics[metrics["hemisphere"] == "whole"]))
    real = rows["run"] == MEASURED
    week = max(set(rows.loc[real, "week"]) & set(rows.loc[~real, "week"]) or set(rows["week"]))
    rows = rows[rows["week"] == week].assign(name=_named)
    wide = rows.pivot_table("value", "name", "run", aggfunc="mean").reindex(dict.fromkeys(rows["name"]))
    around_zero = wide.index.isin(rows.loc[rows["metric"] == AROUND_ZERO, "name"])
    of_real = wide[MEASURED] if MEASURED in wide else pd.Series(np.nan, index=wide.index)
    columns = {measured: of_real}
    for run in run_colours(rows["run"]):
        differences = 100 * (wide[run] / of_real - 1)
        columns |= {run: wide[run], f"{run}, difference (%)": differences.map(_signed).where(~around_zero, "–")}
    return pd.DataFrame(columns).rename_axis(f"metric at {week_label(week)}")


def _signed(percent: float, unit: str = "") -> str:
    """Return a difference in per cent with its sign, none where it is rounded to zero."""
    return "–" if np.isnan(percent) else f"{percent:+z.1f}".replace("-", "−").replace("+0.0", "0.0") + unit


def standing(centiles: pd.DataFrame) -> list[str]:
    """Return where each row of a table of centiles stands: "centile (z)", the difference from the norm in %, or "–"."""
    away = (centiles["value"] / centiles["expected"] - 1).where(centiles["metric"] != AROUND_ZERO)
    return [
        f"{centile:.0f} ({z:+.1f})".replace("-", "−") if np.isfinite(centile) else _signed(100 * part, " %")
        for centile, z, part in zip(centiles["centile"], centiles["z"], away, strict=True)
    ]


def brain_table(metrics: pd.DataFrame, centiles: pd.DataFrame) -> pd.DataFrame:
    """Return the metrics of a measured brain, whole and by hemisphere, and where the whole stands among the norm.

    Parameters
    ----------
    metrics : columns hemisphere, metric, value, unit, of this brain
    centiles : those of the study, columns subject, run, hemisphere, metric, value, expected, z, centile, flag
    """
    rows = _reported(metrics).assign(name=_named)
    wide = rows.pivot_table("value", "name", "hemisphere", aggfunc="first").reindex(rows["name"].unique())
    table = wide[[part for part in ("whole", *SIDES) if part in wide]]
    own = (centiles["subject"] == metrics["subject"].iloc[0]) & (centiles["run"] == MEASURED)
    scores = centiles[own & (centiles["hemisphere"] == "whole")].assign(name=_named)
    if len(scores):
        scores = scores.assign(stands=standing(scores)).set_index("name")
        stands = {"centile (z) or difference": scores["stands"], "note": scores["flag"]}
        table = table.assign(norm=scores["expected"], **stands)
    return table.dropna(how="all").rename_axis("metric")


def runs_table(parameters: Mapping[str, Mapping[str, object]]) -> pd.DataFrame:
    """Return the parameters of the runs with their units: a row per parameter, a column per run.

    There are those that differ between the runs, then `OF_EVERY_RUN`.

    Parameters
    ----------
    parameters : {run: {name: value}}
        Values may be mappings themselves; their names are joined by dots. A curve over weeks is shown by its ends.
    """
    flat = pd.DataFrame({run: pd.Series(_flatten(values), dtype=object) for run, values in parameters.items()})
    shown = flat.map(_shown)
    # what one run has not and the other has not set is no difference
    differs = shown.ne(shown.iloc[:, 0], axis=0).any(axis=1) & ~shown.isin(["–", "0", "no"]).all(axis=1)
    chosen = [*shown.index[differs], *(name for name in OF_EVERY_RUN if name in shown.index and not differs[name])]
    return shown.loc[chosen].rename(index=parameter_label).rename_axis("parameter")


def resolution_over_steps(order: int, steps: pd.DataFrame) -> dict[str, float]:
    """Return how well the steps of a run resolved the cortex, as the table of runs has it.

    Parameters
    ----------
    order : of the elements
    steps : columns week, elements_through_cortex
        One row per step; no number where no element has its centre in the cortex, which counts as none.

    Returns
    -------
    dict
        `order`, `least_elements_through_cortex`, and `unresolved_from_week`, the first week with fewer elements than
        `ELEMENTS_NEEDED` (NaN: there is none).
    """
    through = steps["elements_through_cortex"].fillna(0.0)
    return {
        "order": order,
        "least_elements_through_cortex": float(through.min()),
        "unresolved_from_week": float(steps.loc[through < ELEMENTS_NEEDED[order], "week"].min()),
    }


def resources(jobs: pd.DataFrame) -> pd.DataFrame:
    """Sum up jobs: a row per rule, a row per run of the simulations, the longest first, and the sum of all.

    A job keeps one core busy at least, so its energy is the longer of wall and CPU time times the power of a core.

    Parameters
    ----------
    jobs : columns rule, run, wall_s, cpu_s, memory_MiB
        NaN where Snakemake could not measure; such jobs are counted and add nothing.

    Returns
    -------
    DataFrame with columns stage, run, jobs, hours and core_hours (sums), memory_MiB (of the largest job), energy_Wh,
    co2e_g
    """
    hours = jobs[["wall_s", "cpu_s"]].astype(float) / 3600
    each = jobs.assign(hours=hours["wall_s"], core_hours=hours.max(axis=1), run=jobs["run"].fillna(""), jobs=1)
    of_all = {"jobs": "sum", "hours": "sum", "core_hours": "sum", "memory_MiB": "max"}
    stages = each.groupby(["rule", "run"], sort=False, as_index=False).agg(of_all)
    stages = stages.rename(columns={"rule": "stage"}).sort_values("core_hours", ascending=False, kind="stable")
    whole = pd.DataFrame([{"stage": "all", "run": "", **stages.agg(of_all)}])
    table = pd.concat([stages, whole], ignore_index=True).astype({"jobs": int})
    table["energy_Wh"] = CORE_POWER_W * table["core_hours"]
    return table.assign(co2e_g=CARBON_INTENSITY_G_PER_KWH / 1000 * table["energy_Wh"])


def prediction_table(prediction: pd.DataFrame) -> pd.DataFrame:
    """Return what predicted brains and simpler ways are worth: a row per start, week and way.

    Parameters
    ----------
    prediction : the study's prediction.csv
    """
    ways = prediction["model"].map(lambda way: SIMPLER_WAYS.get(way, plain(way)))
    table = prediction.assign(way=ways.where(prediction["model"] != "run", prediction["run"]))
    # what is simpler is the same for all runs
    table = table.drop_duplicates(["start", "week", "way"]).set_index(["start", "week", "way"])
    shown = ["r_shape_index", "distance_mm", "distance95_mm", "area_error", "volume_error"]
    return table[[*shown, "crossing_faces", "roughness_ratio", "skill"]].rename(columns=plain)


def predicted_table(metrics: pd.DataFrame, prediction: Mapping[str, Any]) -> pd.DataFrame:
    """Return the metrics of a predicted brain, of its start and of the atlas' brain, and its difference from that in %.

    `metrics` are as for `metrics_table`; `prediction` names the run, the brain, the atlas' one beside it, and weeks.
    """
    rows = metrics[(metrics["hemisphere"] == "whole") & metrics["metric"].isin(OF_PREDICTIONS)]
    rows = rows.assign(name=_named).set_index("name")

    def values(brain: str, run: str, when: str) -> pd.Series:
        at = rows["week"] == prediction[when]
        return rows.loc[at & (rows["subject"] == prediction[brain]) & (rows["run"] == run), "value"]

    start, beside = values("brain", MEASURED, "start_week"), values("beside", MEASURED, "beside_week")
    predicted = values("brain", prediction["run"], "week")
    columns = {
        f"start, {week_label(prediction['start_week'])}": start,
        f"predicted, {week_label(prediction['week'])}": predicted,
        f"the atlas' own brain, {week_label(prediction['beside_week'])}": beside,
        "predicted less the atlas' (%)": (100 * (predicted / beside - 1)).map(_signed),
    }
    return pd.DataFrame(columns).reindex(predicted.index).rename_axis("metric")


def worth_table(worth: Mapping[str, Any]) -> pd.DataFrame:
    """Return what predictions and simpler ways were worth: a row per horizon, with what the numbers of the starts span.

    `worth` has rows (start, horizon in GW, model, distance_mm, r_shape_index, and area_error and volume_error as
    fractions of the real brain's), of models `run` and of `SIMPLER_WAYS`.
    """
    table: dict[Any, dict[str, str]] = {}
    for (horizon, model), rows in pd.DataFrame(worth["rows"]).groupby(["horizon", "model"]):
        distance, r = span(rows["distance_mm"]), span(rows["r_shape_index"])
        if model == "run":
            errors = {f"{size} (%)": span(100 * rows[f"{size}_error"], "+.1f") for size in ("area", "volume")}
            table[horizon] = {"prediction: distance (mm)": distance, "r": r} | errors | table.get(horizon, {})
        else:
            table.setdefault(horizon, {})[SIMPLER_WAYS[str(model)]] = f"{distance} mm, r {r}"
    return pd.DataFrame.from_dict(table, orient="index").rename_axis("weeks ahead")


def span(values: pd.Series, pattern: str = ".2f") -> str:
    """Return the least and the largest of numbers, once where they are the same; a dash for none."""
    ends = [format(value, pattern).replace("-", "−") for value in (values.min(), values.max()) if np.isfinite(value)]
    return " to ".join(dict.fromkeys(ends)) or "–"


def mesh_quality_table(quality: Mapping[str, Mapping[str, Any]], gates: Mapping[str, float]) -> pd.DataFrame:
    """Return the quality of meshes: a row per measure with its limit, a column per brain.

    Parameters
    ----------
    quality : {brain: content of its quality.json}
    gates : the limits in the configuration, by their keys in the section mesh
    """
    columns = {
        brain: {**values, "surface_distance_mm": values["surface_distance_mm"]["hausdorff99"]}
        for brain, values in quality.items()
    }
    table = pd.DataFrame(columns, dtype=object).reindex(list(OF_THE_MESH)).rename(index=OF_THE_MESH)
    table["limit"] = [gates.get(name, gates.get(f"max_{name}", gates.get(f"min_{name}"))) for name in OF_THE_MESH]
    return table.rename_axis("measure")


def html_table(table: pd.DataFrame) -> Markup:
    """Return the table as HTML, ready to be put in a page.

    Text is escaped, numbers have four significant digits and stand at the right, missing values are dashes. The index
    is shown where it has a name.
    """
    named = any(name is not None for name in table.index.names)
    flat = table.reset_index() if named else table
    texts = flat.map(lambda value: _shown(value, 4))
    rows = [
        [(_kind(name, value, text), text) for name, value, text in zip(flat, row, words, strict=True)]
        for row, words in zip(flat.to_numpy(dtype=object), texts.to_numpy(), strict=True)
    ]
    return Markup(_TABLE.render(heads=list(flat), rows=rows))


def _kind(name: object, value: object, text: str) -> str:
    """Return the class of a cell, by which the style sheet lays it out."""
    if (isinstance(value, int | float | np.number) and not isinstance(value, bool)) or NUMBER.fullmatch(text):
        return "number"
    if isinstance(text, Markup):
        return "composed"
    if name == "verdict" and text in VERDICTS:
        return f"verdict {text}"
    # columns of sentences are wide, single words and numbers stay on one line
    return "wide" if len(text) > _SENTENCE else "whole" if len(text) <= _WORD else ""


def _flatten(values: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    flat: dict[str, object] = {}
    for name, value in values.items():
        if isinstance(value, Mapping) and value and all(_is_number(week) for week in value):
            ends = [(week, value[week]) for week in sorted(value, key=float)]
            flat[f"{prefix}{name}"] = " to ".join(f"{_shown(at, 4)} at {week} GW" for week, at in (ends[0], ends[-1]))
        elif isinstance(value, Mapping):
            flat.update(_flatten(value, f"{prefix}{name}."))
        else:
            flat[f"{prefix}{name}"] = value
    return flat


def _is_number(name: object) -> bool:
    return str(name).replace(".", "", 1).isdigit()


def _shown(value: object, digits: int = 6) -> str:
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
            return ", ".join(_shown(item, digits) for item in value)
        case _:
            return str(value)
