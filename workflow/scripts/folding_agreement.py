"""How much the simulated brains of a study are folded beside the real ones of their week."""

from gyriflow.compare.validation import folding_agreement
from gyriflow.io.files import read_table, write_table
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0]):
    table = folding_agreement(read_table(files.metrics), read_table(files.spectra), snakemake.params.pairs)
    write_table(snakemake.output[0], table)
