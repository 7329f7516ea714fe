"""Write maps of the spread of an ensemble at a week on a hemisphere of its run."""

from gyriflow.compare.accuracy import ensemble_maps
from gyriflow.io.surfaces import (
    STRUCTURES,
    read_surface,
    read_vertex_maps,
    write_vertex_maps,
)
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0]):
    # the run comes first, then its members
    run, *members = (read_surface(path) for path in files.surfaces)
    values = [read_vertex_maps(path)["shape_index"] for path in files.maps]
    write_vertex_maps(
        snakemake.output[0],
        ensemble_maps(run, members, values),
        STRUCTURES[snakemake.wildcards.side],
    )
