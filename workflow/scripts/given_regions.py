"""Write regions at the vertices of a brain's hemispheres, from the user's label volume
or label files."""

import numpy as np

from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.triangles import transformed
from gyriflow.growth.carried_regions import (
    number_regions,
    regions_from_surface,
    regions_from_volume,
    renumber,
)
from gyriflow.io.surfaces import (
    read_pose,
    read_surface,
    read_vertex_labels,
    write_vertex_labels,
)
from gyriflow.io.volumes import read_label_volume
from gyriflow.settings.terms import SIDES, STRUCTURES
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
sources = [
    file
    for name in ("volume", "left_labels", "right_labels")
    if (file := files.get(name))
]
with step(snakemake.log[0], *sources):
    pose = read_pose(files.report)
    meshes = {side: read_surface(files[side]) for side in SIDES}
    if files.get("volume"):
        volume = read_label_volume(files.volume, affine_from=params.affine_from)
        numbers = number_regions(params.names)
        regions = renumber(volume.labels, params.names, numbers)
        back = np.linalg.inv(pose.of_volume(files.volume))
        points = {
            side: transform_points(mesh.vertices, back) for side, mesh in meshes.items()
        }
        found = regions_from_volume(points, regions, volume.affine)
    else:
        read = {
            side: read_vertex_labels(
                files[f"{side}_labels"],
                side,
            )
            for side in SIDES
        }
        tables = {side: params.names or names for side, (_, names) in read.items()}
        numbers, found = number_regions(*tables.values()), {}
        for side, (labels, _) in read.items():
            posed = transformed(
                read_surface(
                    files[f"{side}_surface"],
                    side,
                ),
                pose.of_file(side),
            )
            found[side] = regions_from_surface(
                meshes[side], posed, renumber(labels, tables[side], numbers)
            )
    names = {number: name for name, number in numbers.items()}
    for side, values in found.items():
        write_vertex_labels(
            snakemake.output[f"{side}_regions"], values, names, STRUCTURES[side]
        )
