"""The chart of metrics over the weeks."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.charts import metrics_chart
from gyriflow.step import step

with step(snakemake.log[0]):
    figure = metrics_chart(read_table(snakemake.input[0]), synthetic=snakemake.params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=snakemake.params.dpi)
