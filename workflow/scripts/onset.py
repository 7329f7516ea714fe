"""In which week each sulcus of the last real brain appears: in the real brains, and in a run."""

import numpy as np
import pandas as pd

from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.triangles import transformed
from gyriflow.io.files import read_json, write_table
from gyriflow.io.label_files import read_vertex_labels
from gyriflow.io.registrations import read_correspondence
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.curvature import curvature
from gyriflow.metrics.depth import convex_hull, sulcal_depth
from gyriflow.registration.carrying import carry_surface
from gyriflow.step import step
from gyriflow.validation.onset import named, onset_on_surfaces, regions_on, sulcal_regions

files, params, tables = snakemake.input, snakemake.params, []


def places(mesh, index):
    """Returns the last brain's sulci on a surface in the pose of the brain of an index."""
    points = carry_surface(transformed(mesh, np.linalg.inv(poses[index])), between[index:])
    return regions_on(mesh, transform_points(points, poses[-1]), real[-1], last)


with step(snakemake.log[0]):
    between = [read_correspondence(path) for path in files.correspondences]
    poses = [np.array(read_json(path)["pose"]) for path in files.reports]
    for side in params.sides:
        real, run = ([read_surface(path) for path in files[f"{who}_{side}"]] for who in ("real", "run"))
        deep = [[sulcal_depth(mesh, convex_hull(mesh)) for mesh in meshes] for meshes in (real, run)]
        last = sulcal_regions(real[-1], deep[0][-1], curvature(real[-1], radius_mm=params.radius_mm).mean)
        regions = read_vertex_labels(given) if (given := files.get(f"{side}_regions")) else (0 * last, {})
        last, names = named(real[-1], last, *regions, side)
        brains = {"real": (params.real_weeks, real, deep[0], [places(mesh, index) for index, mesh in enumerate(real)])}
        brains[params.run] = params.run_weeks, run, deep[1], [places(run[0], 0)] * len(run)
        found = [onset_on_surfaces(*brain, names).assign(run=who) for who, brain in brains.items()]
        tables += [table.assign(subject=params.subject, hemisphere=side) for table in found]
    write_table(snakemake.output[0], pd.concat(tables, ignore_index=True))
