"""The poses of the hemispheres of a study's brains, each from its files and shape, all with one pitch.

A refused brain does not stop the others: its file holds the reason, and the step that needs its pose ends with it.
"""

import logging

from gyriflow.errors import InputError, MeshError
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_hemispheres
from gyriflow.step import step
from gyriflow.surface.halves import pair_by_shape
from gyriflow.surface.pial import hemisphere
from gyriflow.surface.posing import poses

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
