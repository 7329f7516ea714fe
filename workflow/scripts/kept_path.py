"""Copy the path of an atlas that an earlier study has kept."""

from gyriflow.io.registrations import read_weekly_shapes, write_weekly_shapes
from gyriflow.step import step

with step(snakemake.log[0]):
    write_weekly_shapes(snakemake.output[0], read_weekly_shapes(snakemake.params.kept))
