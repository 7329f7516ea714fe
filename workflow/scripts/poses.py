"""The poses of the hemispheres of a study's brains, each from its files and shape, all with one pitch.

A brain that is refused does not hold up the others: its file says why, and the step that needs its pose ends with that.
"""

import logging

from gyriflow.errors import InputError, MeshError
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_hemispheres
from gyriflow.step import step
from gyriflow.surface.from_surfaces import hemisphere
from gyriflow.surface.hemisphere_pose import pair_by_shape
from gyriflow.surface.study_poses import poses

files = list(snakemake.input)
with step(snakemake.log[0]):
    pairs, named = {}, []
    for path, left, right in zip(snakemake.output, files[::2], files[1::2], strict=True):
        try:
            *surfaces, same = read_hemispheres(left, right)
            pairs[path] = pair_by_shape(*(hemisphere(side, snakemake.params.max_hole_mm)[0] for side in surfaces))
            named.append(same)
        except (InputError, MeshError) as error:
            logging.error("%s, %s: %s", left, right, error)
            write_json(path, {"refused": str(error)})
    for path, found in zip(pairs, poses(list(pairs.values()), named), strict=True):
        write_json(path, found.report)
