"""Write the atlas' own brain of a predicted week, aligned with the predicted brain and
scaled to its volume."""

import numpy as np

from gyriflow.compare.shapes import scale_to_volume
from gyriflow.geometry.alignment import align
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, vertex_areas
from gyriflow.growth.expected import positions_at
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0]):
    targets = read_weekly_shapes(files.targets)
    predicted = read_surface(files.predicted)
    start, _ = boundary_surface(read_tetrahedral_mesh(files.mesh))
    shapes = np.stack(targets.surfaces["atlas"])
    atlas = TriangleMesh(
        positions_at(
            snakemake.params.week,
            shapes,
            targets.weeks,
            vertex_areas(start),
        ),
        start.faces,
    )
    write_surface(
        snakemake.output[0], align(scale_to_volume(atlas, predicted), predicted)
    )
