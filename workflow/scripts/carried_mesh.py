"""The mesh of a start brain carried through the real brains of later weeks, with the local growth between them."""

import numpy as np

from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.growth.carrying import carry_mesh
from gyriflow.growth.local import growth_over_weeks
from gyriflow.io.poses import read_pose
from gyriflow.io.registrations import CarriedMesh, read_correspondence, write_carried_mesh
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(files.mesh)
    pose = read_pose(files.report)
    # the files' world, in which brains correspond, is not the pose of the mesh
    start = TetrahedralMesh(transform_points(mesh.vertices, pose.inverse), mesh.tets)
    maps = [[read_correspondence(path) for path in paths] for paths in (files.earlier, files.later)]
    positions = carry_mesh(start, *maps)
    # directions are those of the mesh's pose
    turned, own = positions @ pose.world[:3, :3].T, len(maps[0])
    growth = {
        length: growth_over_weeks(mesh, turned, params.weeks, length, own, params.strain)
        for length in params.smoothing_mm
    }
    write_carried_mesh(snakemake.output[0], CarriedMesh(np.array(params.weeks), positions, growth))
