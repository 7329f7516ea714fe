"""How far the spectra of all brains are from those of the measured ones."""

from gyriflow.io.files import read_table, write_table
from gyriflow.metrics.spangy import spectral_distances
from gyriflow.step import step

with step(snakemake.log[0]):
    write_table(snakemake.output[0], spectral_distances(read_table(snakemake.input[0])))
