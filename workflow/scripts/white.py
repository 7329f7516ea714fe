"""Make the white surfaces of a brain from its labels or from given files, and measure
them."""

from gyriflow.anatomy.thickness import white_from_labels, white_from_surfaces
from gyriflow.io.files import write_table
from gyriflow.io.surfaces import (
    STRUCTURES,
    read_pose,
    read_surface,
    write_surface,
    write_vertex_maps,
)
from gyriflow.metrics.measure import measure_white
from gyriflow.settings.terms import SIDES
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
labels = params.labels
with step(snakemake.log[0], *files.given):
    pial = {side: read_surface(files[side]) for side in SIDES if files.get(side)}
    pose = read_pose(files.report)
    if labels:
        volume = labels.read(cropped=True)
        sides = white_from_labels(
            volume.labels, volume.affine, labels.scheme, pial, pose, **params.surface
        )
    else:
        whites = {name: read_surface(path, name) for name, path in params.white.items()}
        sides = white_from_surfaces(whites, pial, pose, **params.surface)
    table, maps = measure_white(sides, params.curvature_radius_mm)
    write_table(
        output.metrics,
        table.assign(**params.columns)[[*params.columns, *table.columns]],
    )
    for side, mesh in sides.items():
        write_surface(
            output[f"{side}_surface"],
            mesh,
            STRUCTURES[side],
            "GrayWhite",
        )
        write_vertex_maps(
            output[f"{side}_maps"],
            maps[side],
            STRUCTURES[side],
        )
