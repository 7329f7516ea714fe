"""The chart of a run's solver steps."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.charts import steps_chart
from gyriflow.step import step

with step(snakemake.log[0]):
    params = snakemake.params
    figure = steps_chart(read_table(snakemake.input[0]), order=params.order, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
