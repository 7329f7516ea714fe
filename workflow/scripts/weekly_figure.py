"""Simulated beside measured brains, week by week."""

from gyriflow.io.figures import write_figure
from gyriflow.io.surfaces import read_surface
from gyriflow.report.renders import runs_by_week
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    figure = runs_by_week(
        {"simulated": dict(zip(params.simulated_weeks, map(read_surface, files.simulated), strict=True))},
        dict(zip(params.real_weeks, map(read_surface, files.real), strict=True)),
        measured=params.measured,
        synthetic=params.synthetic,
    )
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
