"""Write the table of verdicts: every brain of the study with its checks, refused brains
with their cause."""

from gyriflow.io.files import read_json, write_table
from gyriflow.report.tables import quality_table
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    table = quality_table(
        [read_json(file) for file in snakemake.input], params.left_out, params.order
    )
    write_table(snakemake.output[0], table)
