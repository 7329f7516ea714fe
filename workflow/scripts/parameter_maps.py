"""The maps of a run's parameters at the vertices of the start brain's mesh."""

from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.tetrahedra import boundary_faces, boundary_surface, linear_pieces
from gyriflow.growth.local import growth_over_weeks
from gyriflow.growth.regional import regional_maps, target_maps
from gyriflow.io.files import read_json
from gyriflow.io.maps import read_surface_maps, read_volume_map, write_maps
from gyriflow.io.poses import read_pose
from gyriflow.io.registrations import read_carried_mesh, read_targets
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.volumes import read_label_volume
from gyriflow.mesh import maps as on_mesh
from gyriflow.step import step

files, maps, given = snakemake.input, {}, snakemake.params
with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(files.mesh)
    facets, pose, follow = boundary_faces(mesh)[0], read_pose(files.surface), given.follow
    targets = read_targets(files.targets) if files.targets else None
    for name, source in given.maps.items():
        path = ", ".join(source["map"])
        if source["surface"]:
            surface, values = read_surface_maps(source["map"], source["surface"])
            surface = on_mesh.move_to_mesh(mesh.vertices[boundary_surface(mesh)[1]], surface, pose.of_file())
            maps[name] = on_mesh.vertex_map_on_mesh(mesh.vertices, facets, surface, values, path)
        else:
            volume, motion = read_volume_map(path, given.affine_from), pose.of_volume(path)
            maps[name] = on_mesh.volume_map_on_mesh(mesh.vertices, volume.values, motion @ volume.affine, path)
        on_mesh.require_within(maps[name], given.bounds[name], path)
    if follow and (targets or files.carried):
        shapes, length = targets or read_carried_mesh(files.carried), follow["smoothing_mm"]
        asked = (mesh, shapes.positions, shapes.weeks, length, 0, follow["directional"] > 0)
        growth = growth_over_weeks(*asked) if targets else shapes.growth[length]
        cells = {"volume": linear_pieces(mesh), "area": facets}
        sizes = {kind: vertex_sizes(mesh.vertices, found) for kind, found in cells.items()}
        right = mesh.vertices[:, 0] > read_json(files.surface)["fissure_x_mm"]
        maps |= regional_maps(shapes.weeks, growth, sizes, mesh.vertices, right, follow)
    elif targets:
        maps |= target_maps(targets.weeks[1:], targets.positions[1:])
    if path := files.labels:
        voxels, motion = read_label_volume(path, affine_from=given.affine_from), pose.of_volume(path)
        maps |= on_mesh.ventricle_map(mesh.vertices, voxels.labels, motion @ voxels.affine, given.ventricles, path)
    write_maps(snakemake.output[0], maps)
