"""The clean pial surface of a brain in RAS+ mm, from the surfaces of its hemispheres."""

from gyriflow.anatomy.pial import from_hemispheres
from gyriflow.anatomy.plausible import Limits
from gyriflow.io.downloads import require_checksums
from gyriflow.io.files import write_json
from gyriflow.io.poses import read_pose
from gyriflow.io.surfaces import read_one_hemisphere, write_brain
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0], files.left, files.right):
    require_checksums(params.known)
    left, right = read_one_hemisphere(files.left, "left"), read_one_hemisphere(files.right, "right")
    pose = read_pose(files.pose) if files.pose else None
    settings = params.settings | {"coordinates": params.coordinates, "limits": Limits(**params.limits)}
    surface = from_hemispheres(left, right, pose, week=params.week, **settings)
    write_brain(output, surface.whole, surface.left, surface.right)
    write_json(output.report, surface.report)
