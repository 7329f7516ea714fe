"""Maps of a shape measure on simulated and measured brains, week by week."""

import numpy as np

from gyriflow.geometry.triangles import merged
from gyriflow.io.figures import write_figure
from gyriflow.io.surfaces import read_surface, read_vertex_maps
from gyriflow.report.renders import scalar_maps
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
measure = snakemake.wildcards.measure


def brains(weeks, surfaces, maps):
    """Returns by week the hemispheres as one surface with its values; the files of one side come after the other's."""
    found = {}
    for number, week in enumerate(weeks):
        parts = [read_surface(file) for file in surfaces[number :: len(weeks)]]
        # thickness is not known of every brain
        values = [read_vertex_maps(file).get(measure) for file in maps[number :: len(weeks)]]
        values = [np.full(len(p.vertices), np.nan) if v is None else v for p, v in zip(parts, values, strict=True)]
        found[week] = merged(*parts), np.concatenate(values)
    return found


with step(snakemake.log[0]):
    maps = {"simulated": brains(params.simulated_weeks, files.simulated, files.simulated_maps)}
    if files.real:
        maps[params.measured] = brains(params.real_weeks, files.real, files.real_maps)
    figure = scalar_maps(maps, quantity=measure, measured=params.measured, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
