"""The chart of the fold bands B4 to B6 over the weeks."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.spectra import spectra_weeks_chart
from gyriflow.report.style import run_names, runs_by_name
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    spectra = runs_by_name(read_table(snakemake.input[0]))
    shown = {"measured": params.measured, "synthetic": params.synthetic}
    figure = spectra_weeks_chart(spectra, runs=run_names(params.folded), **shown)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
