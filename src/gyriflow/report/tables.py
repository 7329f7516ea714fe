"""Tables of a study, and any table as HTML."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment
from markupsafe import Markup

from ..settings.terms import (
    element_error,
    is_too_coarse,
)
from .labels import (
    SIMPLER_PREDICTIONS,
    parameter_label,
    plain,
)

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


def runs_table(parameters: Mapping[str, Mapping[str, object]]) -> pd.DataFrame:
    """Return the parameters of the runs with their units: a row per parameter, a column
    per run.

    `parameters` are by run and name. Those that differ between the runs come first,
    then `COMMON_PARAMETERS`. Nested names are joined by dots. A curve over weeks is
    shown by its first and last values.
    """
    columns = {}
    for run, values in parameters.items():
        columns[run] = pd.Series(_flatten(values), dtype=object)
    texts = pd.DataFrame(columns).map(_text)
    # absent, zero and no count as equal
    is_off = texts.isin(
        [
            "–",
            "0",
            "no",
        ]
    ).all(axis=1)
    differs = (
        texts.ne(
            texts.iloc[:, 0],
            axis=0,
        ).any(axis=1)
        & ~is_off
    )
    names = list(texts.index[differs])
    names += [name for name in COMMON_PARAMETERS if not differs.get(name, True)]
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
    totals = dict.fromkeys(("jobs", "hours", "core_hours"), "sum")
    totals["memory_MiB"] = "max"
    stages = each.groupby(
        ["rule", "run"],
        sort=False,
        as_index=False,
    ).agg(totals)
    stages = stages.rename(columns={"rule": "stage"})
    stages = stages.sort_values("core_hours", ascending=False, kind="stable")
    whole = pd.DataFrame(
        [
            {
                "stage": "all",
                "run": "",
                **stages.agg(totals),
            }
        ]
    )
    return pd.concat(
        [stages, whole],
        ignore_index=True,
    ).astype({"jobs": int})


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


def quality_table(
    rows: Sequence[Mapping[str, Any]],
    left_out: Sequence[Mapping[str, Any]],
    order: Sequence[str],
) -> pd.DataFrame:
    """Return the rows of all brains, outputs of `quality_row`, in an order of their
    ids, others last.

    `left_out` are columns and cause of the brains without a surface.
    """
    refused = [
        {
            **row,
            "verdict": "refused",
            "warning_count": 0,
        }
        for row in left_out
    ]
    table = pd.DataFrame([*rows, *refused]).set_index(
        "subject",
        drop=False,
    )
    ids = [name for name in order if name in table.index]
    ids += [name for name in table.index if name not in ids]
    return table.loc[ids, [*table.columns.drop("page"), "page"]].reset_index(drop=True)


def html_table(table: pd.DataFrame) -> Markup:
    """Return the table as HTML.

    Text is escaped, numbers have four significant digits and are aligned right, missing
    values are dashes. The index is shown if it has a name.
    """
    named = any(name is not None for name in table.index.names)
    flat = table.reset_index() if named else table
    texts = flat.map(lambda value: _text(value, 4))
    rows = []
    values = flat.to_numpy(dtype=object)
    for row, words in zip(
        values,
        texts.to_numpy(),
        strict=True,
    ):
        cells = zip(flat, row, words, strict=True)
        rows.append([(_kind(*cell), cell[-1]) for cell in cells])
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
    is_number = isinstance(value, int | float | np.number)
    if (
        is_number
        and not isinstance(
            value,
            bool,
        )
    ) or NUMBER.fullmatch(text):
        return "number"
    if isinstance(text, Markup):
        return "composed"
    if name == "verdict" and text in VERDICTS:
        return f"verdict {text}"
    # sentences get wide columns; single words and numbers stay on one line
    return "wide" if len(text) > _SENTENCE else "whole" if len(text) <= _WORD else ""


def _flatten(
    values: Mapping[str, object],
    prefix: str = "",
) -> dict[str, object]:
    flat: dict[str, object] = {}
    for name, value in values.items():
        key = f"{prefix}{name}"
        if not isinstance(value, Mapping):
            flat[key] = value
        elif value and all(
            str(week)
            .replace(
                ".",
                "",
                1,
            )
            .isdigit()
            for week in value
        ):
            ends = min(value, key=float), max(value, key=float)
            texts = [f"{_text(value[week], 4)} at {week} GW" for week in ends]
            flat[key] = " to ".join(texts)
        else:
            flat |= _flatten(value, f"{key}.")
    return flat


def _text(value: object, digits: int = 6) -> str:
    match value:
        case bool() | np.bool_():
            return "yes" if value else "no"
        case float() | np.floating():
            number, _, power = f"{value:.{digits}g}".partition("e")
            raised = f"·10{str(int(power)).translate(_RAISED)}" if power else ""
            return (
                "–"
                if np.isnan(value)
                else number.replace(
                    "-",
                    "−",
                )
                + raised
            )
        case None:
            return "–"
        case Markup():
            return value
        case list() | tuple():
            return ", ".join(_text(item, digits) for item in value)
        case _:
            return str(value)
