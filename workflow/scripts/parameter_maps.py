"""The maps of a run's parameters at the vertices of the start brain's mesh."""

import numpy as np

from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.tetrahedra import boundary_faces, linear_pieces
from gyriflow.growth.regional import regional_maps
from gyriflow.io.files import read_json
from gyriflow.io.maps import read_surface_maps, read_volume_map, write_maps
from gyriflow.io.registrations import read_carried_mesh
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.mesh.maps import move_to_mesh, require_within, vertex_map_on_mesh, volume_map_on_mesh
from gyriflow.step import step
from gyriflow.surface.file_poses import surface_pose, volume_pose

files, maps = snakemake.input, {}
with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(files.mesh)
    facets, report = boundary_faces(mesh)[0], read_json(files.surface)
    for name, source in snakemake.params.maps.items():
        path = ", ".join(source["map"])
        if source["surface"]:
            surface, values = read_surface_maps(source["map"], source["surface"])
            surface = move_to_mesh(mesh.vertices[np.unique(facets)], surface, surface_pose(report))
            maps[name] = vertex_map_on_mesh(mesh.vertices, facets, surface, values, path)
        else:
            volume, motion = read_volume_map(path, snakemake.params.affine_from), volume_pose(report, path)
            maps[name] = volume_map_on_mesh(mesh.vertices, volume.values, motion @ volume.affine, path)
        require_within(maps[name], snakemake.params.bounds[name], path)
    if files.carried:
        carried, follow = read_carried_mesh(files.carried), snakemake.params.follow
        growth, cells = carried.growth[follow["smoothing_mm"]], {"volume": linear_pieces(mesh), "area": facets}
        sizes = {kind: vertex_sizes(mesh.vertices, found) for kind, found in cells.items()}
        right = mesh.vertices[:, 0] > report["fissure_x_mm"]
        maps |= regional_maps(carried.weeks, growth, sizes, mesh.vertices, right, follow)
    write_maps(snakemake.output[0], maps)
