"""The report: one HTML page with all that it shows inside, and what stands where in it."""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import count
from typing import Any

import numpy as np
import pandas as pd
from docutils.core import publish_parts
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from ..formats import ALL_SUFFIXES
from ..settings.growth import GROWTH_MODELS
from ..settings.terms import ELEMENTS_NEEDED, MEASURED, SPREAD_UNKNOWN, run_names
from .labels import metric_title, plain, week_label
from .tables import brain_table, html_table, predicted_table, span, standing, worth_table

PATH_PLACEHOLDER = "(file)"
_SUFFIXES = (*ALL_SUFFIXES, ".yaml", ".yml", ".h5", ".csv", ".tsv", ".sif")
_FILE_NAME = re.compile(rf"[/\\]|({'|'.join(map(re.escape, _SUFFIXES))})(\.gz)?$", re.IGNORECASE)
_FOLDERS = re.compile(r"(?<![\w.:/])/(?:[^/\n;:]*/)+")
"""Folders before the name of a file: they may hold names of people, and are nobody else's matter."""
DOTS_PER_INCH = 150
"""Of the page, for an inch of print: a figure as wide as a journal's page has 1080."""
FIRST = ("predicted_figure", "weekly_figure")
"""The kinds of which the first figure stands on the first page."""
OF_BRAINS = ("volume", "area", "gyrification_index", "mean_sulcal_depth", "mean_thickness")
"""The metrics in the row of a brain."""
NORM_WORDS = {
    "ok": "Below each number: its centile (and z) for this age among the norm's other subjects.",
    SPREAD_UNKNOWN: "Below each number: its difference from the curve of the norm ({norm}). The norm has one average "
    "brain a week, so the spread of individuals around the curve is unknown and there are no centiles.",
    "too few brains": "There are too few subjects for centiles: a curve over the weeks needs six others.",
}
"""What is said of numbers by how brains stand among the norm."""
NOT_COMPARED = "There is no real brain of the same population and week to compare a simulation with."
DEEP_MM = 0.5
"""Walls of the fissure that begin so far beyond their planes are told of."""


def shown_figures(
    figures: Sequence[Mapping[str, Any]], contents: Mapping[str, str | tuple[str, float]]
) -> list[dict[str, Any]]:
    """Return the figures and tables as the page shows them: section, title, content, caption, first, technical.

    Parameters
    ----------
    figures : name, section, title, caption in reStructuredText, technical, path and names of each
        In titles and captions its names stand in braces.
    contents : {path: HTML, or a picture's data address and its width in inches}
    """
    brains: dict[str, set[str | None]] = {}
    for figure in figures:
        brains.setdefault(figure["name"], set()).add(figure["names"].get("brain"))
    first = next((figure["path"] for name in FIRST for figure in figures if figure["name"] == name), None)
    shown = []
    for figure in figures:
        names, content = figure["names"], contents[figure["path"]]
        # the page's title names a brain that all figures of a kind are of
        keys = ("run", "study", "brain") if len(brains[figure["name"]]) > 1 else ("run", "study")
        title = figure["title"].format(**{key: plain(name.removesuffix("_mm")) for key, name in names.items()})
        title = " · ".join([title, *(name for key, name in names.items() if key in keys)])
        shown.append(
            {
                "section": figure["section"],
                "title": title,
                "content": Markup(content) if isinstance(content, str) else picture(*content, title),
                "caption": caption_html(figure["caption"].format(**names)),
                "first": figure["path"] == first,
                "technical": figure["technical"],
            }
        )
    return shown


def sections(shown: Sequence[Mapping[str, Any]]) -> list[tuple[str, list[dict[str, Any]]]]:
    """Return the sections in the order of what is shown, each with its figures and tables, numbered through.

    Technical ones stand at the end of their section.
    """
    ordered, numbers = sorted(shown, key=lambda item: item["technical"]), count(1)
    return [
        (name, [{**item, "number": next(numbers)} for item in ordered if item["section"] == name])
        for name in dict.fromkeys(item["section"] for item in shown)
    ]


