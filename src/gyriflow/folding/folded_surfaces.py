"""Pial surfaces of a folded brain; imports neither MPI nor dolfinx."""

from ..geometry.triangles import Floats, Mask, TriangleMesh, submesh, used_part
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
    whole, _ = used_part(surface)
    is_left = regions.facet_tags["hemisphere"] == LEFT
    return whole, _part(surface, is_left), _part(surface, ~is_left)


def _part(surface: TriangleMesh, faces: Mask) -> TriangleMesh | None:
    if not faces.any():
        return None
    part, _ = submesh(surface, faces)
    return part
