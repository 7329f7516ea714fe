"""Write a simple shape as a closed surface instead of a brain's."""

from gyriflow.anatomy.shapes import shape_surface
from gyriflow.io.surfaces import write_surface
from gyriflow.step import step

with step(snakemake.log[0]):
    write_surface(
        snakemake.output[0],
        shape_surface(**snakemake.params.shape),
    )