@dataclass(frozen=True, eq=False)
class Tables:
    """The tables of a study that its pages show.

    Attributes
    ----------
    quality, metrics, centiles : as for `brains_table`
    warnings : columns subject, run, step, level, message
    runs, validation : as for `scores_table`; no runs where brains were measured only
    """

    quality: pd.DataFrame
    metrics: pd.DataFrame
    centiles: pd.DataFrame
    warnings: pd.DataFrame
    runs: pd.DataFrame | None = None
    validation: pd.DataFrame | None = None

    def __post_init__(self) -> None:
        # messages name files without their folders
        for name in ("quality", "warnings"):
            object.__setattr__(self, name, getattr(self, name).replace(_FOLDERS, "", regex=True))


@dataclass(frozen=True)
class Origin:
    """Where the results of a study come from.

    Attributes
    ----------
    provenance : what `software` returns, and files (brain, what, sha256)
    methods : reStructuredText
    configuration : text, without paths
    """

    provenance: Mapping[str, Any]
    methods: str
    configuration: str


def study_page(
    brains: Sequence[Mapping[str, Any]],
    tables: Tables,
    origin: Origin,
    shown: Sequence[Mapping[str, Any]],
    *,
    norm: str,
    pictures: Mapping[str, tuple[str, float]],
    prediction: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return what the page's template names for the report of a study.

    Parameters
    ----------
    brains, pictures : as for `brains_table`
    shown : what `shown_figures` returns
    norm : what the brains of the norm are called
    prediction : what `Study.prediction_facts` returns, and worth, of `norms/predictions.yaml`
    """
    runs, validation = tables.runs, tables.validation
    title, sentence, scores = "Measured cortical folding", measured_verdict(tables.quality), ""
    if runs is not None:
        title = f"Simulated cortical folding of {', '.join(dict.fromkeys(runs['subject']))}"
        sentence = verdict(runs, validation, tables.warnings, worth_told(prediction) if prediction else NOT_COMPARED)
        # a prediction alone is compared with nothing
        scores = "" if prediction and validation is None else html_table(scores_table(runs, validation))
    if prediction:
        title = f"Prediction of {prediction['brain']} to {week_label(prediction['week'])}, by the growth of "
        title += f"the atlas {atlas['name']}" if (atlas := prediction["atlas"]) else prediction["population"]
        numbers, known = predicted_table(tables.metrics, prediction), worth_table(prediction["worth"])
        prediction = {**prediction, "numbers": html_table(numbers), "known": html_table(known)}
    return _shared(brains, tables, origin, shown, norm, pictures) | {
        "title": title,
        "verdict": sentence,
        "prediction": prediction,
        "folded": [] if runs is None else runs.to_dict("records"),
        "alone": False,
        "numbers": "",
        "runs": scores,
    }


def brain_page(
    brain: Mapping[str, Any], tables: Tables, origin: Origin, shown: Sequence[Mapping[str, Any]], *, norm: str
) -> dict[str, Any]:
    """Return what the page's template names for the page of a measured brain; parameters are as for `study_page`."""
    own = tables.metrics["subject"] == brain["id"]
    warnings = tables.warnings[tables.warnings["subject"] == brain["id"]]
    return _shared([brain], replace(tables, warnings=warnings), origin, shown, norm, {}) | {
        "title": f"Measured cortical folding, {brain['id']}",
        "verdict": "",
        "prediction": None,
        "folded": [],
        "alone": True,
        "numbers": html_table(brain_table(tables.metrics[own], tables.centiles)),
        "runs": "",
    }


def _shared(
    brains: Sequence[Mapping[str, Any]],
    tables: Tables,
    origin: Origin,
    shown: Sequence[Mapping[str, Any]],
    norm: str,
    pictures: Mapping[str, tuple[str, float]],
) -> dict[str, Any]:
    """Return what the pages of a study and of a brain both have: rows of brains, warnings, sections, provenance."""
    ids, centiles, provenance = [brain["id"] for brain in brains], tables.centiles, origin.provenance
    own = centiles[centiles["subject"].isin(ids) & centiles["metric"].isin(OF_BRAINS) & (centiles["run"] == MEASURED)]
    flags = set(own["flag"])
    # the brains of an atlas are too few for norms of each other
    flags -= {"too few brains"} if SPREAD_UNKNOWN in flags else set()
    files = [file for file in provenance["files"] if file["brain"] in ids]
    software = {"gyriflow": provenance["gyriflow"], "Python": provenance["python"], **provenance["packages"]}
    versions = [(name, version) for name, version in software.items() if version]
    return {
        "given": brains,
        "brains": html_table(brains_table(brains, tables.quality, tables.metrics, centiles, pictures)),
        "norm": [words.format(norm=norm) for flag, words in NORM_WORDS.items() if flag in flags],
        "warnings": "" if tables.warnings.empty else html_table(grouped(tables.warnings)),
        "weeks": next((item for item in shown if item["first"]), None),
        "sections": sections([item for item in shown if not item["first"]]),
        "made": made(provenance),
        "methods": caption_html(origin.methods),
        "files": html_table(pd.DataFrame(files).rename(columns={"sha256": "SHA-256"})),
        "versions": html_table(pd.DataFrame(versions, columns=["package", "version"])),
        "configuration": origin.configuration,
    }


def report_page(template: str, parts: Mapping[str, str], view: Mapping[str, Any], **content: Any) -> str:
    """Return the page.

    Parameters
    ----------
    template : Jinja template of the page, which escapes what is put in
    parts : style, three, notice, controls, viewer
        The style sheet and the scripts of the 3D view with their licence, put into the page as they are.
    view : what `view_data` returns
    content : what else the template names; HTML as `Markup`
    """
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    # within a script, nothing may look like its end
    data = Markup(json.dumps(view, separators=(",", ":")).replace("</", "<\\/"))
    inside = {name: Markup(text.replace("</script", "<\\/script")) for name, text in parts.items()}
    page = environment.from_string(template)
    return page.render(**content, **inside, has_view=bool(view["groups"]), surfaces=data)


def methods_text(template: str, **used: Any) -> str:
    """Return the methods of a study as reStructuredText, with citations: a template filled with what was run.

    The template gets `growth_sentence(run, number)`, the sentence of the run's growth model; `number` formats numbers.
    """

    def growth_sentence(run: Mapping[str, Any], number: Callable[[Any], str]) -> str:
        return GROWTH_MODELS[run["parameters"]["growth"]["model"]].sentence(run, number)

    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True)
    return environment.from_string(template).render(growth_sentence=growth_sentence, **used)


