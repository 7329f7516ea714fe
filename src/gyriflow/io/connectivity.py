"""The triangles of surface files, apart from where they lie: what tells whether surfaces are matched."""

import hashlib
from functools import cache
from pathlib import Path

import numpy as np

from .surfaces import read_surface


def connectivity(path: Path) -> tuple[int, int, str]:
    """Returns the numbers of vertices and of triangles of a surface file, and a digest of its triangles.

    Neither the order of the triangles nor that of their corners matters. InputError as for `read_surface`.
    """
    state = path.stat() if path.exists() else None
    return _connectivity(path, None if state is None else (state.st_mtime_ns, state.st_size))


@cache
def _connectivity(path: Path, _: tuple[int, int] | None) -> tuple[int, int, str]:
    """Returns the same, once for each state of a file."""
    mesh = read_surface(path)
    triangles = np.sort(mesh.faces, axis=1)
    triangles = triangles[np.lexsort(triangles.T)]
    digest = hashlib.sha256(np.ascontiguousarray(triangles)).hexdigest()
    return len(mesh.vertices), len(mesh.faces), digest
