"""The clean pial surface of a brain and of its hemispheres in RAS+ mm, from whatever the brain is given as."""

from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import read_surface, write_surface, write_vertex_maps
from gyriflow.io.volumes import read_label_volume
from gyriflow.step import step
from gyriflow.surface.labels import label_scheme
from gyriflow.surface.pial import from_hemispheres, from_labels, from_pial, from_shape

files, output, params = list(snakemake.input), snakemake.output, snakemake.params
with step(snakemake.log[0], *files[:2]):
    match params.source:
        case "labels":
            scheme, volume = label_scheme(**params.scheme), read_label_volume(files[0], **params.reading)
            surface = from_labels(volume.labels, volume.affine, scheme, week=params.week, **params.settings)
        case "hemispheres":
            given = *map(read_surface, files[:2]), *map(read_json, files[2:])
            surface = from_hemispheres(*given, week=params.week, **params.reading, **params.settings)
        case source:
            make = {"pial": from_pial, "shape": from_shape}[source]
            surface = make(read_surface(files[0]), week=params.week, **params.reading, **params.settings)
    for part, structure in (("whole", None), ("left", "CortexLeft"), ("right", "CortexRight")):
        write_surface(getattr(output, part), getattr(surface, part), structure)
    write_surface(output.stl, surface.whole)
    if surface.thickness:
        write_vertex_maps(output.thickness, {"cortical thickness (mm)": surface.thickness.values_mm})
    if surface.thickness and output.get("measured_thickness"):
        write_vertex_maps(output.measured_thickness, {"thickness_mm": surface.thickness.measured_mm})
    write_json(output.report, {"week": params.week, "fissure_x_mm": surface.fissure_x_mm, **surface.report})
