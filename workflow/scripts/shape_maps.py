"""Maps of the shape index, the curvedness or the sulcal depth on simulated and measured brains, week by week."""

import numpy as np

from gyriflow.geometry.triangles import merged
from gyriflow.io.figures import write_figure
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.report.renders import scalar_maps
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
run, measure = snakemake.wildcards.run, snakemake.wildcards.measure


def brains(weeks, surfaces, maps):
    """Returns by week the two hemispheres as one surface with its values; all left files come first."""
    files = zip(surfaces, maps, strict=True)
    halves = [(read_surface(surface), read_vertex_maps(values)[measure]) for surface, values in files]
    pairs = zip(weeks, halves[: len(weeks)], halves[len(weeks) :], strict=True)
    return {week: (merged(a, b), np.concatenate([of_a, of_b])) for week, (a, of_a), (b, of_b) in pairs}


with step(snakemake.log[0]):
    maps = {"simulated": brains(params.simulated_weeks, files.simulated, files.simulated_maps)}
    if files.real:
        maps[params.measured] = brains(params.real_weeks, files.real, files.real_maps)
    shown = {"title": f"run {run}", "measured": params.measured, "synthetic": params.synthetic}
    figure = scalar_maps(maps, quantity=measure, **shown)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
