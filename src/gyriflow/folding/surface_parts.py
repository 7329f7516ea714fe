"""A surface split between ranks: each pair of vertices, edges or faces near each other belongs to one rank.

Each rank owns a compact set of vertices and has a part of the surface: all faces that can come near its own. A pair
belongs to the owner of one of its vertices. That rank has all faces at the vertices of the pair, so that area weights
and contributions of several faces are those of the whole surface.
"""

from dataclasses import dataclass

import ipctk
import numpy as np
from numpy.typing import NDArray

from ..geometry.triangles import Floats, TriangleMesh, edges


@dataclass(frozen=True, eq=False)
class SurfacePart:
    """A rank's part of a surface.

    The (p,) numbers of its vertices in the whole surface, ascending; (f, 3) faces and (e, 2) edges by numbers of these,
    each edge once; and which of its vertices the rank owns.
    """

    vertices: NDArray[np.int64]
    faces: NDArray[np.int32]
    edges: NDArray[np.int32]
    owned: NDArray[np.bool_]

    def restrict(self, values: Floats) -> Floats:
        """Return the (p, 3) values at the part's vertices from those of the whole surface, in Fortran order."""
        return np.asfortranarray(values[self.vertices])

    def owned_pairs(self, pairs: ipctk.NormalCollisions) -> ipctk.NormalCollisions:
        """Return the pairs that belong to this rank; each pair of the surface belongs to one rank.

        The vertex that decides is the lower of two, the one opposite an edge or a face, or the lowest of two edges.
        """
        if self.owned.all():
            return pairs
        owned: list[bool] = list(self.owned)
        lowest: list[int] = list(self.edges[:, 0])
        result = ipctk.NormalCollisions()
        result.use_area_weighting = pairs.use_area_weighting
        result.vv_collisions = [pair for pair in pairs.vv_collisions if owned[min(pair.vertex0_id, pair.vertex1_id)]]
        result.ev_collisions = [pair for pair in pairs.ev_collisions if owned[pair.vertex_id]]
        result.ee_collisions = [
            pair for pair in pairs.ee_collisions if owned[min(lowest[pair.edge0_id], lowest[pair.edge1_id])]
        ]
        result.fv_collisions = [pair for pair in pairs.fv_collisions if owned[pair.vertex_id]]
        return result


def bisect_points(positions: Floats, count: int) -> NDArray[np.int64]:
    """Divide (n, 3) points into `count` boxes with nearly equal numbers of points; return the box (n,) of each point.

    A box is split across its longest side, in proportion to the counts on both sides, and so on (recursive coordinate
    bisection, Berger and Bokhari 1987).
    """
    box = np.zeros(len(positions), dtype=np.int64)
    stack: list[tuple[NDArray[np.int64], int, int]] = [(np.arange(len(positions)), 0, count)]
    while stack:
        inside, first, number = stack.pop()
        if number == 1 or not len(inside):
            box[inside] = first
            continue
        axis = np.ptp(positions[inside], axis=0).argmax()
        inside = inside[np.argsort(positions[inside, axis], kind="stable")]
        low = number // 2
        cut = len(inside) * low // number
        stack += [(inside[:cut], first, low), (inside[cut:], first + low, number - low)]
    return box


def part_of_surface(
    positions: Floats, faces: NDArray[np.integer], owned: NDArray[np.bool_], reach: float
) -> SurfacePart:
    """Return the part of a surface that has all pairs of the (n,) `owned` vertices.

    `reach` is the largest distance, along the axes, between the two sides of a pair.
    """
    if owned.all():
        near = np.ones(len(faces), dtype=bool)
    else:
        low, high = positions[faces].min(axis=1), positions[faces].max(axis=1)
        owned_faces = owned[faces].any(axis=1)
        near = (low <= high[owned_faces].max(axis=0) + reach).all(axis=1) & (
            high >= low[owned_faces].min(axis=0) - reach
        ).all(axis=1)
        # and the faces that adjoin these, for the areas at their vertices
        touched = np.zeros(len(positions), dtype=bool)
        touched[faces[near]] = True
        near = touched[faces].any(axis=1)
    vertices, numbers = np.unique(faces[near], return_inverse=True)
    numbers = numbers.reshape(-1, 3)
    sides = edges(TriangleMesh(positions[vertices], numbers))[0]
    return SurfacePart(
        vertices, np.asfortranarray(numbers, dtype=np.int32), np.asfortranarray(sides, dtype=np.int32), owned[vertices]
    )
