"""Make the pial surface of a brain and of its hemispheres in RAS+ mm, and its
thickness, from labels or surfaces."""

from gyriflow.anatomy.pial import (
    from_hemispheres,
    from_labels,
    from_shape,
    from_surface,
)
from gyriflow.anatomy.thickness import thickness_from_labels, thickness_from_white
from gyriflow.io.downloads import require_checksums
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import (
    read_hemispheres,
    read_pose,
    read_surface,
    write_brain,
    write_vertex_maps,
)
from gyriflow.step import step

output, params = snakemake.output, snakemake.params
files, volumes, labels = snakemake.input.given, {}, params.labels
settings = {"week": params.week, **params.settings}
with step(
    snakemake.log[0],
    *files,
    *snakemake.input.white,
):
    require_checksums(params.checksums)
    if labels:
        volume = labels.read(cropped=True)
        surface = from_labels(
            volume.labels, volume.affine, labels.scheme, params.side, **settings
        )
        volumes = {"volumes_by_number_mL": volume.volumes_ml}
    elif params.source == "hemispheres":
        left, right, declared = read_hemispheres(*files)
        settings |= {"coordinates": params.coordinates, **params.limits}
        surface = from_hemispheres(left, right, declared=declared, **settings)
    elif params.source == "shape":
        surface = from_shape(read_surface(files[0]), **settings)
    else:
        surface = from_surface(
            read_surface(files[0], params.side),
            params.side,
            coordinates=params.coordinates,
            **settings,
        )
    write_brain(output, surface.whole, surface.left, surface.right)
    write_json(output.report, surface.report | volumes)
    if output.get("thickness"):
        pial = read_surface(output.whole)
        pose = read_pose(output.report)
        fissure = surface.report["fissure_x_mm"]
        if labels:
            thickness = thickness_from_labels(surface.cortex, pial, pose, fissure)
        else:
            whites = {
                side: read_surface(path, side) for side, path in params.white.items()
            }
            thickness = thickness_from_white(pial, pose, fissure, whites)
        write_vertex_maps(
            output.thickness, {"cortical thickness (mm)": thickness.values_mm}
        )
        write_vertex_maps(output.measured, {"thickness_mm": thickness.measured_mm})
        write_json(output.summary, thickness.report)
