"""Cortical thickness at the vertices of a brain's pial surface: its distance from the white surfaces."""

from gyriflow.anatomy.thickness import thickness_from_white
from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import read_one_hemisphere, read_pose, read_surface, write_vertex_maps
from gyriflow.parameters.terms import SIDES
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0], *params.white.values()):
    whites = {
        side: read_one_hemisphere(path, side) if side in SIDES else read_surface(path)
        for side, path in params.white.items()
    }
    fissure_x = read_json(files.report)["fissure_x_mm"]
    thickness = thickness_from_white(read_surface(files.surface), read_pose(files.report), fissure_x, whites)
    write_vertex_maps(snakemake.output.thickness, {"cortical thickness (mm)": thickness.values_mm})
    write_vertex_maps(snakemake.output.measured, {"thickness_mm": thickness.measured_mm})
    write_json(snakemake.output.report, thickness.report)
