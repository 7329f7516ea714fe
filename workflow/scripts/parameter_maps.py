"""The maps of a run's parameters at the vertices of the start brain's mesh."""

import numpy as np

from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.tetrahedra import boundary_faces, linear_pieces
from gyriflow.growth.regional import regional_maps
from gyriflow.io.files import read_json
from gyriflow.io.maps import read_surface_maps, read_volume_map, write_maps
from gyriflow.io.registrations import read_carried_mesh
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.volumes import read_label_volume
from gyriflow.mesh import maps as on_mesh
from gyriflow.step import step
from gyriflow.surface.file_poses import surface_pose, volume_pose

files, maps, given = snakemake.input, {}, snakemake.params
with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(files.mesh)
    facets, report = boundary_faces(mesh)[0], read_json(files.surface)
    for name, source in given.maps.items():
        path = ", ".join(source["map"])
        if source["surface"]:
            surface, values = read_surface_maps(source["map"], source["surface"])
            surface = on_mesh.move_to_mesh(mesh.vertices[np.unique(facets)], surface, surface_pose(report))
            maps[name] = on_mesh.vertex_map_on_mesh(mesh.vertices, facets, surface, values, path)
        else:
            volume, motion = read_volume_map(path, given.affine_from), volume_pose(report, path)
            maps[name] = on_mesh.volume_map_on_mesh(mesh.vertices, volume.values, motion @ volume.affine, path)
        on_mesh.require_within(maps[name], given.bounds[name], path)
    if files.carried:
        carried, follow = read_carried_mesh(files.carried), given.follow
        growth, cells = carried.growth[follow["smoothing_mm"]], {"volume": linear_pieces(mesh), "area": facets}
        sizes = {kind: vertex_sizes(mesh.vertices, found) for kind, found in cells.items()}
        right = mesh.vertices[:, 0] > report["fissure_x_mm"]
        maps |= regional_maps(carried.weeks, growth, sizes, mesh.vertices, right, follow)
    if path := files.labels:
        voxels, motion = read_label_volume(path, affine_from=given.affine_from), volume_pose(report, path)
        maps |= on_mesh.ventricle_map(mesh.vertices, voxels.labels, motion @ voxels.affine, given.ventricles, path)
    write_maps(snakemake.output[0], maps)
