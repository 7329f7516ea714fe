"""The chart of the age profile and of its check."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.ages import age_profile_chart
from gyriflow.report.style import runs_by_name
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    tables = (
        runs_by_name(read_table(files.profile)),
        read_table(files.check),
        runs_by_name(read_table(files.similarity)),
    )
    figure = age_profile_chart(*tables, measured=params.measured, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
