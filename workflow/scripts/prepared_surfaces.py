"""Prepare the surfaces with which all runs from a start brain are compared at a
week."""

from gyriflow.compare.shapes import prepare_for_comparison
from gyriflow.io.surfaces import read_surface, write_surface, write_vertex_maps
from gyriflow.step import step

files, output = snakemake.input, snakemake.output
with step(snakemake.log[0]):
    observed = read_surface(files.observed)
    surfaces = {
        "observed": observed,
        "start": read_surface(files.start),
        "adjacent": read_surface(files.adjacent),
    }
    for name, surface in surfaces.items():
        prepared = prepare_for_comparison(
            surface, observed, snakemake.params.curvature_radius_mm
        )
        write_surface(output[name], prepared.mesh)
        maps = {
            "mean_curvature": prepared.mean_curvature,
            "shape_index": prepared.shape_index,
        }
        write_vertex_maps(output[f"{name}_maps"], maps)
