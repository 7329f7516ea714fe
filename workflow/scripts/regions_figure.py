"""Where and how much the start brain grows, on its surface and in sections, with its regions and normals there."""

from gyriflow.folding.regions import no_growth_ellipsoid
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.io.figures import write_figure
from gyriflow.io.regions import read_regions
from gyriflow.io.yaml_files import read_yaml
from gyriflow.parameters.reading import parameters_from
from gyriflow.parameters.terms import BASE
from gyriflow.report.sections import GROWTH, normal_arrows, region_sections
from gyriflow.report.zones import field_picture
from gyriflow.step import step

output, params = snakemake.output, snakemake.params
with step(snakemake.log[0]):
    regions, run = read_regions(snakemake.input.mesh), parameters_from(read_yaml(snakemake.input.params))
    mesh, fields, (surface, pial) = regions.mesh, regions.fields, boundary_surface(regions.mesh)
    shown = {"title": f"run {snakemake.wildcards.run}", "synthetic": params.synthetic}
    growth, x = 1e3 * fields["tangential_growth_per_step"][pial], run.fissure_x_mm
    figure = field_picture(surface, growth, label=GROWTH, fissure_x_mm=x, **shown)
    write_figure(output.png, output.pdf, figure, dpi=params.dpi)
    figure = region_sections(mesh, fields, regions.cell_tags, no_growth_ellipsoid(mesh.vertices, run), **shown)
    write_figure(output.section_png, output.section_pdf, figure, dpi=params.dpi)
    cortex = regions.facets[regions.facet_tags["zone"] < BASE]
    figure = normal_arrows(mesh, fields["pial_normal"], fields["cortex_weight"], cortex, **shown)
    write_figure(output.normals_png, output.normals_pdf, figure, dpi=params.dpi)
