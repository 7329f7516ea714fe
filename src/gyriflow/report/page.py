"""Content of the report: one self-contained HTML page for a study, and one for each
brain."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pandas as pd
from docutils.core import publish_parts
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from ..formats import ALL_SUFFIXES
from ..quantities import Shown, metrics_shown
from ..settings.growth import GROWTH_MODELS
from ..settings.terms import (
    ELEMENTS_NEEDED,
    LARGE_ELEMENT_ERROR,
    OBSERVED,
    SPREAD_UNKNOWN,
    element_error,
    is_too_coarse,
    rounded_elements,
    run_names,
)
from .labels import cited_atlas, plain, week_label
from .measures import (
    Tables,
    accuracy_sentence,
    brain_content,
    brain_rows,
    prediction_content,
)
from .tables import VERDICTS, html_table

PATH_PLACEHOLDER = "(file)"
_SUFFIXES = (*ALL_SUFFIXES, ".yaml", ".yml", ".h5", ".csv", ".tsv", ".sif")
_FILE_NAME = re.compile(
    rf"[/\\]|({'|'.join(map(re.escape, _SUFFIXES))})(\.gz)?$", re.IGNORECASE
)
KIND_NOTES = {"explained": ": its growth was measured on that brain"}
"""What the kind of a comparison means, where a reader may take it for a prediction."""
NOT_COMPARED = (
    "No simulation is compared: an observed brain of the same population and week is"
    " missing."
)
MAX_PENETRATION_MM = 0.5
"""Penetration of the contact planes at the start above which the report warns."""


def page_figures(
    figures: Sequence[Mapping[str, Any]],
    contents: Mapping[str, str | tuple[str, float]],
) -> list[dict[str, Any]]:
    """Return the figures and tables of a page: section, title, content (as `contents`),
    caption, first, technical.

    `figures` have name, section, title, caption in reStructuredText, technical, first,
    path and names of each; titles and captions contain the names in braces. The first
    one that may be `first` is shown in the summary. `contents` are by path HTML, or a
    picture's data URL and its width in inches.
    """
    brains: dict[str, set[str | None]] = {}
    for figure in figures:
        brains.setdefault(
            figure["name"],
            set(),
        ).add(figure["names"].get("brain"))
    first = [figure["path"] for figure in figures if figure["first"]][:1]
    entries = []
    for figure in figures:
        names, content = figure["names"], contents[figure["path"]]
        keys = ["run", "sweep"]
        # if all figures of a kind are of one brain, the page's title names it
        if len(brains[figure["name"]]) > 1:
            keys.append("brain")
        words = {key: plain(name.removesuffix("_mm")) for key, name in names.items()}
        parts = [figure["title"].format(**words)]
        parts += [name for key, name in names.items() if key in keys]
        entry = {
            "title": " · ".join(parts),
            "content": Markup(content) if isinstance(content, str) else content,
            "caption": caption_html(figure["caption"].format(**names)),
            "first": figure["path"] in first,
        }
        entries.append({**figure, **entry})
    return entries


def _sections(
    figures: Sequence[Mapping[str, Any]],
) -> list[tuple[str, list[dict[str, Any]]]]:
    """Return the sections, each with its figures and tables but the first one, numbered
    consecutively, technical ones last."""
    numbers = count(1)
    others = [figure for figure in figures if not figure["first"]]
    sections: dict[str, list[dict[str, Any]]] = {}
    for figure in others:
        sections.setdefault(
            figure["section"],
            [],
        ).append(dict(figure))
    for items in sections.values():
        items.sort(key=lambda item: item["technical"])
        for item in items:
            item["number"] = next(numbers)
    return list(sections.items())


def study_page(
    brains: Sequence[Mapping[str, Any]],
    tables: Tables,
    figures: Sequence[Mapping[str, Any]],
    *,
    norm: str,
    pictures: Mapping[str, tuple[str, float]],
    prediction: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the variables of the page's template for the report of a study.

    Brains are as for `brain_rows`, figures the output of `page_figures`; `norm` is the
    name of the norm's brains. `pictures` are data URL and width in inches of the small
    pictures of each brain that has a page, by its id. `prediction` is the output of
    `Study.prediction_facts`, with `accuracy`, the content of `norms/predictions.yaml`,
    and `tests`, the output of `compare.accuracy.prediction_facts`.
    """
    observed = tables.centiles[tables.centiles["run"] == OBSERVED]
    own = observed[observed["subject"].isin([brain["id"] for brain in brains])]
    summary = [figure for figure in figures if figure["first"]]
    atlases = tables.differences["atlas"].unique()
    page: dict[str, Any] = {
        "title": "Measured cortical folding",
        "verdict": _quality_verdict(tables.quality),
        "prediction": prediction,
        "folded": [],
        "runs": "",
        "atlases": list(map(cited_atlas, atlases)),
        "has_norm": bool(own["expected"].notna().any()),
        "brains": brain_rows(brains, replace(tables, centiles=observed), pictures),
        "pictures": pictures,
        "norm": norm,
        "flags": _centile_flags(own),
        "spread_unknown": SPREAD_UNKNOWN,
        "warnings": _group_warnings(tables.warnings),
        "summary_figure": summary[0] if summary else None,
        "sections": _sections(figures),
    }
    # of the page of a single brain
    page |= {
        "alone": False,
        "usual": "",
        "week_errors": [],
        "numbers": "",
        "has_parts": False,
        "has_thickness": False,
    }
    if tables.runs is not None:
        subjects = ", ".join(dict.fromkeys(tables.runs["subject"]))
        page["title"] = f"Simulated cortical folding of {subjects}"
        page["folded"] = tables.runs.to_dict("records")
        page["verdict"] = _simulation_verdict(tables, prediction)
        # without observed brains, a prediction has no scores
        if not prediction or tables.validation is not None:
            page["runs"] = html_table(_scores_table(tables.runs, tables.validation))
    if prediction:
        page["title"] = _prediction_title(prediction)
        page["prediction"] = prediction_content(prediction, tables, norm)
    return page


