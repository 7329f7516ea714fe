"""Where the vertices of a brain's surface are in another brain whose surface has the same ones."""

from gyriflow.geometry.deformations import between_moved
from gyriflow.growth.matched_surfaces import match_surfaces
from gyriflow.io.registrations import write_matched_surfaces
from gyriflow.io.surfaces import read_pose, read_surface
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0], files.earlier, files.later):
    found, report = match_surfaces(read_surface(files.earlier), read_surface(files.later))
    # correspondences are between the brains' own worlds, as registrations are
    first, second = (read_pose(path).inverse for path in (files.earlier_report, files.later_report))
    write_matched_surfaces(snakemake.output[0], between_moved(found, first, second), report)
