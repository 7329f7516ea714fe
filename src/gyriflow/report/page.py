"""The report: one HTML page with all that it shows inside, and what stands where in it."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
import pandas as pd
from docutils.core import publish_parts
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from ..parameters.terms import run_names
from .labels import plain, week_label
from .solve import resolution_verdict
from .tables import html_table

FILE, COMMAND = "(file)", "(command)"
_FILE_NAME = re.compile(r"[/\\]|\.(nii|gii|mgz|mgh|stl|ply|obj|vtk|yaml|yml|h5|csv|sif)(\.gz)?$", re.IGNORECASE)
DOTS_PER_INCH = 150
"""Of the page, for an inch of print: a figure as wide as a journal's page has 1080."""
FIRST = "weekly_figure"
"""The rule whose first figure stands on the first page."""
DEEP_MM = 0.5
"""Walls of the fissure that begin so far beyond their planes are told of."""


@dataclass(frozen=True)
class Shown:
    """A figure or table of the report.

    Attributes
    ----------
    section, title : where it stands, and its heading
    content : HTML
    caption : reStructuredText
    first : whether it stands on the first page instead
    technical : whether it is folded away
    """

    section: str
    title: str
    content: str
    caption: str = ""
    first: bool = False
    technical: bool = False


@dataclass(frozen=True, eq=False)
class Results:
    """What the report tells of a study besides its figures and tables.

    Attributes
    ----------
    brains, surfaces, quality : as for `brains_table`
    runs, validation : as for `scores_table`
    provenance : what `software` returns, and files (brain, what, sha256, and path where it may be shown)
    methods : reStructuredText
    warnings : columns subject, run, step, level, message
    configuration : text, without paths unless they may be shown
    """

    brains: Sequence[Mapping[str, Any]]
    surfaces: Mapping[str, Mapping[str, Any]]
    runs: pd.DataFrame
    provenance: Mapping[str, Any]
    methods: str
    configuration: str
    validation: pd.DataFrame | None = None
    quality: pd.DataFrame | None = None
    warnings: pd.DataFrame | None = None


def shown_figures(
    words: Mapping[str, Mapping[str, Any]],
    figures: Sequence[tuple[str, str, Mapping[str, str]]],
    contents: Mapping[str, str | tuple[str, float]],
) -> list[Shown]:
    """Return the figures and tables that the report has words on; simulated beside measured brains stand first.

    Parameters
    ----------
    words : {name of a rule: section, title, caption and technical}
        In titles and captions the names of figures stand in braces.
    figures
        Rule, path and names of each figure.
    contents : {path: HTML, or a picture's data address and its width in inches}
    """
    starts = {rule: {names.get("brain") for other, _, names in figures if other == rule} for rule, _, _ in figures}
    first = next((path for rule, path, _ in figures if rule == FIRST), None)
    shown = []
    for rule, path, names in figures:
        if rule not in words:
            continue
        # the page's title names a brain that all figures of a kind are of
        keys = ("run", "study", "brain") if len(starts[rule]) > 1 else ("run", "study")
        title = words[rule]["title"].format(**{key: plain(name.removesuffix("_mm")) for key, name in names.items()})
        title = " · ".join([title, *(name for key, name in names.items() if key in keys)])
        content = contents[path]
        shown.append(
            Shown(
                section=words[rule]["section"],
                title=title,
                content=content if isinstance(content, str) else picture(*content, title),
                caption=words[rule]["caption"].format(**names),
                first=path == first,
                technical=words[rule].get("technical", False),
            )
        )
    return shown


def assemble(results: Results, shown: Sequence[Shown], view: Mapping[str, Any]) -> dict[str, Any]:
    """Returns what the page's template names: the first page, the sections, and where all comes from."""
    first = next((item for item in shown if item.first), None)
    weeks = {"content": Markup(first.content), "caption": caption_html(first.caption)} if first else None
    starts = ", ".join(dict.fromkeys(results.runs["subject"]))
    provenance = results.provenance
    return {
        "title": f"Simulated cortical folding of {starts}",
        "done": what_was_done(results.brains, results.runs),
        "brains": html_table(brains_table(results.brains, results.surfaces, results.quality)),
        "runs": html_table(scores_table(results.runs, results.validation)),
        "warnings": "" if results.warnings is None or results.warnings.empty else html_table(grouped(results.warnings)),
        "weeks": weeks,
        "has_view": bool(view["groups"]),
        "sections": sections([item for item in shown if not item.first]),
        "made": made(provenance),
        "methods": caption_html(results.methods),
        "files": html_table(input_files(provenance["files"])),
        "versions": html_table(versions(provenance)),
        "configuration": results.configuration,
    }


def methods_text(template: str, **used: Any) -> str:
    """Returns the methods of a study as reStructuredText, with citations: a template filled with what was run."""
    return Environment(undefined=StrictUndefined, keep_trailing_newline=True).from_string(template).render(**used)


def picture(address: str, inches: float, alt: str) -> str:
    """Returns an image of the page from its data address and its width in print, so that all have letters of a size."""
    width = round(inches * DOTS_PER_INCH)
    return Markup('<img src="{}" alt="{}" width="{}" loading="lazy">').format(address, alt, width)


