"""The chart of how near the runs are to the real brains, week by week."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.scores import scores_chart
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    shown = {"measured": params.measured, "synthetic": params.synthetic}
    table = read_table(snakemake.input[0])
    figure = scores_chart(table, runs=list(dict.fromkeys(run for run, _ in params.folded)), **shown)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
