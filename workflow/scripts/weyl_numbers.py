"""How many modes each hemisphere needs by Weyl's law, of measured and simulated brains."""

import pandas as pd

from gyriflow.io.files import write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.mode_numbers import weyl_numbers
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    tables = []
    for labels, left, right in zip(params.labels, files.left, files.right, strict=True):
        table = weyl_numbers(read_surface(left), read_surface(right), params.formula)
        tables.append(table.assign(**labels)[[*labels, *table.columns]])
    write_table(snakemake.output[0], pd.concat(tables, ignore_index=True))
