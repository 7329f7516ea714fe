"""The clean pial surface of a brain in RAS+ mm, from the surfaces of its hemispheres."""

from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import read_surface, write_brain
from gyriflow.step import step
from gyriflow.surface.pial import from_hemispheres

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0], files.left, files.right):
    left, right = read_surface(files.left), read_surface(files.right)
    pose = read_json(files.pose) if files.pose else None
    surface = from_hemispheres(left, right, pose, week=params.week, coordinates=params.coordinates, **params.settings)
    write_brain(output, surface.whole, surface.left, surface.right)
    write_json(output.report, surface.report)
