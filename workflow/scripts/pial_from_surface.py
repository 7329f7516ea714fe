"""The clean pial surface of a brain and of its hemispheres in RAS+ mm, from one closed surface."""

from gyriflow.anatomy.pial import from_surface
from gyriflow.io.downloads import require_checksums
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_surface, write_brain
from gyriflow.step import step

file, output, params = snakemake.input[0], snakemake.output, snakemake.params
with step(snakemake.log[0], file):
    require_checksums(params.known)
    surface = from_surface(read_surface(file), week=params.week, coordinates=params.coordinates, **params.settings)
    write_brain(output, surface.whole, surface.left, surface.right)
    write_json(output.report, surface.report)
