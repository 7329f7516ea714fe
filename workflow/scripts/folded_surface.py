"""The pial surface of a folding run at a week, and its hemispheres: the material sides of the fissure at the start."""

from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, corners, submesh
from gyriflow.io.frames import read_positions, read_tets, read_weeks
from gyriflow.io.surfaces import write_surface
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

frames, output = snakemake.input.frames, snakemake.output
with step(snakemake.log[0]):
    start = TetrahedralMesh(read_positions(frames, read_weeks(frames)[0]), read_tets(frames))
    initial, vertices = boundary_surface(start)
    surface = TriangleMesh(read_positions(frames, float(snakemake.wildcards.week))[vertices], initial.faces)
    on_left = corners(initial).mean(axis=1)[:, 0] < read_yaml(snakemake.input.params)["fissure_x_mm"]
    write_surface(output.whole, surface)
    write_surface(output.left, submesh(surface, on_left)[0], "CortexLeft")
    write_surface(output.right, submesh(surface, ~on_left)[0], "CortexRight")