def _centile_flags(centiles: pd.DataFrame) -> set[str]:
    """Return the flags of the metrics in the table of brains."""
    is_shown = centiles["metric"].isin(metrics_shown(Shown.BRAINS))
    flags = set(centiles.loc[is_shown, "flag"])
    if SPREAD_UNKNOWN in flags:
        # an atlas has too few brains for centiles among themselves
        flags.discard("too few brains")
    return flags


def _simulation_verdict(
    tables: Tables,
    prediction: Mapping[str, Any] | None,
) -> str:
    """Return the verdict on simulations; on predictions that were compared, after how
    much better they are than simpler ones."""
    runs, validation = tables.runs, tables.validation
    assert runs is not None
    untested = accuracy_sentence(prediction) if prediction else NOT_COMPARED
    sentence = _verdict(runs, validation, tables.warnings, untested)
    if prediction and validation is not None and len(validation):
        # these verdicts are without the sentence of accuracy, which begins so
        sentence = f"{prediction['tests']['advantage']} {sentence}".lstrip()
    return sentence


def _prediction_title(prediction: Mapping[str, Any]) -> str:
    atlas = prediction["atlas"]
    source = f"the atlas {atlas['name']}" if atlas else prediction["population"]
    week = week_label(prediction["week"])
    return f"Prediction of {prediction['brain']} to {week}, by the growth of {source}"


def brain_page(
    brain: Mapping[str, Any],
    tables: Tables,
    figures: Sequence[Mapping[str, Any]],
    *,
    norm: str,
) -> dict[str, Any]:
    """Return the variables of the page's template for the page of an observed brain;
    parameters as for `study_page`."""
    # those of simulations are in the report of the study
    is_own = tables.warnings["subject"] == brain["id"]
    warnings = tables.warnings[is_own & tables.warnings["run"].isna()]
    page = study_page(
        [brain],
        replace(tables, warnings=warnings, runs=None),
        figures,
        norm=norm,
        pictures={},
    )
    title = f"Cortical folding of {brain['id']}"
    page |= {"title": title, "verdict": "", "alone": True}
    return page | brain_content(brain, tables)


