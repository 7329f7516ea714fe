"""Parameters and summaries of all runs, a row each."""

import pandas as pd

from gyriflow.io.files import read_json, write_table
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0]):
    rows = [
        {"run": run, **read_yaml(params), **read_json(summary)}
        for run, params, summary in zip(snakemake.params.runs, files.params, files.summaries, strict=True)
    ]
    write_table(snakemake.output[0], pd.json_normalize(rows))
