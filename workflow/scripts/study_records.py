"""Write time, memory and warnings of all jobs, and the provenance of each brain, run,
study and report."""

from pathlib import Path

import pandas as pd

from gyriflow.io.downloads import sha256_of
from gyriflow.io.figures import write_html
from gyriflow.io.files import (
    files_in,
    fingerprints,
    read_json,
    read_table,
    read_text,
    write_json,
    write_table,
    write_text,
)
from gyriflow.io.yaml_files import read_yaml, write_yaml
from gyriflow.messages import reported_messages
from gyriflow.report.methods import methods_text
from gyriflow.report.tables import html_table, resources
from gyriflow.running.manifest import FOLDER, recorded_results
from gyriflow.running.provenance import recorded_inputs, software, texts_in
from gyriflow.settings.terms import run_names
from gyriflow.step import USAGE_COLUMNS, read_usage, step

files, output, params = snakemake.input, snakemake.output, snakemake.params
UNCOUNTED = ("study_records", "html_report")
"""Steps that have yet to end: what is read of them is of an earlier run."""
LEFT_OUT = ("logs", FOLDER, "provenance.json")
WARNING_COLUMNS = ["subject", "run", "step", "level", "message"]


def _write_provenance(path, configuration, inputs):
    """Write what the results in the folder of a file were made from."""
    folder = Path(path).parent
    results = fingerprints(files_in(folder, *LEFT_OUT), recorded_results(folder))
    record = {"configuration": configuration, "inputs": inputs, "results": results}
    write_json(path, used | record)


with step(snakemake.log[0]):
    names = dict(
        zip(
            map(tuple, params.folded),
            run_names(params.folded),
            strict=True,
        )
    )
    brains = {("", brain) for brain in params.known_brains}
    places = {("", ""), *brains, *params.simulated}
    jobs = []
    for job in read_usage(Path()):
        # other places are of an earlier configuration
        place = job["run"], job["brain"]
        if place in places and job["rule"] not in UNCOUNTED:
            # simulations are listed one by one, other jobs by rule
            job["run"] = names.get(place, "") if job["rule"] == "simulate" else ""
            jobs.append(job)
    table = resources(
        pd.DataFrame(
            jobs,
            columns=["rule", "run", *USAGE_COLUMNS],
        )
    )
    write_table(output.resources, table)
    write_html(output.resources_page, html_table(table))
    rows = [
        (
            message.brain,
            message.run,
            message.step,
            message.level,
            message.first_line,
        )
        for message in reported_messages(Path(), params.known_brains, params.folded)
    ]
    warnings = pd.DataFrame(rows, columns=WARNING_COLUMNS).drop_duplicates()
    write_table(output.warnings, warnings)

    used = software()
    known = recorded_inputs(Path())
    inputs = {
        brain["id"]: fingerprints(texts_in(brain), known) for brain in params.brains
    }
    for path, brain in zip(
        output.brains,
        params.brains,
        strict=True,
    ):
        _write_provenance(path, brain, inputs[brain["id"]])
    runs = []
    for number, (run, brain) in enumerate(params.folded):
        path = Path(output.runs[number])
        parameters = read_yaml(files.run_params[number])
        settings = {"run": run, "start": brain, "parameters": parameters}
        mesh = f"results/brains/{brain}/mesh/brain.h5"
        start = fingerprints(
            [mesh, path.parent / "folding" / "maps.h5"],
            {},
        )
        _write_provenance(path, settings, start | inputs[brain])
        summary = read_json(files.summaries[number])
        grown = {"growth_of": params.growth_of[number], "summary": summary}
        runs.append(settings | grown)
    hashed = [
        {"brain": brain, "what": what, "sha256": sha256_of(path)}
        for brain, what, path in params.files
    ]
    write_json(output.report, used | {"files": hashed})
    template = read_text(files.template)
    # normal atlases that brains were compared with
    atlases = read_yaml(files.atlases)["atlases"]
    compared = read_table(files.differences)["atlas"].unique()
    methods = methods_text(
        template,
        runs=runs,
        atlases={name: atlases[name]["reference"] for name in compared},
        software=used,
        **params.method,
    )
    write_text(output.methods, methods)
    write_yaml(output.config, params.config)
    _write_provenance(output.study, params.config, inputs)
