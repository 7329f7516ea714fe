"""The poses of the hemispheres of a study's brains, each from its files and shape, all with one pitch.

A refused brain does not stop the others: its file holds the reason, and the step that needs its pose ends with it.
"""

import logging

from gyriflow.anatomy.plausible import Limits
from gyriflow.anatomy.pose import pairs_by_shape, poses
from gyriflow.anatomy.repair import sound_pieces
from gyriflow.errors import InputError, MeshError
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_hemispheres
from gyriflow.step import step

files, params = list(snakemake.input), snakemake.params
with step(snakemake.log[0]):
    brains, named, refused = {}, {}, {}
    names = dict(zip(snakemake.output, zip(files[::2], files[1::2], strict=True), strict=True))
    for path, sides in names.items():
        try:
            *surfaces, named[path] = read_hemispheres(*sides)
            brains[path] = tuple(sound_pieces(side, params.max_hole_mm, one=True).mesh for side in surfaces)
        except (InputError, MeshError) as error:
            refused[path] = error
    pairs = dict(zip(brains, pairs_by_shape(list(brains.values()), Limits(**params.limits)), strict=True))
    refused |= {path: pair for path, pair in pairs.items() if isinstance(pair, InputError)}
    posed = {path: pair for path, pair in pairs.items() if path not in refused}
    for path, pose in zip(posed, poses(list(posed.values()), [named[path] for path in posed]), strict=True):
        write_json(path, pose.plain())
    for path, error in refused.items():
        logging.error("%s: %s", ", ".join(names[path]), error)
        write_json(path, {"refused": str(error)})
