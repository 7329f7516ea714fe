"""Prepare a run: write its parameters, their maps on the start mesh, and the mesh's
zones and fields."""

import numpy as np

from gyriflow.anatomy.fissure import nearer_left
from gyriflow.anatomy.plausible import require_plausible_thickness
from gyriflow.folding.start_regions import start_regions
from gyriflow.geometry.tetrahedra import boundary_faces, boundary_surface
from gyriflow.growth.curves import followed_sizes
from gyriflow.io.files import read_json, read_table
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_pose, read_surface, read_surface_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh, write_maps, write_regions
from gyriflow.io.volumes import read_volume_map
from gyriflow.io.yaml_files import write_yaml
from gyriflow.mesh import maps as on_mesh
from gyriflow.settings.folding import (
    FoldingSettings,
    parameters_from,
    params_content,
    target_maps,
)
from gyriflow.settings.varying import bounds_of
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    mesh, maps, sizes = read_tetrahedral_mesh(files.mesh), {}, {}
    target_weeks, stops = [], []
    facets, pose = boundary_faces(mesh)[0], read_pose(files.surface)
    for name, source in params.maps.items():
        path = ", ".join(source["map"])
        if source["surface"]:
            surface, values = read_surface_maps(source["map"], source["surface"])
            surface = on_mesh.move_to_mesh(
                mesh.vertices[boundary_surface(mesh)[1]], surface, pose.of_file()
            )
            maps[name] = on_mesh.vertex_map_on_mesh(
                mesh.vertices, facets, surface, values, path
            )
        else:
            values, affine = read_volume_map(path, params.affine_from)
            motion = pose.of_volume(path)
            maps[name] = on_mesh.volume_map_on_mesh(
                mesh.vertices, values, motion @ affine, path
            )
        on_mesh.require_within(
            maps[name], bounds_of(FoldingSettings.model_fields[name]), path
        )
        if name == "thickness_mm":
            require_plausible_thickness(maps[name], source["curve"], path)
    if files.targets:
        targets = read_weekly_shapes(files.targets)
        stops = targets.stops
        # the weeks that the path is defined by
        is_passed = ~np.isin(targets.weeks, targets.between)
        weekly = targets.weeks[is_passed].tolist()
        sizes = {
            name: dict(
                zip(
                    weekly,
                    values[is_passed].tolist(),
                    strict=True,
                )
            )
            for name, values in targets.sizes.items()
        }
        target_weeks = weekly[1:]
        maps |= target_maps(target_weeks, targets.positions[is_passed][1:])
    curves = read_table(files.curves) if files.curves else None
    growth = {**params.settings["growth"], **sizes}
    growth |= followed_sizes(
        growth, curves, params.series, params.weeks, shrink=bool(sizes)
    )
    surface = read_json(files.surface)
    content = params_content(
        params.settings, growth, params.weeks, surface, target_weeks, stops
    )
    write_yaml(output.params, content)
    if maps:
        write_maps(output.maps, maps)
    regions = start_regions(
        mesh,
        parameters_from(content),
        maps,
        lambda mesh: nearer_left(mesh, *map(read_surface, files.sides)),
    )
    write_regions(output.regions, regions)
