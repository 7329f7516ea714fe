"""Tables of one kind below each other."""

import pandas as pd

from gyriflow.io.files import read_table, write_table
from gyriflow.step import step

with step(snakemake.log[0]):
    write_table(snakemake.output[0], pd.concat([read_table(path) for path in snakemake.input], ignore_index=True))
