"""Fill the start brain's pial surface with tetrahedra; a refused mesh is kept for
inspection."""

from pathlib import Path

from gyriflow.errors import MeshError
from gyriflow.geometry.tetrahedra import boundary_surface, radius_ratios
from gyriflow.io.files import write_json
from gyriflow.io.made_files import making_files
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.io.tetmeshes import write_tetrahedral_mesh
from gyriflow.mesh.quality import quality_summary, refuse_bad_mesh
from gyriflow.mesh.tetrahedralisation import tetrahedralise
from gyriflow.step import step

output, params = snakemake.output, snakemake.params
with step(snakemake.log[0]):
    refused = Path(params.refused)
    surface = read_surface(snakemake.input[0])
    mesh = tetrahedralise(surface, **params.settings)
    summary = quality_summary(mesh, surface)
    fields = {"radius_ratio": radius_ratios(mesh)}
    with making_files(refused, refused.with_name(".refused-files.json")):
        try:
            refuse_bad_mesh(mesh, summary, refused / "brain.xdmf", **params.gates)
        except MeshError:
            write_tetrahedral_mesh(refused / "brain.xdmf", mesh, fields)
            write_json(refused / "quality.json", summary)
            raise
    write_tetrahedral_mesh(output.mesh, mesh, fields)
    write_surface(output.surface, boundary_surface(mesh)[0])
    write_json(output.quality, summary)