def caption_html(caption: str) -> Markup:
    """Returns a caption as HTML."""
    settings = {"report_level": 5, "raw_enabled": False, "file_insertion_enabled": False}
    return Markup(publish_parts(caption, writer="html5", settings_overrides=settings)["body"])


def sections(shown: Sequence[Shown]) -> list[tuple[str, list[dict[str, Any]]]]:
    """Returns the sections in the order of what is shown, each with its figures and tables, numbered through.

    Technical ones stand at the end of their section.
    """
    found: dict[str, list[dict[str, Any]]] = {item.section: [] for item in shown}
    for item in shown:
        found[item.section].append(
            {
                "title": item.title,
                "content": Markup(item.content),
                "caption": caption_html(item.caption),
                "technical": item.technical,
            }
        )
    for items in found.values():
        items.sort(key=lambda item: item["technical"])
    every = [item for items in found.values() for item in items]
    for number, entry in enumerate(every, start=1):
        entry["number"] = number
    return list(found.items())


def report_page(template: str, parts: Mapping[str, str], view: Mapping[str, Any], **content: Any) -> str:
    """Returns the page.

    Parameters
    ----------
    template
        Jinja template of the page, which escapes what is put in.
    parts : style, three, notice, controls, viewer
        The style sheet and the scripts of the 3D view with their licence, put into the page as they are.
    view
        What `view_data` returns.
    content
        What else the template names; HTML as `Markup`.
    """
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    # within a script, nothing may look like its end
    data = Markup(json.dumps(view, separators=(",", ":")).replace("</", "<\\/"))
    inside = {name: Markup(text.replace("</script", "<\\/script")) for name, text in parts.items()}
    return environment.from_string(template).render(**content, **inside, surfaces=data)


