"""The chart of areas, volumes and growth rates, and tables of the rates and of how far series agree."""

from gyriflow.growth.rates import FOLDING_RATES, rate_curve
from gyriflow.io.figures import write_figure, write_html
from gyriflow.io.files import read_table
from gyriflow.report.growth import growth_chart
from gyriflow.report.style import all_synthetic
from gyriflow.report.tables import agreement_table, growth_table, html_table, sizes_table
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    areas, rates, agreement = (read_table(file) for file in (files.areas, files.rates, files.agreement))
    shown = {"measured": params.measured, "synthetic": all_synthetic(params.measured)}
    rate = params.folding_rate_per_s
    if rate == "estimated":
        chosen = rates[rates["series"] == params.estimated_from]
        rate = dict(zip(*rate_curve(chosen, FOLDING_RATES["growth_rate_per_s"], allow_negative=True), strict=True))
    figure = growth_chart(areas, rates, agreement, folding_rate_per_s=rate, **shown)
    write_figure(output.png, output.pdf, figure, dpi=params.dpi)
    tables = {"Areas and volumes": sizes_table(areas), "Growth rates": growth_table(rates)}
    if len(agreement):
        tables["Agreement of the growth rates"] = agreement_table(agreement)
    write_html(output.table, "\n".join(html_table(table, caption=name, **shown) for name, table in tables.items()))
