"""The chart of all bands at one week."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.spectra import spectra_chart
from gyriflow.report.style import run_names, runs_by_name
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    figure = spectra_chart(
        runs_by_name(read_table(snakemake.input[0])),
        week=params.week,
        bands=range(1, 7),
        runs=run_names(params.folded),
        measured=params.measured,
        synthetic=params.synthetic,
    )
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
