"""A surface shared out between ranks: of each pair of things that come near each other, one rank takes care.

Each rank owns vertices that lie together, and looks at a part of the surface: all faces that can come near its own.
A pair belongs to the owner of one of its vertices. That rank knows all faces at the pair's vertices, so that weights
made from areas, and what several faces add to one pair, are as on the whole surface.
"""

from dataclasses import dataclass

import ipctk
import numpy as np
from numpy.typing import NDArray

from ..geometry.triangles import Floats, TriangleMesh, edges


@dataclass(frozen=True, eq=False)
class SurfacePart:
    """What a rank looks at of a surface.

    The (p,) numbers of its vertices in the whole surface, ascending; (f, 3) faces and (e, 2) edges by numbers of these,
    each edge once; and which of its vertices are the rank's own.
    """

    vertices: NDArray[np.int64]
    faces: NDArray[np.int32]
    edges: NDArray[np.int32]
    owned: NDArray[np.bool_]

    def at(self, values: Floats) -> Floats:
        """Return the (p, 3) values at the part's vertices from those of the whole surface, column by column."""
        return np.asfortranarray(values[self.vertices])

    def of_own(self, pairs: ipctk.NormalCollisions) -> ipctk.NormalCollisions:
        """Return those of the part's pairs that belong to this rank: each pair of the surface is one rank's.

        The vertex that decides is the lowest of two, the one opposite an edge or a face, or the lowest of two edges.
        """
        if self.owned.all():
            return pairs
        owned: list[bool] = list(self.owned)
        lowest: list[int] = list(self.edges[:, 0])
        kept = ipctk.NormalCollisions()
        kept.use_area_weighting = pairs.use_area_weighting
        kept.vv_collisions = [pair for pair in pairs.vv_collisions if owned[min(pair.vertex0_id, pair.vertex1_id)]]
        kept.ev_collisions = [pair for pair in pairs.ev_collisions if owned[pair.vertex_id]]
        kept.ee_collisions = [
            pair for pair in pairs.ee_collisions if owned[min(lowest[pair.edge0_id], lowest[pair.edge1_id])]
        ]
        kept.fv_collisions = [pair for pair in pairs.fv_collisions if owned[pair.vertex_id]]
        return kept


@dataclass(frozen=True, eq=False)
class SearchRange:
    """A search for all pairs within twice a reach on the way of the surface from (s, 3) positions in mm to others."""

    first: Floats
    last: Floats
    reach: float

    def at(self, distance_mm: float, *places: Floats) -> bool:
        """Return whether the search found all pairs that are within a distance at some other positions."""
        margin = self.reach - distance_mm / 2
        if np.isinf(margin):
            return True
        low, high = np.minimum(self.first, self.last) - margin, np.maximum(self.first, self.last) + margin
        return all(bool((place >= low).all() and (place <= high).all()) for place in places)


def shared_out(positions: Floats, ranks: int) -> NDArray[np.int64]:
    """Return the rank (n,) that owns each vertex at (n, 3) positions: of nearly equal numbers, in a box each.

    The box is halved, or cut as the numbers of ranks on either side want it, across its longest side, and so on
    (recursive coordinate bisection, Berger and Bokhari 1987).
    """
    owner = np.zeros(len(positions), dtype=np.int64)
    boxes: list[tuple[NDArray[np.int64], int, int]] = [(np.arange(len(positions)), 0, ranks)]
    while boxes:
        inside, first, count = boxes.pop()
        if count == 1 or not len(inside):
            owner[inside] = first
            continue
        axis = np.ptp(positions[inside], axis=0).argmax()
        inside = inside[np.argsort(positions[inside, axis], kind="stable")]
        low = count // 2
        cut = len(inside) * low // count
        boxes += [(inside[:cut], first, low), (inside[cut:], first + low, count - low)]
    return owner


def part_of_surface(
    positions: Floats, faces: NDArray[np.integer], owned: NDArray[np.bool_], reach: float
) -> SurfacePart:
    """Return what has to be looked at for the pairs that belong to the (n,) `owned` vertices of a surface.

    `reach` is the largest distance, along the axes, between two things that make a pair.
    """
    if owned.all():
        near = np.ones(len(faces), dtype=bool)
    else:
        low, high = positions[faces].min(axis=1), positions[faces].max(axis=1)
        owned_faces = owned[faces].any(axis=1)
        near = (low <= high[owned_faces].max(axis=0) + reach).all(axis=1) & (
            high >= low[owned_faces].min(axis=0) - reach
        ).all(axis=1)
        # and what adjoins these, for the areas at their vertices
        touched = np.zeros(len(positions), dtype=bool)
        touched[faces[near]] = True
        near = touched[faces].any(axis=1)
    vertices, numbers = np.unique(faces[near], return_inverse=True)
    numbers = numbers.reshape(-1, 3)
    sides = edges(TriangleMesh(positions[vertices], numbers))[0]
    return SurfacePart(
        vertices,
        np.asfortranarray(numbers, dtype=np.int32),
        np.asfortranarray(sides, dtype=np.int32),
        owned[vertices],
    )
