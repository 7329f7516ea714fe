"""Where and how much the start brain grows, and how stiff it is: on its surface and in a coronal section."""

from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.io.figures import write_figure
from gyriflow.io.tetmeshes import read_tetrahedral_mesh, read_vertex_field
from gyriflow.io.yaml_files import read_yaml
from gyriflow.report.sections import cross_sections
from gyriflow.report.zones import field_picture
from gyriflow.step import step

regions, output, params = snakemake.input.mesh, snakemake.output, snakemake.params
GROWTH, STIFFNESS = "tangential growth per step (10⁻³)", "shear modulus (Pa)"

with step(snakemake.log[0]):
    mesh, growth = read_tetrahedral_mesh(regions), 1e3 * read_vertex_field(regions, "tangential_growth_per_step")
    shown = {"title": f"run {snakemake.wildcards.run}", "synthetic": params.synthetic}
    surface, pial = boundary_surface(mesh)
    x = read_yaml(snakemake.input.params)["fissure_x_mm"]
    figure = field_picture(surface, growth[pial], label=GROWTH, fissure_x_mm=x, **shown)
    write_figure(output.png, output.pdf, figure, dpi=params.dpi)
    fields = {GROWTH: growth, STIFFNESS: read_vertex_field(regions, "shear_modulus_pa")}
    write_figure(output.section_png, output.section_pdf, cross_sections(mesh, fields, **shown), dpi=params.dpi)
