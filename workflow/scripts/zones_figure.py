"""The zones of the start mesh's boundary: free, clamped, contact."""

from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.figures import write_figure
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.parameters.reading import parameters_from
from gyriflow.report.zones import zones_picture
from gyriflow.step import step

with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(snakemake.input.mesh)
    zones = zones_of_run(mesh, parameters_from(read_yaml(snakemake.input.params)))
    boundary = TriangleMesh(mesh.vertices, zones.facets)
    synthetic = snakemake.params.synthetic
    x = zones.fissure_x_mm
    figure = zones_picture(boundary, zones.facet_zone, fissure_x_mm=x, synthetic=synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=snakemake.params.dpi)
