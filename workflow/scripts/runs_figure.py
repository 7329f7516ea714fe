"""The runs side by side at the last week that all have, with the measured brain of that week."""

from gyriflow.io.figures import write_figure
from gyriflow.io.surfaces import read_surface
from gyriflow.report.renders import runs_comparison
from gyriflow.report.style import run_names
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    figure = runs_comparison(
        dict(zip(run_names(params.folded), map(read_surface, files.runs), strict=True)),
        read_surface(files.real[0]) if files.real else None,
        measured=params.measured,
        synthetic=params.synthetic,
    )
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
