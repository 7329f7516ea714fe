"""All metrics of a study in two tables, a row per number and a row per brain, and change between scans of a subject."""

from gyriflow.io.files import read_table, write_table
from gyriflow.metrics.tables import change_between_scans, long_table, wide_table
from gyriflow.step import step

output = snakemake.output
with step(snakemake.log[0]):
    table = long_table([read_table(path) for path in snakemake.input])
    write_table(output.long, table)
    write_table(output.wide, wide_table(table, snakemake.params.covariates))
    write_table(output.change, change_between_scans(table, snakemake.params.scans))
