"""Write the standard deviation of the growth maps of an ensemble."""

from gyriflow.growth.maps import growth_sd
from gyriflow.io.surfaces import read_vertex_maps, write_vertex_maps
from gyriflow.step import step

with step(snakemake.log[0]):
    write_vertex_maps(snakemake.output[0], growth_sd([read_vertex_maps(path) for path in snakemake.input]))
