"""In which week each sulcus of the last real brain appears: in the real brains, and in a run."""

import numpy as np
import pandas as pd

from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.triangles import transformed
from gyriflow.io.files import read_json, write_table
from gyriflow.io.registrations import read_correspondence
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.curvature import curvature
from gyriflow.metrics.depth import convex_hull, sulcal_depth
from gyriflow.registration.carrying import carry_surface
from gyriflow.step import step
from gyriflow.validation.onset import numbered, onset_on_surfaces, regions_on, sulcal_regions

files, params, tables = snakemake.input, snakemake.params, []


def carried(mesh, index):
    """Returns the vertices of a surface in the pose of the brain of an index, carried to the last brain's."""
    points = carry_surface(transformed(mesh, np.linalg.inv(poses[index])), between[index:])
    return transform_points(points, poses[-1])


with step(snakemake.log[0]):
    between = [read_correspondence(path) for path in files.correspondences]
    poses = [np.array(read_json(path)["pose"]) for path in files.reports]
    for side in params.sides:
        real, run = ([read_surface(path) for path in files[f"{who}_{side}"]] for who in ("real", "run"))
        deep, bend = sulcal_depth(real[-1], convex_hull(real[-1])), curvature(real[-1], radius_mm=params.radius_mm)
        last = sulcal_regions(real[-1], deep, bend.mean)
        places = [regions_on(mesh, carried(mesh, index), real[-1], last) for index, mesh in enumerate(real)]
        start = regions_on(run[0], carried(run[0], 0), real[-1], last)  # the same vertices in all weeks
        brains = {"real": (params.real_weeks, real, places), params.run: (params.run_weeks, run, [start] * len(run))}
        for who, (weeks, meshes, regions) in brains.items():
            depths = [sulcal_depth(mesh, convex_hull(mesh)) for mesh in meshes]
            table = onset_on_surfaces(weeks, meshes, depths, regions, numbered(last, side))
            tables.append(table.assign(run=who, subject=params.subject, hemisphere=side))
    write_table(snakemake.output[0], pd.concat(tables, ignore_index=True))