def report_page(
    template: str,
    parts: Mapping[str, str],
    view: Mapping[str, Any],
    *,
    provenance: Mapping[str, Any],
    methods: str,
    configuration: str,
    **content: Any,
) -> str:
    """Return the page from its Jinja template; values are escaped.

    `parts` are the style sheet (`style`) and the scripts of the 3D view with their
    licence (`three`, `notice`, `controls`, `viewer`), inserted unescaped. `view` is the
    output of `surfaces_view`, `provenance` that of `software` with files (brain, what,
    sha256), `methods` reStructuredText, `configuration` text without paths, and
    `content` the output of `study_page` or `brain_page`.
    """
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # a script must not contain its own end tag
    data = json.dumps(view, separators=(",", ":")).replace(
        "</",
        "<\\/",
    )
    for name, text in parts.items():
        content[name] = Markup(text.replace("</script", "<\\/script"))
    return environment.from_string(template).render(
        **content,
        provenance=provenance,
        methods=caption_html(methods),
        configuration=configuration,
        has_view=bool(view["groups"]),
        surfaces=Markup(data),
    )


def caption_html(caption: str) -> Markup:
    """Return a caption in reStructuredText as HTML."""
    settings = {
        "report_level": 5,
        "raw_enabled": False,
        "file_insertion_enabled": False,
    }
    parts = publish_parts(caption, writer="html5", settings_overrides=settings)
    return Markup(parts["body"])


def _scores_table(
    runs: pd.DataFrame,
    validation: pd.DataFrame | None,
) -> pd.DataFrame:
    """Return a row for each run: how it ended, and its scores at the last week with an
    observed brain.

    `runs` has the columns run, subject, start_week, end_week, weeks, growth.model,
    min_J, elements_through_cortex, order, least_elements_through_cortex,
    unresolved_from_week, initial_penetration_mm; `validation` is the study's table.
    """
    names = run_names(
        zip(
            runs["run"],
            runs["subject"],
            strict=True,
        )
    )
    rows = []
    for name, (_, run) in zip(
        names,
        runs.iterrows(),
        strict=True,
    ):
        scores: Mapping[Any, Any] = {}
        if validation is not None:
            is_own_run = validation["run"] == run["run"]
            own = validation[is_own_run & (validation["start"] == run["subject"])]
            scores = own.sort_values("week").iloc[-1] if len(own) else {}
        rows.append(
            {
                "run": name,
                "verdict": _run_verdict(run),
                **_scores(scores),
            }
        )
    return pd.DataFrame(rows)


def _quality_verdict(quality: pd.DataFrame) -> str:
    """Return a sentence with the number of brains by verdict of quality control."""
    counts = quality["verdict"].value_counts()
    parts = []
    for verdict in VERDICTS:
        if count := counts.get(verdict, 0):
            words = verdict.replace("needs", "need") if count > 1 else verdict
            parts.append(f"{count} {words}")
    plural = "s" if len(quality) > 1 else ""
    return f"{len(quality)} brain{plural}: {', '.join(parts)}."


def _verdict(
    runs: pd.DataFrame,
    validation: pd.DataFrame | None,
    warnings: pd.DataFrame,
    sentence: str,
) -> str:
    """Return a sentence that compares the best run at the last week with the scaled
    start, and the most serious message: an error, or else a limitation of a run. Plain
    warnings are counted.

    `runs` and `validation` are as for `_scores_table`, `warnings` has the columns level
    and message. The `sentence` is used if there is no observed brain.
    """
    if validation is not None and len(validation):
        last = validation[validation["week"] == validation["week"].max()]
        best = last.sort_values("r_shape_index", ascending=False).iloc[0]
        sentence = (
            f"At {week_label(best['week'])}, run {best['run']} agrees best with the"
            f" observed brain ({best['kind']}{KIND_NOTES.get(best['kind'], '')}): shape"
            f" index r {best['r_shape_index']:.2f} (scaled start:"
            f" {best['r_start_shape_index']:.2f}), distance"
            f" {best['distance_mm']:.2f} mm."
        ).replace("-", "−")
    serious = list(warnings.loc[warnings["level"] == "error", "message"])
    for _, run in runs.iterrows():
        # which may be another run than the best one
        serious += [f"run {run['run']}: {doubt}" for doubt in _run_doubts(run)]
    texts = serious or list(warnings["message"].unique())
    if not texts:
        return f"{sentence} There were no warnings."
    if serious or len(texts) == 1:
        return f"{sentence} Worst warning: {texts[0].rstrip('.')}."
    return f"{sentence} There were {len(texts)} warnings, listed under Brains."


def _run_verdict(run: Mapping[str, Any] | pd.Series) -> str:
    """Return how a run ended, and the limitations of its folds."""
    # the table has the list as JSON
    reached = max(json.loads(run["weeks"]))
    end = float(run["end_week"])
    if reached >= end:
        ending = f"reached {week_label(reached)}"
    else:
        ending = f"ended at {week_label(reached)} of {end:g}"
    return "; ".join([ending, *_run_doubts(run)])


