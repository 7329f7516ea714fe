"""The first and the last of the brains that went in."""

from gyriflow.io.figures import write_figure
from gyriflow.io.surfaces import read_surface
from gyriflow.report.renders import brains_picture
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    brains = dict(zip(params.headings, map(read_surface, snakemake.input), strict=True))
    figure = brains_picture(brains, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
