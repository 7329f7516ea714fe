"""Write the surfaces of a predicted brain at a week with the resolution of observed
brains."""

from gyriflow.anatomy.fissure import cut_sides, nearer_left
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.growth.fine_surfaces import (
    MIN_OWN_SHARE,
    ObservedSurface,
    finer_share,
    moved_surface,
    nearest_in_age,
)
from gyriflow.io.frames import read_positions
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_surface, write_brain
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(files.mesh)
    start, used = boundary_surface(mesh)
    positions = read_positions(files.frames, params.week)
    boundary = TriangleMesh(positions[used], start.faces)
    targets = read_weekly_shapes(files.targets)
    share = finer_share(
        targets.kept,
        float(targets.weeks[0]),
        params.week,
    )
    if share > MIN_OWN_SHARE:
        parts = files.start
        places = start.vertices
    else:
        number = nearest_in_age(targets.ages, params.atlas_weeks, params.age)
        parts = params.atlas_parts[number]
        places = targets.placed[params.atlas_weeks[number]]
    whole, left, right = map(read_surface, parts)
    moved = moved_surface(ObservedSurface(whole, places), boundary)
    if moved is boundary:
        # the surface of the mesh, whose sides are those of the start
        whole = start
        left, right = map(read_surface, files.start[1:])
    sides = cut_sides(moved, nearer_left(whole, left, right))
    write_brain(snakemake.output, moved, *sides)
