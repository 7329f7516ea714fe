"""The chart of the fold bands B4 to B6 over the weeks."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.spectra import spectra_weeks_chart
from gyriflow.report.style import runs_by_name
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    spectra = runs_by_name(read_table(snakemake.input[0]))
    figure = spectra_weeks_chart(spectra, measured=params.measured, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
