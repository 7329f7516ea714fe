"""The maps of a run's parameters at the vertices of the start brain's mesh."""

from gyriflow.geometry.tetrahedra import boundary_faces, boundary_surface
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_pose, read_surface_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh, write_maps
from gyriflow.io.volumes import read_volume_map
from gyriflow.mesh import maps as on_mesh
from gyriflow.settings.folding import FoldingSettings, target_maps
from gyriflow.settings.varying import bounds_of
from gyriflow.step import step

files, maps, given = snakemake.input, {}, snakemake.params
with step(snakemake.log[0]):
    mesh = read_tetrahedral_mesh(files.mesh)
    facets, pose = boundary_faces(mesh)[0], read_pose(files.surface)
    targets = read_weekly_shapes(files.targets) if files.targets else None
    for name, source in given.maps.items():
        path = ", ".join(source["map"])
        if source["surface"]:
            surface, values = read_surface_maps(source["map"], source["surface"])
            surface = on_mesh.move_to_mesh(mesh.vertices[boundary_surface(mesh)[1]], surface, pose.of_file())
            maps[name] = on_mesh.vertex_map_on_mesh(mesh.vertices, facets, surface, values, path)
        else:
            volume, motion = read_volume_map(path, given.affine_from), pose.of_volume(path)
            maps[name] = on_mesh.volume_map_on_mesh(mesh.vertices, volume.values, motion @ volume.affine, path)
        on_mesh.require_within(maps[name], bounds_of(FoldingSettings.model_fields[name]), path)
    if targets:
        maps |= target_maps(targets.weeks[1:], targets.positions[1:])
    write_maps(snakemake.output[0], maps)
