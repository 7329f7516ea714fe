"""The chart of norms over the weeks with the brains compared with them, and the table of centiles."""

from gyriflow.io.figures import write_figure, write_html
from gyriflow.io.files import read_table
from gyriflow.metrics.norms import same_sides
from gyriflow.report.norms import centiles_table, norms_chart
from gyriflow.report.style import run_names, runs_by_name
from gyriflow.report.tables import html_table
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
shown = {"measured": params.measured, "synthetic": params.synthetic}
with step(snakemake.log[0]):
    metrics = read_table(files.metrics)
    metrics = runs_by_name(metrics[same_sides(metrics, params.reference)])
    tables = read_table(files.curves), read_table(files.norms)
    figure = norms_chart(metrics, *tables, params.reference, runs=run_names(params.folded), **shown)
    write_figure(output.png, output.pdf, figure, dpi=params.dpi)
    table = centiles_table(runs_by_name(read_table(files.centiles)))
    write_html(output.table, html_table(table, caption="Centiles (z) among the measured brains", **shown))
