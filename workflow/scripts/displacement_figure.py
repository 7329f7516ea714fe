"""The chart and the table of weekly displacement norms, beside the paper's values."""

from gyriflow.io.figures import write_figure, write_html
from gyriflow.io.files import read_table
from gyriflow.report.displacement import displacement_chart, displacement_summary
from gyriflow.report.style import run_names, runs_by_name
from gyriflow.report.tables import html_table
from gyriflow.step import step

output, params = snakemake.output, snakemake.params
with step(snakemake.log[0]):
    table = runs_by_name(read_table(snakemake.input[0]))
    figure = displacement_chart(table, runs=run_names(params.folded), synthetic=params.synthetic)
    write_figure(output.png, output.pdf, figure, dpi=params.dpi)
    caption = "Largest / mean norm of the displacement (mm)"
    write_html(output.table, html_table(displacement_summary(table), caption=caption, synthetic=params.synthetic))
