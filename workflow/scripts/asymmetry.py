"""Asymmetry between left and right, of hemispheres and of regions."""

import pandas as pd

from gyriflow.io.files import read_table, write_table
from gyriflow.metrics.tables import asymmetry
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0]):
    tables = [read_table(files.metrics).assign(region="")]
    tables += [read_table(path) for path in files.get("regions", [])]
    parts = [asymmetry(table.fillna({"region": ""})) for table in tables]
    write_table(snakemake.output[0], pd.concat(parts, ignore_index=True))
