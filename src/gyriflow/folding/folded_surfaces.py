"""Pial surfaces of a folded brain; imports neither MPI nor dolfinx."""

import numpy as np

from ..geometry.triangles import Floats, TriangleMesh, submesh
from ..io.tetmeshes import Regions
from ..settings.terms import LEFT


def folded_surfaces(
    regions: Regions, positions_mm: Floats
) -> tuple[TriangleMesh, TriangleMesh | None, TriangleMesh | None]:
    """Return the pial surface of a folded brain and its left and right part, None if it
    has no such facets.

    `positions_mm` (n, 3) are those of the vertices of the start mesh, whose facets have
    tags of their hemisphere.
    """
    surface = TriangleMesh(positions_mm, regions.facets)
    on_left = regions.facet_tags["hemisphere"] == LEFT
    left, right = (
        submesh(surface, side)[0] if side.any() else None
        for side in (on_left, ~on_left)
    )
    return submesh(surface, np.ones(len(on_left), dtype=bool))[0], left, right
