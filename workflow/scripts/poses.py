"""The poses of the hemispheres of a study's brains, each from its files and shape, all with one pitch."""

from gyriflow.errors import InputError
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import declared, read_surface
from gyriflow.step import step
from gyriflow.surface.halves import pair_by_shape
from gyriflow.surface.pial import hemisphere
from gyriflow.surface.posing import poses

with step(snakemake.log[0]):
    files = list(snakemake.input)
    pairs, named = [], []
    for paths in zip(files[::2], files[1::2], strict=True):
        spaces = []
        for path, structure in zip(paths, ("CortexLeft", "CortexRight"), strict=True):
            space, found = declared(path)
            spaces.append(space)
            if found in ("CortexLeft", "CortexRight") and found != structure:
                raise InputError(
                    "is of the other hemisphere",
                    path=path,
                    found=found,
                    expected=structure,
                    remedy="Swap `left` and `right` in the configuration.",
                )
        sides = [hemisphere(read_surface(path), snakemake.params.max_hole_mm)[0] for path in paths]
        try:
            pairs.append(pair_by_shape(*sides))
        except InputError as error:
            raise InputError(f"{paths[0]} and {paths[1]}: {error}") from error
        named.append(spaces[0] is not None and spaces[0] == spaces[1])
    for path, found in zip(snakemake.output, poses(pairs, named), strict=True):
        write_json(path, found.report)
