"""The chart of time and energy."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.cost import cost_chart
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    figure = cost_chart(read_table(snakemake.input[0]))
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
