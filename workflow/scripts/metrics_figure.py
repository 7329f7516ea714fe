"""The chart of metrics over the weeks, and their table."""

from gyriflow.io.figures import write_figure, write_html
from gyriflow.io.files import read_table
from gyriflow.report.charts import metrics_chart
from gyriflow.report.style import run_names, runs_by_name
from gyriflow.report.tables import html_table, metrics_table
from gyriflow.step import step

output, params = snakemake.output, snakemake.params
with step(snakemake.log[0]):
    metrics = runs_by_name(read_table(snakemake.input[0]))
    shown = {"measured": params.measured, "synthetic": params.synthetic}
    figure = metrics_chart(metrics, runs=run_names(params.folded), **shown)
    write_figure(output.png, output.pdf, figure, dpi=params.dpi)
    table = metrics_table(metrics, measured=params.measured)
    write_html(output.table, html_table(table, caption="Metrics of whole brains", **shown))
