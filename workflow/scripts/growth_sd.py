"""Write the standard deviation of the growth maps of an ensemble."""

from gyriflow.growth.rates import growth_sd
from gyriflow.io.surfaces import read_vertex_maps, write_vertex_maps
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0]):
    run = read_vertex_maps(files.run)
    members = [read_vertex_maps(path) for path in files.members]
    write_vertex_maps(snakemake.output[0], growth_sd(run, members))