def _run_doubts(run: Mapping[str, Any] | pd.Series) -> list[str]:
    """Return the limitations of a run's folds."""
    words = []
    if run["min_J"] <= 0:
        words.append("elements inverted")
    order = int(run["order"])
    has_layers = GROWTH_MODELS[run["growth.model"]].has_layers
    if has_layers:
        words += _coarseness(run, order)
    if run.get("initial_penetration_mm", 0.0) > MAX_PENETRATION_MM:
        words.append(
            f"walls of the fissure start {run['initial_penetration_mm']:.2g} mm beyond"
            " their planes"
        )
    if has_layers and run["elements_through_cortex"] > 0:
        error, text = element_error(order, run["elements_through_cortex"])
        words += [text] if error > LARGE_ELEMENT_ERROR else []
    return words


def _coarseness(
    run: Mapping[str, Any] | pd.Series,
    order: int,
) -> list[str]:
    """Return a text if the elements of a run were too large for its cortex, at the
    start or later; else nothing."""
    elements, week = run["elements_through_cortex"], run["unresolved_from_week"]
    needed = f"{ELEMENTS_NEEDED[order]:g} needed): folds may be artefacts"
    if is_too_coarse(order, elements):
        return [
            f"cortex not resolved ({rounded_elements(elements):g} elements through it,"
            f" {needed}"
        ]
    if pd.notna(week):
        least = rounded_elements(run["least_elements_through_cortex"])
        down = f"down to {least:g} elements through it, {needed} from then on"
        return [f"cortex not resolved from {week_label(round(week, 2))} on ({down}"]
    return []


def _scores(validation: Mapping[Any, Any]) -> dict[str, str]:
    """Return the scores as text, dashes for missing ones."""
    observed = "none"
    if len(validation):
        observed = f"{week_label(validation['week'])}, {validation['kind']}"
    return {
        "observed brain": observed,
        "distance (mm)": _score(validation, "distance_mm", ".2f"),
        "r": _score_with_interval(validation, "r", ".2f"),
        "r of the scaled start": _score(validation, "r_start_shape_index", ".2f"),
        "gain": _score_with_interval(validation, "gain", "+.2f"),
        "area (%)": _score(validation, "area_difference", "+.1f", 100),
        "volume (%)": _score(validation, "volume_difference", "+.1f", 100),
    }


def _score(
    validation: Mapping[Any, Any],
    name: str,
    pattern: str,
    factor: float = 1.0,
) -> str:
    value = validation.get(name, np.nan)
    if pd.isna(value):
        return "–"
    return format(factor * value, pattern).replace("-", "−")


def _score_with_interval(
    validation: Mapping[Any, Any],
    name: str,
    pattern: str,
) -> str:
    if not len(validation):
        return "–"
    score, low, high = (
        _score(validation, f"{name}_{part}shape_index", pattern)
        for part in ("", "low_", "high_")
    )
    return f"{score} ({low} to {high})"


def _group_warnings(warnings: pd.DataFrame) -> str:
    """Return a table of each distinct warning, with its brains and runs; "" without
    warnings."""
    if warnings.empty:
        return ""
    # steps of a brain have no run
    named = warnings[["subject", "run"]].astype(object).fillna("").astype(str)
    rows = warnings.copy()
    rows["brain, run"] = named.agg(
        ", ".join,
        axis=1,
    ).str.strip(", ")
    is_error = rows["level"] != "warning"
    prefix = (rows["level"] + ": ").where(is_error, "")
    rows["message"] = prefix + rows["message"]
    groups = rows.groupby(["step", "message"], sort=False)["brain, run"]
    joined = groups.agg(
        lambda places: "; ".join(
            filter(
                None,
                places.unique(),
            )
        )
    )
    return html_table(joined.reset_index())


def hide_paths(value: Any) -> Any:
    """Return a configuration, plain dictionaries and lists, without the paths in it.

    File names may contain a patient's name.
    """
    match value:
        case dict():
            return {key: hide_paths(item) for key, item in value.items()}
        case list() | tuple():
            return [hide_paths(item) for item in value]
        case str() if _FILE_NAME.search(value):
            return PATH_PLACEHOLDER
        case _:
            return value
