"""The chart of the weeks in which sulci begin, in the real brains and in the runs."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.onset import onset_chart
from gyriflow.step import step

output, params = snakemake.output, snakemake.params
with step(snakemake.log[0]):
    figure = onset_chart(read_table(snakemake.input[0]), runs=params.runs)
    write_figure(output.png, output.pdf, figure, dpi=params.dpi)
