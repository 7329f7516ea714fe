"""Apparent ages of all brains from the reference brains, and the error of this estimate on the reference brains."""

from gyriflow.io.files import read_table, write_table
from gyriflow.metrics.age_profile import age_profile, age_profile_check, week_similarity
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    tables = read_table(files.metrics), read_table(files.spectra), params.reference
    check = age_profile_check(*tables)
    write_table(output.check, check)
    write_table(output.profile, age_profile(*tables, check, followed=params.followed))
    write_table(output.similarity, week_similarity(*tables, followed=params.followed))
