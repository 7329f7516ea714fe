"""Write the correspondence of two brains whose surfaces have the same vertices."""

from gyriflow.geometry.deformations import between_moved
from gyriflow.geometry.triangles import merged, outward, transformed
from gyriflow.growth.carrying import match_surfaces
from gyriflow.io.registrations import write_correspondence
from gyriflow.io.surfaces import read_pose, read_surface
from gyriflow.settings.terms import SIDES
from gyriflow.step import step

first, second = snakemake.params.files
with step(snakemake.log[0], *first, *second):
    poses, surfaces = [read_pose(path) for path in snakemake.input.reports], []
    for files, pose in zip(
        (first, second),
        poses,
        strict=True,
    ):
        # each hemisphere may have its own pose
        sides = zip(
            files,
            SIDES[: len(files)],
            strict=True,
        )
        surfaces.append(
            merged(
                *(
                    transformed(outward(read_surface(path)), pose.of_file(side))
                    for path, side in sides
                )
            )
        )
    found, report = match_surfaces(*surfaces)
    # correspondences are in the coordinates of the files, like registrations
    between = between_moved(found, *(pose.inverse for pose in poses))
    write_correspondence(snakemake.output[0], between, report)
