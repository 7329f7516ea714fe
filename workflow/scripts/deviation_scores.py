"""Where each deviation of a real brain from what was expected of it stands among those of the other brains."""

import pandas as pd

from gyriflow.io.files import read_table, write_table
from gyriflow.metrics.norms import measured_scores
from gyriflow.settings.terms import MEASURED
from gyriflow.step import step

SCORES = ["expected", "sd", "z", "centile", "brains", "flag"]

with step(snakemake.log[0]):
    tables = []
    for _, table in read_table(snakemake.input[0]).dropna(subset=["value"]).groupby("run", sort=False):
        # deviations are metrics of real brains; other scans of a subject tell nothing of what is usual
        parts = table["hemisphere"] + " " + table["region"].fillna("")
        rows, subjects = table.assign(run=MEASURED, hemisphere=parts), list(table["subject"])
        scores = measured_scores(rows, subjects, individuals=snakemake.params.individuals)
        tables.append(table.reset_index(drop=True).join(scores[SCORES]))
    write_table(snakemake.output[0], pd.concat(tables, ignore_index=True))
