"""The start brain's pial surface filled with tetrahedra."""

from gyriflow.errors import MeshError
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.io.tetmeshes import write_tetrahedral_mesh
from gyriflow.mesh.quality import element_quality, quality_summary
from gyriflow.mesh.tetrahedralisation import tetrahedralise
from gyriflow.step import step

settings = dict(snakemake.params.settings)
with step(snakemake.log[0]):
    gate = settings.pop("min_radius_ratio")
    mesh = tetrahedralise(read_surface(snakemake.input[0]), **settings)
    quality = element_quality(mesh)
    worst = quality["radius_ratio"].min()
    if worst < gate:
        raise MeshError(
            "an element is too flat",
            found=f"radius ratio {worst:.3g}",
            expected=f"at least mesh.min_radius_ratio, {gate:g}",
            remedy="Choose shorter edges in `mesh`, or lower the gate",
        )
    write_tetrahedral_mesh(
        snakemake.output.mesh, mesh, cell_fields={"radius_ratio": quality["radius_ratio"].to_numpy()}
    )
    write_surface(snakemake.output.surface, boundary_surface(mesh)[0])
    write_json(snakemake.output.quality, quality_summary(mesh))
