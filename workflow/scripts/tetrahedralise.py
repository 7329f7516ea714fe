"""The start brain's pial surface filled with tetrahedra."""

from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.io.tetmeshes import write_tetrahedral_mesh
from gyriflow.mesh.quality import quality_summary, radius_ratios, refuse_bad_elements
from gyriflow.mesh.tetrahedralisation import tetrahedralise
from gyriflow.step import step

output, settings = snakemake.output, dict(snakemake.params.settings)
with step(snakemake.log[0]):
    gate = settings.pop("min_radius_ratio")
    mesh = tetrahedralise(read_surface(snakemake.input[0]), **settings)
    refuse_bad_elements(mesh, gate)
    write_tetrahedral_mesh(output.mesh, mesh, cell_fields={"radius_ratio": radius_ratios(mesh)})
    write_surface(output.surface, boundary_surface(mesh)[0])
    write_json(output.quality, quality_summary(mesh))
