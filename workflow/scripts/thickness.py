"""Cortical thickness at the vertices of a brain's pial surface, from labels of the cortex or from white surfaces."""

from gyriflow.anatomy.thickness import thickness_from_labels, thickness_from_white
from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import read_one_hemisphere, read_pose, read_surface, write_vertex_maps
from gyriflow.io.volumes import read_label_volume
from gyriflow.settings.schemes import LabelScheme
from gyriflow.settings.terms import SIDES
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0], *params.given.values()):
    surface, pose = read_surface(files.surface), read_pose(files.report)
    fissure = read_json(files.report)["fissure_x_mm"]
    if labels := params.given.get("labels"):
        volume, scheme = read_label_volume(labels, affine_from=params.affine_from, cropped=True), params.scheme
        known = volume.labels, volume.affine, LabelScheme(**scheme), surface, pose, fissure
        thickness = thickness_from_labels(*known)
    else:
        whites = {
            side: read_one_hemisphere(path, side) if side in SIDES else read_surface(path)
            for side, path in params.given.items()
        }
        thickness = thickness_from_white(surface, pose, fissure, whites)
    write_vertex_maps(output.thickness, {"cortical thickness (mm)": thickness.values_mm})
    write_vertex_maps(output.measured, {"thickness_mm": thickness.measured_mm})
    write_json(output.report, thickness.report)
