"""The clean pial surface of a brain in RAS+ mm, from the surfaces of its hemispheres."""

from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import read_one_hemisphere, write_brain
from gyriflow.step import step
from gyriflow.surface.from_surfaces import from_hemispheres
from gyriflow.surface.limits import Limits

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0], files.left, files.right):
    left, right = read_one_hemisphere(files.left, "left"), read_one_hemisphere(files.right, "right")
    pose = read_json(files.pose) if files.pose else None
    settings = params.settings | {"coordinates": params.coordinates, "limits": Limits(**params.limits)}
    surface = from_hemispheres(left, right, pose, week=params.week, **settings)
    write_brain(output, surface.whole, surface.left, surface.right)
    write_json(output.report, surface.report)
