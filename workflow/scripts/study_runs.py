"""Parameters, zones and summaries of all runs: a row each, and as a table for the report."""

import pandas as pd

from gyriflow.io.figures import write_html
from gyriflow.io.files import read_json, write_table
from gyriflow.io.yaml_files import read_yaml
from gyriflow.report.tables import html_table, runs_table
from gyriflow.step import step

BEFORE_THE_SOLVE = ("clamped_share", "initial_penetration_mm", "elements_through_cortex")

files, runs = snakemake.input, {}
with step(snakemake.log[0]):
    for run, params, summary, zones in zip(
        snakemake.params.runs, files.params, files.summaries, files.zones, strict=True
    ):
        report = read_json(zones)
        runs[run] = {**read_yaml(params), **read_json(summary), **{name: report[name] for name in BEFORE_THE_SOLVE}}
    write_table(snakemake.output.csv, pd.json_normalize([{"run": run, **values} for run, values in runs.items()]))
    write_html(snakemake.output.table, html_table(runs_table(runs), caption="Parameters and summaries of the runs"))
