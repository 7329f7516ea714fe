"""The chart of what runs are worth by how long after their start."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.horizon import horizon_chart
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    ceiling = read_table(files.ceiling) if files.ceiling else None
    figure = horizon_chart(read_table(files.horizon), ceiling, runs=params.runs)
    write_figure(output.png, output.pdf, figure, dpi=params.dpi)
