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
from gyriflow.surface.white import thickness_from_white

files, output, params = snakemake.input, snakemake.output, snakemake.params
given, settings = list(files.brain), params.settings | {"week": params.week}
with step(snakemake.log[0], *given):
    thickness = None
    if params.scheme:
        volume, scheme = read_label_volume(given[0], **params.reading), label_scheme(**params.scheme)
        labels = volume.labels, volume.affine, scheme
        make = hemisphere_from_labels if params.side else from_labels
        surface = make(*labels, *filter(None, [params.side]), **settings)
        if "thickness" in output.keys():  # noqa: SIM118
            thickness = thickness_from_labels(surface, *labels, params.settings["smoothing_voxels"])
    else:
        single = {"pial": from_pial, "shape": from_shape, "hemisphere": from_hemisphere}
        make = single.get(params.source, from_hemispheres)
        more = [params.side] if params.side else [read_json(files.pose)] if files.pose else []
        limits = {"limits": Limits(**params.limits)} if params.limits else {}
        surface = make(*map(read_surface, given), *more, **params.reading, **settings, **limits)
        if params.white:
            whites = {side: read_surface(path) for side, path in params.white.items()}
            thickness = thickness_from_white(surface, whites)
    if thickness:
        surface.report["cortical_thickness"] = thickness.report
    if "thickness" in output.keys():  # noqa: SIM118
        write_vertex_maps(output.thickness, {"cortical thickness (mm)": thickness.values_mm})
    for part, structure in (("whole", None), ("left", "CortexLeft"), ("right", "CortexRight")):
        if getattr(surface, part):
            write_surface(output[part], getattr(surface, part), structure)
    write_surface(output.stl, surface.whole)
    write_json(output.report, surface.report)
