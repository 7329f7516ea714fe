"""Normals of the pial surface inside the start brain of a run, as arrows in sections."""

from gyriflow.io.figures import write_figure
from gyriflow.io.regions import read_regions
from gyriflow.parameters.terms import BASE
from gyriflow.report.sections import normal_arrows
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    regions = read_regions(snakemake.input.mesh)
    cortex = regions.facets[regions.facet_tags["zone"] < BASE]
    normals, weight = regions.fields["pial_normal"], regions.fields["cortex_weight"]
    figure = normal_arrows(regions.mesh, normals, weight, cortex, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
