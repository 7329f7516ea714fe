"""The mesh of a start brain carried through the real brains of later weeks."""

import numpy as np

from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.growth.carrying import carry_mesh
from gyriflow.io.registrations import WeeklyShapes, read_correspondence, write_weekly_shapes
from gyriflow.io.surfaces import read_pose
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(files.mesh)
    pose = read_pose(files.report)
    # the files' world, in which brains correspond, is not the pose of the mesh
    start = TetrahedralMesh(transform_points(mesh.vertices, pose.inverse), mesh.tets)
    positions = carry_mesh(start, [read_correspondence(path) for path in files.later])
    write_weekly_shapes(snakemake.output[0], WeeklyShapes(np.array(params.weeks), positions))
