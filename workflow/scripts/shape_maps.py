"""Maps of a shape measure on simulated and measured brains, week by week."""

import numpy as np

from gyriflow.geometry.triangles import merged
from gyriflow.io.figures import write_figure
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.report.renders import scalar_maps
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
run, measure = snakemake.wildcards.run, snakemake.wildcards.measure


def brains(weeks, left, right, maps):
    """Returns by week the two hemispheres as one surface with its values; the maps of all left ones come first."""
    surfaces = [merged(read_surface(a), read_surface(b)) for a, b in zip(left, right, strict=True)]
    # thickness is not known of every brain
    found = [read_vertex_maps(file).get(measure) for file in maps]
    pairs = zip(surfaces, found[: len(weeks)], found[len(weeks) :], strict=True)
    both = [np.full(len(m.vertices), np.nan) if a is None else np.concatenate([a, b]) for m, a, b in pairs]
    return dict(zip(weeks, zip(surfaces, both, strict=True), strict=True))


with step(snakemake.log[0]):
    simulated = files.simulated_left, files.simulated_right, files.simulated_maps
    maps = {"simulated": brains(params.simulated_weeks, *simulated)}
    if files.real_left:
        maps[params.measured] = brains(params.real_weeks, files.real_left, files.real_right, files.real_maps)
    shown = {"title": f"run {run}", "measured": params.measured, "synthetic": params.synthetic}
    figure = scalar_maps(maps, quantity=measure, **shown)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
