"""Sections through the start brain of a run: hemispheres, what grows and how much, stiffness."""

from gyriflow.folding.regions import no_growth_ellipsoid
from gyriflow.io.figures import write_figure
from gyriflow.io.regions import read_regions
from gyriflow.io.yaml_files import read_yaml
from gyriflow.parameters.reading import parameters_from
from gyriflow.report.sections import region_sections
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    regions, run = read_regions(snakemake.input.mesh), parameters_from(read_yaml(snakemake.input.params))
    ellipsoid = no_growth_ellipsoid(regions.mesh.vertices, run)
    figure = region_sections(regions.mesh, regions.fields, regions.cell_tags, ellipsoid, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
