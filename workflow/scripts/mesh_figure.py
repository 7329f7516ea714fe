"""The tetrahedral mesh of a run's start brain, whole and cut open."""

from gyriflow.io.figures import write_figure
from gyriflow.io.regions import read_regions
from gyriflow.report.cut_mesh import mesh_picture
from gyriflow.step import step

CORTEX = 1

params = snakemake.params
with step(snakemake.log[0]):
    regions = read_regions(snakemake.input.mesh)
    figure = mesh_picture(regions.mesh, regions.cell_tags["layer"] == CORTEX, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
