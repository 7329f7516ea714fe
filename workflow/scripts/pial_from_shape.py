"""A simple geometry as the pial surface of a brain, its halves as hemispheres."""

from gyriflow.anatomy.pial import from_shape
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_surface, write_brain
from gyriflow.step import step

output = snakemake.output
with step(snakemake.log[0], snakemake.input[0]):
    surface = from_shape(read_surface(snakemake.input[0]), week=snakemake.params.week)
    write_brain(output, surface.whole, surface.left, surface.right)
    write_json(output.report, surface.report)
