"""The chart of areas, volumes and growth rates, and the table of the rates."""

from gyriflow.growth.rates import FOLDING_RATES, rate_curve
from gyriflow.io.figures import write_figure, write_html
from gyriflow.io.files import read_table
from gyriflow.report.charts import growth_chart
from gyriflow.report.style import REAL_BRAIN
from gyriflow.report.tables import growth_table, html_table
from gyriflow.step import step

output, params = snakemake.output, snakemake.params
with step(snakemake.log[0]):
    areas, rates = read_table(snakemake.input.areas), read_table(snakemake.input.rates)
    shown = {"measured": params.measured, "synthetic": REAL_BRAIN not in params.measured}
    rate = params.folding_rate_per_s
    if rate == "estimated":
        rate = dict(zip(*rate_curve(rates, FOLDING_RATES["growth_rate_per_s"], allow_negative=True), strict=True))
    figure = growth_chart(areas, rates, folding_rate_per_s=rate, **shown)
    write_figure(output.png, output.pdf, figure, dpi=params.dpi)
    write_html(output.table, html_table(growth_table(rates), caption="Growth rates", **shown))
