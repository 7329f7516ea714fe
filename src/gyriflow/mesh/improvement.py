"""Inner vertices moved to where their worst element is better; surface and elements' vertices stay."""

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..geometry.tetrahedra import TetrahedralMesh, boundary_faces, signed_volumes
from ..geometry.triangles import unit
from .quality import radius_ratios

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ROUNDS = 10
POOR = 0.3
"""Vertices of elements with a radius ratio below this are moved."""
TO_CENTRE = (0.3, 0.7, 1.2)
"""Parts of the way to the mean centroid of the elements around a vertex that are tried."""
STEPS = (0.05, 0.4, 0.1, 0.2)
"""Lengths of the other moves that are tried, in mean distances of the elements' corners from their centroids."""
DIRECTIONS = unit(np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)]))


def improve(mesh: TetrahedralMesh) -> TetrahedralMesh:
    """Returns the mesh with inner vertices of poor elements moved, each to the best of some places around it.

    The worst radius ratio around a vertex never falls. In a round no two vertices of one element move; those of the
    worst elements come first.
    """
    vertices = mesh.vertices.copy()
    fixed = np.zeros(len(vertices), dtype=bool)
    fixed[np.unique(boundary_faces(mesh)[0])] = True
    elements = np.repeat(np.arange(len(mesh.tets)), 4)
    shape = (len(vertices), len(mesh.tets))
    around = sparse.csr_array((np.ones(len(elements)), (mesh.tets.ravel(), elements)), shape=shape)
    for number in range(ROUNDS):
        moving = _apart(mesh.tets, radius_ratios(TetrahedralMesh(vertices, mesh.tets)), fixed, around)
        if not len(moving):
            break
        owner, element = around[moving].nonzero()
        vertices[moving] = _best_places(vertices, mesh.tets[element], moving, owner, STEPS[number % len(STEPS)])
    return TetrahedralMesh(vertices, mesh.tets)


def _apart(tets: Ints, ratios: Floats, fixed: NDArray[np.bool_], around: sparse.csr_array) -> Ints:
    """Returns free vertices of poor elements, no two of one element, those of the worst elements first."""
    free = np.unique(tets[ratios < POOR])
    free = free[~fixed[free]]
    neighbours = [around.indices[around.indptr[i] : around.indptr[i + 1]] for i in free]
    taken = np.zeros(len(tets), dtype=bool)
    chosen = []
    for i in np.argsort([ratios[near].min() for near in neighbours], kind="stable"):
        if not taken[neighbours[i]].any():
            taken[neighbours[i]] = True
            chosen.append(free[i])
    return np.array(chosen, dtype=np.int64)


def _best_places(vertices: Floats, tets: Ints, moving: Ints, owner: Ints, step: float) -> Floats:
    """Returns the (k, 3) best tried places of `moving` vertices, whose elements are the (e, 4) `tets` by `owner`."""
    corner = vertices[tets]
    own = tets == moving[owner][:, None]
    count = np.bincount(owner)
    centroid = corner.mean(axis=1)
    size = np.bincount(owner, np.linalg.norm(corner - centroid[:, None], axis=2).mean(axis=1)) / count
    centre = np.stack([np.bincount(owner, centroid[:, axis]) for axis in range(3)], axis=1) / count[:, None]

    def worst(place: Floats) -> Floats:
        moved = corner.copy()
        moved[own] = place[owner]
        around = TetrahedralMesh(moved.reshape(-1, 3), np.arange(4 * len(moved)).reshape(-1, 4))
        least = np.full(len(moving), np.inf)
        np.minimum.at(least, owner, np.where(signed_volumes(around) > 0, radius_ratios(around), -1.0))
        return least

    here = vertices[moving]
    moves = [part * (centre - here) for part in TO_CENTRE]
    moves += [step * size[:, None] * direction for direction in DIRECTIONS]
    best, least = here.copy(), worst(here)
    for move in moves:
        found = worst(here + move)
        better = found > least
        best[better], least[better] = (here + move)[better], found[better]
    return best
