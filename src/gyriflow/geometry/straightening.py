"""Straighten the sides of curved tetrahedra that fold over, or are about to."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from .jacobians import EDGES, lower_bounds
from .tetrahedra import PIECES, TetrahedralMesh, boundary_faces, volumes_between
from .triangles import Floats, Indices, Ints, Mask

ROUNDS = 6
"""Number of rounds in which nodes are moved."""
FULL_ROUNDS = 4
"""Number of rounds after these in which nodes are moved to the middles of their
sides."""
PARTS = (1.0, 0.5, 0.25)
"""Parts of the way to the middle of its side that an inner node may move in a round."""
MIN_GAIN = 1e-3
"""Least gain of straightness for which a node moves."""


def straighten_sides(positions: Floats, tets: Indices) -> Floats:
    """Return (n, 3) positions with straighter sides of (m, 10) elements that may fold
    over.

    In each round the nodes of their sides move halfway to the middle of the side, in
    the last ones fully: that may bend elements around. Elements with inverted corners
    still fold over.
    """
    places = positions.copy()
    for number in range(ROUNDS + FULL_ROUNDS):
        bent = tets[may_fold_over(places, tets)]
        if not len(bent):
            break
        middles = bent[:, 4:]
        straight = places[bent[:, EDGES]].mean(axis=2)
        is_full = number >= ROUNDS
        places[middles] = straight if is_full else (straight + places[middles]) / 2
    return places


def may_fold_over(positions: Floats, tets: Indices) -> Mask:
    """Return (m,) whether (m, 10) elements may fold over, or a linear piece between
    their nodes is inverted."""
    pieces = tets[:, PIECES].reshape(-1, 4)
    volumes = volumes_between(positions, pieces)
    by_element = volumes.reshape(len(tets), -1)
    has_inverted_piece = by_element.min(axis=1) <= 0
    return has_inverted_piece | (lower_bounds(positions, tets) <= 0)


@dataclass(frozen=True, eq=False)
class InnerSides:
    """The sides of a mesh's (m, 10) elements that are not on its surface.

    `ends` (n, 2) are the ends of the side in whose middle a node lies, -1 for corners
    and on the surface; `around` (n, m) has the elements around each node.
    """

    tets: Ints
    ends: Ints
    around: sparse.csr_array

    @classmethod
    def of(cls, mesh: TetrahedralMesh) -> "InnerSides":
        """Return the inner sides of a mesh of quadratic elements."""
        middles = mesh.tets[:, 4:]
        ends = np.full(
            (len(mesh.vertices), 2),
            -1,
        )
        ends[middles] = mesh.tets[:, EDGES]
        on_surface, _ = boundary_faces(mesh)
        ends[on_surface] = -1
        n_elements, n_nodes = mesh.tets.shape
        element = np.repeat(np.arange(n_elements), n_nodes)
        is_around = np.ones(len(element), dtype=bool)
        around = sparse.coo_array(
            (is_around, (mesh.tets.ravel(), element)),
            shape=(len(mesh.vertices), n_elements),
        )
        return cls(mesh.tets, ends, around.tocsr())

    def straighten(self, positions: Floats, least: float) -> Floats:
        """Return (n, 3) positions with straighter inner sides of elements whose
        `straightness` is at most `least`.

        A node moves only as far as this makes the least straight of the elements around
        it straighter: where the surface is bowed, straight sides inside may be worse.
        """
        places = positions.copy()
        for _ in range(ROUNDS):
            bent = straightness(places, self.tets) <= least
            nodes = np.unique(self.tets[bent])
            is_inner = self.ends[nodes, 0] >= 0
            moved = [self._move(places, node) for node in nodes[is_inner]]
            if not any(moved):
                break
        return places

    def _move(self, places: Floats, node: int) -> bool:
        """Move a node towards the middle of its side if that straightens the elements
        around; return whether it did."""
        start = places[node].copy()
        way = places[self.ends[node]].mean(axis=0) - start
        first, last = self.around.indptr[[node, node + 1]]
        elements = self.tets[self.around.indices[first:last]]
        best = straightness(places, elements).min()
        best_part = 0.0
        for part in PARTS:
            places[node] = start + part * way
            least = straightness(places, elements).min()
            if least > best + MIN_GAIN:
                best = least
                best_part = part
        places[node] = start + best_part * way
        return best_part > 0


def straightness(positions: Floats, tets: Indices) -> Floats:
    """Return how straight the sides of (m, 10) elements are: 1 if all are straight, at
    most 0 if one may fold over.

    It is the lower bound of the Jacobian determinant in an element over the mean.
    """
    volumes = volumes_between(positions, tets)
    means = 6 * np.abs(volumes)
    tiny = np.finfo(float).tiny
    bounds = lower_bounds(positions, tets)
    return bounds / np.maximum(means, tiny)
