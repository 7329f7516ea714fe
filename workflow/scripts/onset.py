"""In which week each sulcus of the last real brain appears: in the real brains, and in a run."""

import pandas as pd

from gyriflow.compare.onset import named, onset, relief, sulcal_regions
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.matching import labels_at, match_points
from gyriflow.geometry.triangles import TriangleMesh, convex_hull, transformed, vertex_normals
from gyriflow.growth.carrying import carry_surface
from gyriflow.io.files import write_table
from gyriflow.io.registrations import read_correspondence
from gyriflow.io.surfaces import read_pose, read_surface, read_vertex_labels
from gyriflow.metrics.curvature import curvature
from gyriflow.metrics.gyrification import sulcal_depth
from gyriflow.step import step

files, params, tables = snakemake.input, snakemake.params, []


def places(mesh, index):
    """Return the last brain's sulci on a surface in the pose of the brain of an index."""
    points = transform_points(carry_surface(transformed(mesh, poses[index].inverse), between[index:]), poses[-1].world)
    return labels_at(match_points(points, vertex_normals(TriangleMesh(points, mesh.faces)), real[-1]), last)


with step(snakemake.log[0]):
    between = [read_correspondence(path) for path in files.correspondences]
    poses = [read_pose(path) for path in files.reports]
    for side in params.sides:
        real, run = ([read_surface(path) for path in files[f"{who}_{side}"]] for who in ("real", "run"))
        deep = [[sulcal_depth(mesh, convex_hull(mesh)) for mesh in meshes] for meshes in (real, run)]
        last = sulcal_regions(real[-1], deep[0][-1], curvature(real[-1], radius_mm=params.radius_mm).mean)
        regions = read_vertex_labels(given) if (given := files.get(f"{side}_regions")) else (0 * last, {})
        last, names = named(real[-1], last, *regions, side)
        brains = {"real": (params.real_weeks, real, deep[0], [places(mesh, index) for index, mesh in enumerate(real)])}
        brains[params.run] = params.run_weeks, run, deep[1], [places(run[0], 0)] * len(run)
        for who, brain in brains.items():
            reliefs = {week: relief(*surface, names) for week, *surface in zip(*brain, strict=True)}
            tables.append(onset(reliefs).assign(run=who, subject=params.subject, hemisphere=side))
    write_table(snakemake.output[0], pd.concat(tables, ignore_index=True))
