"""What the runs of a study are worth by start week and by horizon."""

import pandas as pd

from gyriflow.compare.validation import horizon_table
from gyriflow.io.files import read_table, write_table
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    moves = read_table(files.displacement) if files.displacement else pd.DataFrame()
    write_table(
        snakemake.output[0], horizon_table(read_table(files.validation), moves, params.models, params.known_until_gw)
    )