def picture(address: str, inches: float, alt: str) -> Markup:
    """Return an image of the page from its data address and its width in print, so that all have letters of a size."""
    width = round(inches * DOTS_PER_INCH)
    return Markup('<img src="{}" alt="{}" width="{}" loading="lazy">').format(address, alt, width)


def caption_html(caption: str) -> Markup:
    """Return a caption in reStructuredText as HTML."""
    settings = {"report_level": 5, "raw_enabled": False, "file_insertion_enabled": False}
    return Markup(publish_parts(caption, writer="html5", settings_overrides=settings)["body"])


def brains_table(
    brains: Sequence[Mapping[str, Any]],
    quality: pd.DataFrame,
    metrics: pd.DataFrame,
    centiles: pd.DataFrame,
    pictures: Mapping[str, tuple[str, float]],
) -> pd.DataFrame:
    """Return a row for each brain: its pictures, what it is with a link to its page, numbers, verdict and warnings.

    Parameters
    ----------
    brains : id, week, population, source, licence, covariates and whether it is synthetic, as configured
    quality : columns subject, verdict, cause, warnings
        The table of quality control.
    metrics, centiles : the study's; below a number stands what `standing` returns
    pictures : data address and width in inches of the pictures of each brain that has a page, by its id
    """
    judged = quality.set_index("subject")
    causes = judged["cause"].fillna("").where(judged["cause"].fillna("") != "", judged["warnings"].fillna(""))
    whole, scored = (
        table[(table["run"] == MEASURED) & (table["hemisphere"] == "whole") & table["metric"].isin(OF_BRAINS)]
        for table in (metrics, centiles)
    )
    scored = scored[["subject", "metric"]].assign(stands=standing(scored))
    whole = whole.dropna(subset=["value"]).merge(scored, "left").fillna({"stands": ""})
    cells = {(row.subject, row.metric): _above(f"{row.value:.4g}", row.stands, "whole") for row in whole.itertuples()}
    heads = {name: metric_title(name) for name in whole["metric"]}
    rows = []
    for brain in brains:
        key = brain["id"]
        row: dict[str, Any] = {"": picture(*pictures[key], key)} if key in pictures else {"": ""} if pictures else {}
        row["brain"] = _described(brain, linked=key in pictures)
        row |= {head: cells.get((key, name), "–") for name, head in heads.items()}
        verdict = Markup('<span class="verdict {0}">{0}</span>').format(judged.loc[key, "verdict"])
        rows.append(row | {"verdict": _above(verdict, causes[key])})
    return pd.DataFrame(rows)


