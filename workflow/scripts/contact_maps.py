"""Maps of the contact pressure on the pial surface at the output weeks."""

from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.figures import write_figure
from gyriflow.io.frames import read_field, read_positions, read_tets, read_weeks
from gyriflow.report.renders import scalar_maps
from gyriflow.step import step

frames, params, run = snakemake.input[0], snakemake.params, snakemake.wildcards.run
with step(snakemake.log[0]):
    start, *weeks = read_weeks(frames)
    surface, pial = boundary_surface(TetrahedralMesh(read_positions(frames, start), read_tets(frames)))
    maps = {
        week: (
            TriangleMesh(read_positions(frames, week)[pial], surface.faces),
            read_field(frames, week, "contact_pressure_pa")[pial],
        )
        for week in weeks
    }
    figure = scalar_maps({f"run {run}": maps}, quantity="contact_pressure_pa", synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
