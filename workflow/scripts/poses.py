"""The poses of the hemispheres of a study's brains, each from its files and shape, all with one pitch."""

from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_hemispheres
from gyriflow.step import step
from gyriflow.surface.halves import pair_by_shape
from gyriflow.surface.pial import hemisphere
from gyriflow.surface.posing import poses

with step(snakemake.log[0]):
    files = list(snakemake.input)
    pairs, named = [], []
    for left, right in zip(files[::2], files[1::2], strict=True):
        *surfaces, same = read_hemispheres(left, right)
        sides = [hemisphere(surface, snakemake.params.max_hole_mm)[0] for surface in surfaces]
        pairs.append(pair_by_shape(*sides, path=f"{left}, {right}"))
        named.append(same)
    for path, found in zip(snakemake.output, poses(pairs, named), strict=True):
        write_json(path, found.report)
