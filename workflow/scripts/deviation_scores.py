"""Where each deviation of an observed brain stands among those of the other brains."""

from gyriflow.compare.deviation import deviation_scores
from gyriflow.io.files import read_table, write_table
from gyriflow.step import step

with step(snakemake.log[0]):
    scores = deviation_scores(read_table(snakemake.input[0]), individuals=snakemake.params.individuals)
    write_table(snakemake.output[0], scores)
