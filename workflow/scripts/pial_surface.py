"""The clean pial surface of a brain and of its hemispheres in RAS+ mm, from whatever the brain is given as."""

from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import read_surface, write_surface, write_vertex_maps
from gyriflow.io.volumes import read_label_volume
from gyriflow.step import step
from gyriflow.surface.from_labels import from_labels, hemisphere_from_labels, thickness_from_labels
from gyriflow.surface.from_surfaces import from_hemisphere, from_hemispheres, from_pial
from gyriflow.surface.labels import label_scheme
from gyriflow.surface.limits import Limits
from gyriflow.surface.pial import from_shape

files, output, params = list(snakemake.input), snakemake.output, snakemake.params
with step(snakemake.log[0], *files[:2]):
    match params.source:
        case "labels":
            scheme, volume = label_scheme(**params.scheme), read_label_volume(files[0], **params.reading)
            surface = from_labels(volume.labels, volume.affine, scheme, week=params.week, **params.settings)
            if scheme.cortex:
                smoothing = params.settings["smoothing_voxels"]
                thickness, said = thickness_from_labels(surface, volume.labels, volume.affine, scheme, smoothing)
                write_vertex_maps(output.thickness, {"cortical thickness (mm)": thickness.values_mm})
                surface.report["cortical_thickness"] = thickness.report
                surface.report["warnings"] += said
        case "hemisphere" if params.scheme:
            volume = read_label_volume(files[0], **params.reading)
            given = volume.labels, volume.affine, label_scheme(**params.scheme), params.side
            surface = hemisphere_from_labels(*given, week=params.week, **params.settings)
        case "hemisphere":
            reading = params.reading | params.settings
            surface = from_hemisphere(read_surface(files[0]), params.side, week=params.week, **reading)
        case "hemispheres":
            given = *map(read_surface, files[:2]), *map(read_json, files[2:])
            reading = params.reading | {"limits": Limits(**params.limits)}
            surface = from_hemispheres(*given, week=params.week, **reading, **params.settings)
        case source:
            make = {"pial": from_pial, "shape": from_shape}[source]
            surface = make(read_surface(files[0]), week=params.week, **params.reading, **params.settings)
    for part, structure in (("whole", None), ("left", "CortexLeft"), ("right", "CortexRight")):
        if getattr(surface, part):
            write_surface(output[part], getattr(surface, part), structure)
    write_surface(output.stl, surface.whole)
    write_json(output.report, {"week": params.week, "fissure_x_mm": surface.fissure_x_mm, **surface.report})
