"""The zones of the start mesh's boundary: free, clamped, contact."""

from gyriflow.folding.zones import find_zones
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.figures import write_figure
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.report.zones import zones_picture
from gyriflow.step import step

with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(snakemake.input.mesh)
    settings = read_yaml(snakemake.input.params)
    fissure_x_mm, contact = settings["fissure_x_mm"], settings["contact"]
    zones = find_zones(
        mesh,
        fissure_x_mm=fissure_x_mm,
        gap_mm=contact["gap_mm"],
        contact=contact["kind"] != "none",
        **settings["no_growth"],
    )
    boundary = TriangleMesh(mesh.vertices, zones.facets)
    title = f"run {snakemake.wildcards.run}"
    synthetic = snakemake.params.synthetic
    figure = zones_picture(boundary, zones.facet_zone, fissure_x_mm=fissure_x_mm, title=title, synthetic=synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=snakemake.params.dpi)
