"""Whether the surfaces of a growth series have the same vertices, as their files say."""

from collections.abc import Collection, Sequence
from pathlib import Path

from ..errors import InputError
from ..io.connectivity import connectivity
from .atlas import UsedAtlas
from .brains import Brain


def believed_files(atlases: Sequence[UsedAtlas]) -> set[str]:
    """Returns the missing files of atlases whose description says that their surfaces are matched."""
    return {str(file.path) for atlas in atlases for file in atlas.missing if atlas.atlas.series[file.series].matched}


def why_unmatched(brains: Sequence[Brain], believed: Collection[str] = ()) -> str | None:
    """Returns why the surfaces of brains are not matched by their vertices; None where they are.

    They are where all brains are given by surface files of one kind, with as many vertices and the same triangles for
    each hemisphere. Files that are `believed` to be so need not be there.
    """
    first = brains[0]
    for brain in brains:
        if brain.source != first.source:
            return f"{brain.id} is given as {brain.source}, {first.id} as {first.source}"
    known: list[tuple[str, list[tuple[int, int, str]]]] = []
    for brain in brains:
        if believed and all(path in believed for path in brain.files):
            continue
        try:
            known.append((brain.id, [connectivity(Path(path)) for path in brain.files]))
        except InputError as error:
            return str(error)
        (name, expected), (other, found) = known[0], known[-1]
        for one, two in zip(expected, found, strict=True):
            if one[:2] != two[:2]:
                return f"{other} has {two[0]} vertices and {two[1]} triangles where {name} has {one[0]} and {one[1]}"
            if one != two:
                return f"{other} has other triangles than {name}"
    return None
