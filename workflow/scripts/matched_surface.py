"""The surface of a brain as it is given, with all its vertices, in the pose of the repaired one and of the mesh."""

from gyriflow.geometry.triangles import merged, transformed
from gyriflow.growth.matched_surfaces import outward
from gyriflow.io.surfaces import read_pose, read_surface, write_surface
from gyriflow.parameters.terms import SIDES
from gyriflow.step import step

files = snakemake.params.files
with step(snakemake.log[0], *files):
    pose = read_pose(snakemake.input.report)
    # hemispheres may have come in poses of their own
    motions = [pose.of_file(side) for side in SIDES[: len(files)]]
    parts = [transformed(outward(read_surface(path)), motion) for path, motion in zip(files, motions, strict=True)]
    write_surface(snakemake.output[0], merged(*parts), "Cortex")
