"""How many modes each measured hemisphere needs by Weyl's law."""

import pandas as pd

from gyriflow.io.files import write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.mode_numbers import weyl_numbers
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    tables = []
    for brain, left, right in zip(params.brains, files.left, files.right, strict=True):
        tables.append(weyl_numbers(read_surface(left), read_surface(right), params.formula))
        tables[-1].insert(0, "subject", brain)
    write_table(snakemake.output[0], pd.concat(tables, ignore_index=True))
