"""Prepare what all runs from a start brain are compared with at a week."""

from gyriflow.compare.shapes import interpolate_measures, prepare_for_comparison
from gyriflow.io.surfaces import read_surface, write_surface, write_vertex_maps
from gyriflow.step import step

files, output = snakemake.input, snakemake.output
radius_mm = snakemake.params.curvature_radius_mm
with step(snakemake.log[0]):
    surface = read_surface(files.observed)
    observed = prepare_for_comparison(surface, surface, radius_mm)
    write_surface(output.observed, observed.mesh)
    maps = {
        "mean_curvature": observed.mean_curvature,
        "shape_index": observed.shape_index,
    }
    write_vertex_maps(output.observed_maps, maps)
    # before the second week, both are the start brain
    for path in {files.start, files.adjacent}:
        baseline = prepare_for_comparison(read_surface(path), surface, radius_mm)
        maps, _ = interpolate_measures(baseline, observed)
        for name in ("start", "adjacent"):
            if files[name] == path:
                write_vertex_maps(output[f"{name}_maps"], maps)