def brains_table(
    brains: Sequence[Mapping[str, Any]],
    surfaces: Mapping[str, Mapping[str, Any]],
    quality: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """Returns a row for each brain: source, population, licence, age, size, verdict and warnings.

    Parameters
    ----------
    brains
        id, week, population, source and licence of each, as the configuration has them.
    surfaces : {id: content of its surface.json}
        Brains without one were refused.
    quality : columns subject, verdict, cause, warnings
        The table of quality control, where there is one.
    """
    judged = {} if quality is None else quality.fillna("").set_index("subject").to_dict("index")
    rows = []
    for brain in brains:
        name = str(brain["id"])
        surface, own = surfaces.get(name), judged.get(name, {})
        warnings = [str(text) for text in (surface or {}).get("warnings", [])]
        said = str(own.get("cause") or own.get("warnings") or "; ".join(warnings))
        verdict = own.get("verdict") or ("refused" if surface is None else "look" if warnings else "fine")
        rows.append(
            {
                "brain": name,
                "age": week_label(brain["week"]),
                "source": brain["source"],
                "population": brain["population"] or ("synthetic" if brain["synthetic"] else "not stated"),
                "licence": brain["licence"] or ("made here" if brain["synthetic"] else "your own data"),
                "volume (mL)": np.nan if surface is None else surface["volume_mL"],
                "pial area (cm²)": np.nan if surface is None else surface["area_cm2"]["whole"],
                "verdict": verdict,
                "warnings": said or "none",
            }
        )
    return pd.DataFrame(rows)


def scores_table(runs: pd.DataFrame, validation: pd.DataFrame | None = None) -> pd.DataFrame:
    """Returns a row for each run: how it ended, and its scores at the last week that a real brain was compared at.

    Parameters
    ----------
    runs : columns run, subject, start_week, end_week, weeks, min_J, elements_through_cortex,
        order, least_elements_through_cortex, unresolved_from_week, initial_penetration_mm
    validation : the study's table of validation
    """
    names = run_names(zip(runs["run"], runs["subject"], strict=True))
    rows = []
    for name, (_, run) in zip(names, runs.iterrows(), strict=True):
        row = {"run": name, "verdict": run_verdict(run)}
        rows.append(row | _scores(_last(validation, run["run"], run["start_week"])))
    return pd.DataFrame(rows)


def run_verdict(run: Mapping[str, Any] | pd.Series) -> str:
    """Returns how a run ended, and what is to be known before its folds are believed."""
    weeks = [float(week) for week in str(run["weeks"]).strip("[]").split(",")]
    reached, end = max(weeks), float(run["end_week"])
    said = [f"reached {week_label(reached)}" if reached >= end - 1e-6 else f"ended at {week_label(reached)} of {end:g}"]
    if run["min_J"] <= 0:
        said.append("elements inverted")
    if too_coarse := resolution_verdict(run):
        said.append(too_coarse)
    if run.get("initial_penetration_mm", 0.0) > DEEP_MM:
        said.append(f"walls of the fissure begin {run['initial_penetration_mm']:.2g} mm beyond their planes")
    return "; ".join(said)


def _last(table: pd.DataFrame | None, run: str, start_week: float) -> Mapping[str, Any]:
    """Returns the row of a run's last week, nothing where there is none."""
    if table is None:
        return {}
    own = table[(table["run"] == run) & (table["start_week"] == start_week)].sort_values("week")
    return {} if own.empty else {str(name): value for name, value in own.iloc[-1].items()}


def _scores(validation: Mapping[str, Any]) -> dict[str, str]:
    """Returns the scores as text, dashes for what was not compared."""

    def shown(name: str, pattern: str, factor: float = 1.0) -> str:
        value = validation.get(name, np.nan)
        return "–" if pd.isna(value) else (pattern % (factor * value)).replace("-", "−")

    interval = f"{shown('gain_low_shape_index', '%+.2f')} to {shown('gain_high_shape_index', '%+.2f')}"
    return {
        "real brain": f"{week_label(validation['week'])}, {validation['kind']}" if validation else "none",
        "distance (mm)": shown("distance_mm", "%.2f"),
        "r": shown("r_shape_index", "%.2f"),
        "r of the scaled start": shown("r_start_shape_index", "%.2f"),
        "gain": shown("gain_shape_index", "%+.2f"),
        "95 % interval": "–" if interval == "– to –" else interval,
        "area (%)": shown("area_difference", "%+.1f", 100),
        "volume (%)": shown("volume_difference", "%+.1f", 100),
    }


def grouped(warnings: pd.DataFrame) -> pd.DataFrame:
    """Returns warnings that say the same once, with the brains and runs that they are of."""
    # of a brain's step there is no run
    named = warnings[["subject", "run"]].fillna("").astype(str)
    places = [", ".join(filter(None, place)) for place in named.itertuples(index=False)]
    of_level = warnings["level"], warnings["message"]
    said = [text if level == "warning" else f"{level}: {text}" for level, text in zip(*of_level, strict=True)]
    rows = warnings.assign(**{"brain, run": places, "message": said}).groupby(["step", "message"], sort=False)[
        "brain, run"
    ]
    return rows.agg(lambda names: "; ".join(filter(None, dict.fromkeys(names)))).reset_index()


def what_was_done(brains: Sequence[Mapping[str, Any]], runs: pd.DataFrame) -> str:
    """Returns in a few sentences what the study is: its brains, what was folded, and to which age."""
    weeks = sorted({float(brain["week"]) for brain in brains})
    populations = sorted({str(brain["population"]) for brain in brains if brain["population"]})
    synthetic = sum(bool(brain["synthetic"]) for brain in brains)
    span = week_label(weeks[0]) if len(weeks) == 1 else f"{weeks[0]:g} to {week_label(weeks[-1])}"
    of = f" ({'; '.join(populations)})" if populations else ""
    said = [f"{len(brains)} brain{'s' * (len(brains) > 1)} of {span}{of} went in."]
    if synthetic:
        said.append(f"{synthetic} of them {'is' if synthetic == 1 else 'are'} synthetic, not of a fetus.")
    starts = list(dict.fromkeys(runs["subject"]))
    ends = sorted({float(week) for week in runs["end_week"]})
    upto = week_label(ends[0]) if len(ends) == 1 else f"{ends[0]:g} to {week_label(ends[-1])}"
    said.append(
        f"{', '.join(starts)} {'was' if len(starts) == 1 else 'were'} filled with tetrahedra and grown to {upto} in "
        f"{len(runs)} simulation{'s' * (len(runs) > 1)} of cortical folding by differential tangential growth."
    )
    said.append(
        "Simulated and measured brains were measured by the same code with the same settings, and compared where their "
        "weeks and population agree."
    )
    return " ".join(said)


def made(provenance: Mapping[str, Any]) -> str:
    """Returns when and by which code the results were made."""
    commit = provenance["commit"]
    of = "not from a checkout of the source, so without a commit"
    if commit:
        of = f"commit {commit.removesuffix('-dirty')}{', changed' if commit.endswith('-dirty') else ''}"
    time = datetime.fromisoformat(provenance["recorded"]).strftime("%Y-%m-%d %H:%M UTC")
    return f"Made {time} by gyriflow {provenance['gyriflow']}, {of}."


def versions(provenance: Mapping[str, Any]) -> pd.DataFrame:
    """Returns a row for each package that was there, gyriflow and Python first."""
    found = {"gyriflow": provenance["gyriflow"], "Python": provenance["python"]} | provenance["packages"]
    return pd.DataFrame([(name, number) for name, number in found.items() if number], columns=["package", "version"])


def input_files(files: Sequence[Mapping[str, str]]) -> pd.DataFrame:
    """Returns a row for each input file with its SHA-256, by which it is known without its name."""
    columns = {"brain": "brain", "what": "what", "sha256": "SHA-256", "path": "path"}
    table = pd.DataFrame(files).rename(columns=columns)
    return table[[name for name in columns.values() if name in table]]


def hide_paths(value: Any) -> Any:
    """Returns a configuration, plain dictionaries and lists, without the paths and commands in it.

    A file's name may hold a patient's.
    """
    match value:
        case dict():
            return {key: COMMAND if key == "command" and item else hide_paths(item) for key, item in value.items()}
        case list() | tuple():
            return [hide_paths(item) for item in value]
        case str() if _FILE_NAME.search(value):
            return FILE
        case _:
            return value
