"""The surfaces that all runs from a start brain are compared with in a week, ready and with their curvature."""

from gyriflow.compare.shapes import prepare_for_comparison
from gyriflow.io.surfaces import read_surface, write_surface, write_vertex_maps
from gyriflow.step import step

files, output = snakemake.input, snakemake.output
with step(snakemake.log[0]):
    real = read_surface(files.real)
    for name in ("real", "start", "adjacent"):
        surface = real if name == "real" else read_surface(files[name])
        shape = prepare_for_comparison(surface, real, snakemake.params.curvature_radius_mm)
        write_surface(output[name], shape.mesh)
        maps = {"mean_curvature": shape.mean_curvature, "shape_index": shape.shape_index}
        write_vertex_maps(output[f"{name}_maps"], maps)
