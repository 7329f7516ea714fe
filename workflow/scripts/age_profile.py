"""Which week of the reference brains each other brain looks like, and how well that is told of reference brains."""

from gyriflow.io.files import read_table, write_table
from gyriflow.metrics.age_profile import age_profile, age_profile_check, week_similarity
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    tables = read_table(files.metrics), read_table(files.spectra), params.reference
    followed = params.get("followed", {})
    check = age_profile_check(*tables)
    write_table(output.check, check)
    write_table(output.profile, age_profile(*tables, check, followed=followed))
    if output.get("similarity"):
        write_table(output.similarity, week_similarity(*tables, followed=followed))
