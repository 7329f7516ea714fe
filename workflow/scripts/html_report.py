"""Write the report of a study and the pages of its brains, each a single HTML file."""

import re
from pathlib import Path

import yaml

from gyriflow.compare.accuracy import prediction_facts
from gyriflow.io.figures import picture_addresses, read_body
from gyriflow.io.files import read_json, read_table, read_text, write_json, write_text
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.io.yaml_files import read_yaml
from gyriflow.report.measures import Tables
from gyriflow.report.page import (
    brain_page,
    hide_paths,
    page_figures,
    report_page,
    study_page,
)
from gyriflow.report.view3d import surfaces_view
from gyriflow.step import step

PICTURE_BYTES = 9_000_000
PARTS = ("style", "three", "notice", "controls", "viewer")
TABLES = (
    "quality",
    "metrics",
    "centiles",
    "curves",
    "differences",
    "warnings",
    "runs",
    "validation",
    "intervals",
)
files, output, params = snakemake.input, snakemake.output, snakemake.params


def _read_caption(path):
    """Return title and caption of a figure; the title is underlined."""
    title, _, caption = read_text(path).split("\n", 2)
    if not files.runs:
        # without the paragraphs on simulated brains
        caption = re.sub(r"(?s)(^|\n\n)Simulated brains: .*?(?=\n\n|$)", "", caption)
    return {"title": title, "caption": caption.strip()}


CAPTIONS = {Path(path).stem: _read_caption(path) for path in files.captions}


def _with_content(figures):
    """Return the figures and tables of a page with their title, caption and content."""
    figures = [figure | CAPTIONS[figure["name"]] for figure in figures]
    paths = [figure["path"] for figure in figures]
    pictures = [path for path in paths if path.endswith(".png")]
    contents = dict(
        zip(pictures, picture_addresses(pictures, PICTURE_BYTES), strict=True)
    )
    return page_figures(
        figures, {path: contents.get(path) or read_body(path) for path in paths}
    )


def _read_weeks(weeks):
    """Return the hemispheres of a brain with their maps by week."""
    return [
        (week, [(read_surface(mesh), read_vertex_maps(maps)) for mesh, maps in halves])
        for week, halves in weeks
    ]


with step(snakemake.log[0]):
    template = read_text(files.page)
    parts = {name: read_text(files[name]) for name in PARTS}
    tables = Tables(**{name: read_table(files[name]) for name in TABLES if files[name]})
    origin = {
        "provenance": read_json(files.provenance),
        "methods": read_text(files.methods),
    }
    origin["configuration"] = yaml.safe_dump(
        hide_paths(params.config), sort_keys=False, allow_unicode=True
    )
    brains = {brain["id"]: brain for brain in params.brains}
    for path, (name, figures) in zip(
        output.brains, params.brain_figures.items(), strict=True
    ):
        page = brain_page(
            brains[name], tables, _with_content(figures), norm=params.norm
        )
        write_text(
            path,
            report_page(
                template,
                parts,
                {"groups": []},
                **origin,
                **page,
            ),
        )
    small = dict(
        zip(
            params.brain_figures,
            picture_addresses(files.small, PICTURE_BYTES),
            strict=True,
        )
    )
    prediction = params.prediction
    if prediction:
        accuracy = read_yaml(files.accuracy)
        tests = prediction_facts(
            accuracy["rows"], prediction["start_week"], prediction["week"]
        )
        kept = read_weekly_shapes(files.targets).kept
        prediction = prediction | {"accuracy": accuracy, "tests": tests, "kept": kept}
    about = {"norm": params.norm, "pictures": small, "prediction": prediction}
    page = study_page(
        params.brains,
        tables,
        _with_content(params.figures),
        **about,
    )
    surfaces = params.surfaces
    runs = {run: _read_weeks(weeks) for run, weeks in surfaces["runs"].items()}
    observed = _read_weeks(surfaces["observed"])
    view = surfaces_view(runs, observed, observed_name=params.observed_name)
    write_json(output.view, view)
    write_text(
        output.report,
        report_page(template, parts, view, **origin, **page),
    )
