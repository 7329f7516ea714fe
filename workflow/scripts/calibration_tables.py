"""What a calibration has found: its runs, the optimum and how sure it is, sensitivities, lines of the surrogate."""

import pandas as pd

from gyriflow.compare.surrogate import fit, optimum, profiles, sensitivities
from gyriflow.io.figures import write_printed
from gyriflow.io.files import read_table, write_table
from gyriflow.step import step

params, output = snakemake.params, snakemake.output
with step(snakemake.log[0]):
    runs = pd.concat(map(read_table, snakemake.input.scores), ignore_index=True)
    surrogate = fit(runs, params.bounds, params.seed)
    best = optimum(surrogate)
    lines = profiles(surrogate, best["value"].tolist())
    for name, table, caption in (
        ("runs", runs, "Runs of the calibration; the lower the score, the nearer to the real brain."),
        ("optimum", best, "Least score of the surrogate, with 95 % of the minima of functions drawn from it."),
        ("sensitivities", sensitivities(surrogate), "Sobol' indices of the surrogate over the bounds."),
    ):
        write_printed({kind: output[f"{name}_{kind}"] for kind in ("csv", "md", "tex")}, table, caption)
    write_table(output.profiles, lines)
