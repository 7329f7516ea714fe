"""Maps of a shape measure on simulated and measured brains, week by week."""

import numpy as np

from gyriflow.geometry.triangles import merged
from gyriflow.io.figures import write_figure
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.report.renders import scalar_maps
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
measure = snakemake.wildcards.measure


def brains(weeks, left, right, maps):
    """Returns by week the two hemispheres as one surface with its values; the maps of all left ones come first."""
    values = [read_vertex_maps(file)[measure] for file in maps]
    surfaces = [merged(read_surface(a), read_surface(b)) for a, b in zip(left, right, strict=True)]
    both = map(np.concatenate, zip(values[: len(weeks)], values[len(weeks) :], strict=True))
    return dict(zip(weeks, zip(surfaces, both, strict=True), strict=True))


with step(snakemake.log[0]):
    simulated = files.simulated_left, files.simulated_right, files.simulated_maps
    maps = {"simulated": brains(params.simulated_weeks, *simulated)}
    if files.real_left:
        maps[params.measured] = brains(params.real_weeks, files.real_left, files.real_right, files.real_maps)
    figure = scalar_maps(maps, quantity=measure, measured=params.measured, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
