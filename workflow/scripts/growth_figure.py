"""The chart of areas, volumes and growth rates."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.charts import growth_chart
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    figure = growth_chart(
        read_table(snakemake.input.areas),
        read_table(snakemake.input.rates),
        folding_rate_per_s=params.folding_rate_per_s,
        synthetic=params.synthetic,
    )
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
