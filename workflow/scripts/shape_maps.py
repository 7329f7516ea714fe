"""Maps of the shape index on simulated and measured brains, week by week."""

import numpy as np

from gyriflow.geometry.triangles import merged
from gyriflow.io.figures import write_figure
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.report.renders import scalar_maps
from gyriflow.report.style import measured_name
from gyriflow.step import step

files, params = snakemake.input, snakemake.params


def brains(weeks, surfaces, maps):
    """Returns by week the two hemispheres as one surface with its shape index; all left files come first."""
    files = zip(surfaces, maps, strict=True)
    halves = [(read_surface(surface), read_vertex_maps(values)["shape_index"]) for surface, values in files]
    pairs = zip(weeks, halves[: len(weeks)], halves[len(weeks) :], strict=True)
    return {week: (merged(a, b), np.concatenate([of_a, of_b])) for week, (a, of_a), (b, of_b) in pairs}


with step(snakemake.log[0]):
    maps = {"simulated": brains(params.simulated_weeks, files.simulated, files.simulated_maps)}
    if files.real:
        maps[measured_name(params.synthetic)] = brains(params.real_weeks, files.real, files.real_maps)
    title = f"run {snakemake.wildcards.run}"
    figure = scalar_maps(maps, quantity="shape_index", title=title, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
