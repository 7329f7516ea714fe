"""Write time, memory and warnings of all jobs, and the provenance of each brain, run,
study and report."""

from pathlib import Path

from gyriflow.io.downloads import sha256_of
from gyriflow.io.figures import write_html
from gyriflow.io.files import (
    files_in,
    fingerprints,
    read_json,
    read_text,
    write_json,
    write_table,
    write_text,
)
from gyriflow.io.yaml_files import read_yaml, write_yaml
from gyriflow.report.page import methods_text
from gyriflow.report.tables import html_table, resources
from gyriflow.running.jobs import gather_messages, read_usage
from gyriflow.running.manifest import FOLDER, recorded_results
from gyriflow.running.provenance import recorded_inputs, software, texts_in
from gyriflow.settings.terms import run_names
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
LEFT_OUT = ("logs", FOLDER, "provenance.json")


def _results_in(folder):
    """Return the fingerprints of the results in a folder."""
    return fingerprints(files_in(folder, *LEFT_OUT), recorded_results(folder))


with step(snakemake.log[0]):
    names = dict(zip(map(tuple, params.folded), run_names(params.folded), strict=True))
    jobs = read_usage(".", params.messages)
    # simulations are listed one by one, other jobs by rule
    jobs["run"] = [
        names.get((run, brain)) if rule == "simulate" else None
        for rule, run, brain in zip(
            jobs["rule"], jobs["run"], jobs["brain"], strict=True
        )
    ]
    table = resources(jobs)
    write_table(output.resources, table)
    write_html(output.resources_page, html_table(table))
    write_table(
        output.warnings, gather_messages(".", params.known_brains, params.folded)
    )

    used = software()
    known = recorded_inputs(Path())
    inputs = {
        brain["id"]: fingerprints(texts_in(brain), known) for brain in params.brains
    }
    for path, brain in zip(output.brains, params.brains, strict=True):
        record = {
            "configuration": brain,
            "inputs": inputs[brain["id"]],
            "results": _results_in(Path(path).parent),
        }
        write_json(path, used | record)
    runs = []
    for path, (run, brain), growth_of, parameters, summary in zip(
        output.runs,
        params.folded,
        params.growth_of,
        files.run_params,
        files.summaries,
        strict=True,
    ):
        folder = Path(path).parent
        settings = {"run": run, "start": brain, "parameters": read_yaml(parameters)}
        start = fingerprints(
            [f"results/brains/{brain}/mesh/brain.h5", folder / "folding" / "maps.h5"],
            {},
        )
        record = {
            "configuration": settings,
            "inputs": start | inputs[brain],
            "results": _results_in(folder),
        }
        write_json(path, used | record)
        runs.append(settings | {"growth_of": growth_of, "summary": read_json(summary)})
    hashed = [
        {"brain": brain, "what": what, "sha256": sha256_of(path)}
        for brain, what, path in params.files
    ]
    write_json(output.report, used | {"files": hashed})
    write_text(
        output.methods,
        methods_text(
            read_text(files.template), runs=runs, software=used, **params.method
        ),
    )
    write_yaml(output.config, params.config)
    record = {
        "configuration": params.config,
        "inputs": inputs,
        "results": _results_in(Path(output.study).parent),
    }
    write_json(output.study, used | record)
