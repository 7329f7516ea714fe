"""The shapes that the mesh of a start brain is to have in later weeks."""

import numpy as np

from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.geometry.triangles import transformed
from gyriflow.growth.expected import carry_sharply, foretell, sizes_of
from gyriflow.io.poses import read_pose
from gyriflow.io.registrations import Targets, read_correspondence, write_targets
from gyriflow.io.surfaces import read_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(files.mesh)
    pose = read_pose(files.report)
    start = TetrahedralMesh(transform_points(mesh.vertices, pose.inverse), mesh.tets)
    # brains correspond in the world of their files, not in their poses
    surfaces = [
        transformed(read_surface(path), read_pose(report).inverse)
        for path, report in zip(files.surfaces, files.reports, strict=True)
    ]
    pairs = [read_correspondence(path) for path in files.correspondences]
    if snakemake.wildcards.whose == "own":
        weeks, positions, others = [params.start_week, *params.weeks], carry_sharply(start, pairs, surfaces), {}
    else:
        weeks, positions, others = foretell(start, params.start_week, pairs, surfaces, params.weeks)
    others = {name: [transform_points(places, pose.world) for places in found] for name, found in others.items()}
    positions = [transform_points(places, pose.world) for places in positions]
    targets = Targets(np.array(weeks), np.stack(positions), sizes_of(mesh, positions), others)
    write_targets(snakemake.output[0], targets)
