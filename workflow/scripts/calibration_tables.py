"""What a calibration has found: its runs, and the optimum."""

import pandas as pd

from gyriflow.compare.calibration import fit, optimum
from gyriflow.io.files import read_table, write_table
from gyriflow.step import step

params, output = snakemake.params, snakemake.output
with step(snakemake.log[0]):
    runs = pd.concat(map(read_table, snakemake.input.scores), ignore_index=True)
    write_table(output.runs, runs)
    write_table(output.optimum, optimum(fit(runs, params.bounds, params.seed)))