def _described(brain: Mapping[str, Any], *, linked: bool) -> Markup:
    """Return a brain's name, as a link to its page, above its age, population, covariates, source and licence."""
    name = Markup('<a href="brains/{0}.html">{0}</a>' if linked else "{}").format(brain["id"])
    population = brain["population"] or ("synthetic" if brain["synthetic"] else "")
    licence = brain["licence"] or ("made here" if brain["synthetic"] else "" if linked else "your own data")
    covariates = [f"{key}: {value}" for key, value in brain["covariates"].items()]
    source = "" if linked else brain["source"]
    said = filter(None, [week_label(brain["week"]), population, *covariates, source, licence])
    return _above(name, "; ".join(said))


def _above(text: str, below: object, kind: str = "") -> Markup:
    return Markup('{}<br><span class="pale {}">{}</span>').format(text, kind, below)


def scores_table(runs: pd.DataFrame, validation: pd.DataFrame | None = None) -> pd.DataFrame:
    """Return a row for each run: how it ended, and its scores at the last week that a real brain was compared at.

    Parameters
    ----------
    runs : columns run, subject, start_week, end_week, weeks, min_J, elements_through_cortex,
        order, least_elements_through_cortex, unresolved_from_week, initial_penetration_mm
    validation : the study's table of validation
    """
    names = run_names(zip(runs["run"], runs["subject"], strict=True))
    rows = []
    for name, (_, run) in zip(names, runs.iterrows(), strict=True):
        scores: Mapping[Any, Any] = {}
        if validation is not None:
            compared = validation[(validation["run"] == run["run"]) & (validation["start_week"] == run["start_week"])]
            scores = compared.sort_values("week").iloc[-1] if len(compared) else {}
        rows.append({"run": name, "verdict": run_verdict(run), **_scores(scores)})
    return pd.DataFrame(rows)


def worth_told(prediction: Mapping[str, Any]) -> str:
    """Return in words what predictions as far ahead were worth on brains whose later scan was known."""
    rows, ahead = pd.DataFrame(prediction["worth"]["rows"]), prediction["week"] - prediction["start_week"]
    # the next that was tried, or the farthest
    horizon = min((tried for tried in rows["horizon"] if tried >= ahead - 1e-6), default=rows["horizon"].max())
    ways = rows[rows["horizon"] == horizon].groupby("model")
    run, atlas, scaled = (
        f"{span(of['distance_mm'])} mm (r {span(of['r_shape_index'])})"
        for of in map(ways.get_group, ("run", "atlas", "scaled"))
    )
    beyond = f" No test went as far as {ahead:.3g} weeks." if ahead > horizon + 1e-6 else ""
    return (
        f"This is a prediction, not a scan. In tests over {horizon:g} weeks, the mean distance from the real brain and "
        f"the correlation of shape index with it were {run} for predictions, {atlas} for the atlas' own brain and "
        f"{scaled} for the scaled start.{beyond} The test brains were averages of many normal fetuses; the accuracy "
        "for a single fetus is unknown."
    )


def measured_verdict(quality: pd.DataFrame) -> str:
    """Return in a sentence how many brains have which verdict of quality control."""
    counts = quality["verdict"].value_counts()
    words = {"fine": "fine", "look": "to look at", "refused": "refused"}
    brains = f"{len(quality)} brain{'s' if len(quality) > 1 else ''}"
    return f"{brains}: {', '.join(f'{counts[name]} {word}' for name, word in words.items() if name in counts)}."


def verdict(
    runs: pd.DataFrame, validation: pd.DataFrame | None, warnings: pd.DataFrame, sentence: str = NOT_COMPARED
) -> str:
    """Return in a sentence how the run nearest to its last real brain compares with no folding, and the worst warning.

    Parameters
    ----------
    runs, validation : as for `scores_table`
    warnings : columns level and message
    sentence : what is said where there is no real brain
    """
    if validation is not None and len(validation):
        last = validation[validation["week"] == validation["week"].max()]
        best = last.sort_values("r_shape_index", ascending=False).iloc[0]
        sentence = (
            f"At {week_label(best['week'])}, run {best['run']} agrees best with the real brain ({best['kind']}): shape "
            f"index r {best['r_shape_index']:.2f}, against {best['r_start_shape_index']:.2f} for the scaled start, at "
            f"a mean distance of {best['distance_mm']:.2f} mm."
        ).replace("-", "−")
    doubts = [text for _, run in runs.iterrows() for text in run_verdict(run).split("; ")[1:]]
    worst = [*warnings.loc[warnings["level"] == "error", "message"], *doubts, *warnings["message"]]
    return f"{sentence} {f'Worst warning: {worst[0].rstrip(".")}.' if worst else 'There were no warnings.'}"


