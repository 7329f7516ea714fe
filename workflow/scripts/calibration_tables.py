"""What a calibration has found: its runs, the optimum and how sure it is, sensitivities, lines of the surrogate."""

import pandas as pd

from gyriflow.compare.surrogate import fit, optimum, profiles, sensitivities
from gyriflow.io.files import read_table, write_table
from gyriflow.step import step

params, output = snakemake.params, snakemake.output
with step(snakemake.log[0]):
    runs = pd.concat(map(read_table, snakemake.input.scores), ignore_index=True)
    surrogate = fit(runs, params.bounds, params.seed)
    best = optimum(surrogate)
    write_table(output.runs, runs)
    write_table(output.optimum, best)
    write_table(output.sensitivities, sensitivities(surrogate))
    write_table(output.profiles, profiles(surrogate, best["value"].tolist()))
