"""The surfaces that all runs from a start brain are compared with in a week, ready and with their curvature."""

from gyriflow.compare.shapes import ready
from gyriflow.io.surfaces import read_surface, write_surface, write_vertex_maps
from gyriflow.metrics.curvature import curvature
from gyriflow.step import step

files, output = snakemake.input, snakemake.output
with step(snakemake.log[0]):
    real = read_surface(files.real)
    for name in ("real", "start", "adjacent"):
        even = ready(real if name == "real" else read_surface(files[name]), real)
        bend = curvature(even, radius_mm=snakemake.params.curvature_radius_mm)
        write_surface(output[name], even)
        maps = {"mean_curvature": bend.mean, "shape_index": bend.shape_index}
        write_vertex_maps(output[f"{name}_maps"], maps)