def run_verdict(run: Mapping[str, Any] | pd.Series) -> str:
    """Return how a run ended, and what is to be known before its folds are believed."""
    weeks = [float(week) for week in str(run["weeks"]).strip("[]").split(",")]
    reached, end = max(weeks), float(run["end_week"])
    words = [f"reached {week_label(reached)}" if reached >= end else f"ended at {week_label(reached)} of {end:g}"]
    if run["min_J"] <= 0:
        words.append("elements inverted")
    if too_coarse := _resolution(run):
        words.append(too_coarse)
    if run.get("initial_penetration_mm", 0.0) > DEEP_MM:
        words.append(f"walls of the fissure begin {run['initial_penetration_mm']:.2g} mm beyond their planes")
    return "; ".join(words)


def _resolution(run: Mapping[str, Any] | pd.Series) -> str:
    """Return what is to be said of a run whose mesh is too coarse, at the start or later; empty where it is not."""
    needed = ELEMENTS_NEEDED[int(run["order"])]
    at_start, week = run["elements_through_cortex"], run["unresolved_from_week"]
    if not at_start >= needed:  # not a number: no element lies in the cortex
        return f"cortex not resolved ({at_start:.3g} elements through it, {needed:g} needed): folds may be artefacts"
    if pd.isna(week):
        return ""
    return (
        f"cortex not resolved from {week_label(round(week, 2))} on "
        f"(down to {run['least_elements_through_cortex']:.3g} elements through it, {needed:g} needed): "
        "folds may be artefacts from then on"
    )


def _scores(validation: Mapping[Any, Any]) -> dict[str, str]:
    """Return the scores as text, dashes for what was not compared."""

    def shown(name: str, pattern: str, factor: float = 1.0) -> str:
        value = validation.get(name, np.nan)
        return "–" if pd.isna(value) else format(factor * value, pattern).replace("-", "−")

    interval = f"{shown('gain_low_shape_index', '+.2f')} to {shown('gain_high_shape_index', '+.2f')}"
    return {
        "real brain": f"{week_label(validation['week'])}, {validation['kind']}" if len(validation) else "none",
        "distance (mm)": shown("distance_mm", ".2f"),
        "r": shown("r_shape_index", ".2f"),
        "r of the scaled start": shown("r_start_shape_index", ".2f"),
        "gain": shown("gain_shape_index", "+.2f"),
        "95 % interval": "–" if interval == "– to –" else interval,
        "area (%)": shown("area_difference", "+.1f", 100),
        "volume (%)": shown("volume_difference", "+.1f", 100),
    }


def grouped(warnings: pd.DataFrame) -> pd.DataFrame:
    """Return warnings that say the same once, with the brains and runs that they are of."""
    # of a brain's step there is no run
    named = warnings[["subject", "run"]].astype(object).fillna("").astype(str)
    places = [", ".join(filter(None, place)) for place in named.itertuples(index=False)]
    prefix = warnings["level"].map(lambda level: "" if level == "warning" else f"{level}: ")
    rows = warnings.assign(message=prefix + warnings["message"])
    rows["brain, run"] = places
    groups = rows.groupby(["step", "message"], sort=False)["brain, run"]
    return groups.agg(lambda names: "; ".join(filter(None, dict.fromkeys(names)))).reset_index()


def made(provenance: Mapping[str, Any]) -> str:
    """Return when and by which code the results were made."""
    commit = provenance["commit"]
    of = "not from a checkout of the source, so without a commit"
    if commit:
        of = f"commit {commit.removesuffix('-dirty')}{', changed' if commit.endswith('-dirty') else ''}"
    time = datetime.fromisoformat(provenance["recorded"]).strftime("%Y-%m-%d %H:%M UTC")
    return f"Made {time} by gyriflow {provenance['gyriflow']}, {of}."


def hide_paths(value: Any) -> Any:
    """Return a configuration, plain dictionaries and lists, without the paths in it.

    A file's name may hold a patient's.
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
