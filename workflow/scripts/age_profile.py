"""Apparent ages of all brains from the reference brains, and the error of this estimate on the reference brains."""

from gyriflow.io.files import read_table, write_table
from gyriflow.metrics.age_profile import age_profile, age_profile_check
from gyriflow.step import step

files, output, reference = snakemake.input, snakemake.output, snakemake.params.reference
with step(snakemake.log[0]):
    tables = read_table(files.metrics), read_table(files.spectra)
    write_table(output.profile, age_profile(*tables, reference))
    write_table(output.check, age_profile_check(*tables, reference))
