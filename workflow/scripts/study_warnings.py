"""The warnings of all steps of the study."""

from gyriflow.io.files import write_table
from gyriflow.io.jobs import gather_messages
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    write_table(snakemake.output[0], gather_messages(".", params.brains, params.folded))
