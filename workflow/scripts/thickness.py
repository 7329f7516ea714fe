"""Cortical thickness at the vertices of a brain's pial surface, from labels of the cortex or from white surfaces."""

from gyriflow.anatomy.thickness import thickness_from_labels, thickness_from_white
from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import read_one_hemisphere, read_pose, read_surface, write_vertex_maps
from gyriflow.settings.terms import SIDES
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0], *files.given):
    surface, pose = read_surface(files.surface), read_pose(files.report)
    fissure = read_json(files.report)["fissure_x_mm"]
    if labels := params.labels:
        volume = labels.read(cropped=True)
        thickness = thickness_from_labels(volume.labels, volume.affine, labels.scheme, surface, pose, fissure)
    else:
        whites = {
            side: read_one_hemisphere(path, side) if side in SIDES else read_surface(path)
            for side, path in params.white.items()
        }
        thickness = thickness_from_white(surface, pose, fissure, whites)
    write_vertex_maps(output.thickness, {"cortical thickness (mm)": thickness.values_mm})
    write_vertex_maps(output.measured, {"thickness_mm": thickness.measured_mm})
    write_json(output.report, thickness.report)
