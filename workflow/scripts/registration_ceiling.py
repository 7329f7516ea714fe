"""The start brain carried along the registrations, beside the real brains: the most that their maps can give."""

import numpy as np

from gyriflow.compare.shapes import Shape, ready
from gyriflow.compare.validation import Comparison, ordered, validation_row
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.files import write_table
from gyriflow.io.registrations import read_carried_mesh
from gyriflow.io.surfaces import read_pose, read_surface, read_vertex_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.metrics.curvature import curvature
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    surface, pial = boundary_surface(read_tetrahedral_mesh(files.mesh))
    pose, carried, rows = read_pose(files.report), read_carried_mesh(files.carried), []
    for number, week in enumerate(params.weeks):
        places = transform_points(carried.positions[np.isclose(carried.weeks, week).argmax()][pial], pose.world)
        moved, real = TriangleMesh(places, surface.faces), read_surface(files.whole[number])
        even = ready(moved, real)
        bend = curvature(even, radius_mm=params.curvature_radius_mm)
        shapes = {"run": Shape(even, bend.mean, bend.shape_index)}
        for name in ("real", "start", "adjacent"):
            maps = read_vertex_maps(files[f"{name}_maps"][number])
            shapes[name] = Shape(read_surface(files[name][number]), **maps)
        comparison = Comparison("registration", "explained", params.start_week, week)
        rows.append(validation_row(comparison, simulated=moved, real_brain=real, curve=None, **shapes))
    write_table(snakemake.output[0], ordered(rows))
