"""Where and how much the start brain grows, on its surface."""

from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.io.figures import write_figure
from gyriflow.io.regions import read_regions
from gyriflow.io.yaml_files import read_yaml
from gyriflow.report.sections import GROWTH
from gyriflow.report.zones import field_picture
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    regions, run = read_regions(snakemake.input.mesh), read_yaml(snakemake.input.params)
    surface, pial = boundary_surface(regions.mesh)
    growth = 1e3 * regions.fields["tangential_growth_per_step"][pial]
    shown = {"fissure_x_mm": run["fissure_x_mm"], "synthetic": params.synthetic}
    figure = field_picture(surface, growth, label=GROWTH, **shown)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
