"""The start brain's pial surface filled with tetrahedra."""

from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.io.tetmeshes import write_tetrahedral_mesh
from gyriflow.mesh.quality import quality_summary, radius_ratios, refuse_bad_mesh
from gyriflow.mesh.tetrahedralisation import tetrahedralise
from gyriflow.step import step

output, params = snakemake.output, snakemake.params
with step(snakemake.log[0]):
    surface = read_surface(snakemake.input[0])
    mesh = tetrahedralise(surface, **params.settings)
    summary = quality_summary(mesh, surface)
    refuse_bad_mesh(mesh, summary, **params.gates)
    write_tetrahedral_mesh(output.mesh, mesh, cell_fields={"radius_ratio": radius_ratios(mesh)})
    write_surface(output.surface, boundary_surface(mesh)[0])
    write_json(output.quality, summary)
