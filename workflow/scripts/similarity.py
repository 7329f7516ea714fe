"""How far a simulated brain's surface is from a measured one of the same week, whole and by hemisphere."""

from gyriflow.io.files import write_table
from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.similarity import brain_distances
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    simulated, real = (
        dict(zip(params.parts, map(read_surface, paths), strict=True)) for paths in (files.simulated, files.real)
    )
    table = brain_distances(simulated, real)
    write_table(snakemake.output[0], table.assign(**params.labels)[[*params.labels, *table.columns]])
