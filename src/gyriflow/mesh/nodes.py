"""Nodes of a mesh moved: inner ones to where their worst element is better, outer ones onto the smooth surface.

Linear elements are made quadratic for the latter. Facets are bumps of the size of an element, and bumps grow with the
cortex: nodes on the middles of outer edges would keep them. A node goes to the nearest place of the surface only as far
as its elements stay sound.
"""

import itertools
import logging
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..geometry.jacobians import coefficients
from ..geometry.matching import faces_that_cross, nearest_on
from ..geometry.tetrahedra import TetrahedralMesh, boundary_faces, boundary_surface, quadratic, signed_volumes
from ..geometry.triangles import TriangleMesh, edges, face_normals, unit, vertex_normals
from .quality import jacobian_ratios, radius_ratios

log = logging.getLogger(__name__)
Mask = NDArray[np.bool_]
Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
ROUNDS = 10
POOR = 0.3
"""Vertices of elements with a radius ratio below this are moved."""
TO_CENTRE = (0.3, 0.7, 1.2)
"""Parts of the way to the mean centroid of the elements around a vertex that are tried."""
STEPS = (0.05, 0.4, 0.1, 0.2)
"""Lengths of the other moves that are tried, in mean distances of the elements' corners from their centroids."""
DIRECTIONS = unit(np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)]))
ALIKE = 0.5
"""Least cosine between the normals of the mesh at a node and of the surface where the node is to go: the wall of a
sulcus may be nearer to a node than the place it comes from."""
FARTHEST = 0.25
"""Largest move of a node, in lengths of the shortest outer edge that ends there."""
HALVINGS = 6
"""How often the move of an unsound element's nodes is halved before it is given up."""
SOUND = 0.3
"""Least ratio of the determinant of a curved element's map to its mean."""
WORSE = 0.5
"""Part of its radius ratio that an element keeps at least when its corners move."""


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


def curve_edges(mesh: TetrahedralMesh, surface: TriangleMesh) -> TetrahedralMesh:
    """Returns a linear mesh as quadratic elements whose outer nodes lie on a smooth surface where they can.

    Corners move first, with straight sides; then the nodes on the middles of outer edges leave their chords. Where
    an element would become unsound, or the surface of the mesh cross itself, moves are halved and then given up. The
    surface is closed and outward, near to that of the mesh; both are in mm.
    """
    before = radius_ratios(mesh)

    def spoilt(placed: TetrahedralMesh) -> Mask:
        return np.asarray((signed_volumes(placed) <= 0) | (radius_ratios(placed) < WORSE * before))

    straight = quadratic(_move(mesh, *_project(mesh, surface), spoilt)[0])
    target, way = _project(straight, surface)
    middles = way & (np.arange(len(way)) >= len(mesh.vertices))

    def unsound(placed: TetrahedralMesh) -> Mask:
        values = coefficients(placed.vertices, placed.tets)
        return np.asarray(values.min(axis=1) < SOUND * values.mean(axis=1))

    result, left = _move(straight, target, middles, unsound)
    log.info(
        "quadratic elements: %d of %d nodes on middles of outer edges on the surface, least ratio of Jacobians %.2f",
        int(left.sum()),
        int((np.unique(boundary_faces(straight)[0]) >= len(mesh.vertices)).sum()),
        jacobian_ratios(result).min(),
    )
    return result


def _project(mesh: TetrahedralMesh, surface: TriangleMesh) -> tuple[Floats, Mask]:
    """Returns the (n, 3) places to which nodes are to go, and which of them have one: outer nodes near the surface."""
    own, outer = boundary_surface(mesh)
    distance, face, place = nearest_on(own.vertices, surface)
    ends, _ = edges(own)
    length = np.linalg.norm(np.diff(own.vertices[ends], axis=1)[:, 0], axis=1)
    shortest = np.full(len(outer), np.inf)
    np.minimum.at(shortest, ends.ravel(), np.repeat(length, 2))
    alike = np.einsum("ij,ij->i", vertex_normals(own), face_normals(surface)[face]) >= ALIKE
    near = alike & (distance <= FARTHEST * shortest)
    target, way = mesh.vertices.copy(), np.zeros(len(mesh.vertices), dtype=bool)
    target[outer[near]] = place[near]
    way[outer[near]] = True
    return target, way


def _move(
    mesh: TetrahedralMesh, target: Floats, way: Mask, unsound: Callable[[TetrahedralMesh], Mask]
) -> tuple[TetrahedralMesh, Mask]:
    """Returns the mesh with its nodes as far on their way as its elements and faces allow, and which nodes moved."""
    part = way.astype(float)
    triangles, _ = boundary_faces(mesh)
    used, local = np.unique(triangles, return_inverse=True)
    faces = local.reshape(-1, 3)
    crossed = faces_that_cross(TriangleMesh(mesh.vertices[used], faces))
    for round_ in range(3 * HALVINGS):
        placed = TetrahedralMesh(mesh.vertices + part[:, None] * (target - mesh.vertices), mesh.tets)
        bad = mesh.tets[unsound(placed)].ravel()
        new = np.setdiff1d(faces_that_cross(TriangleMesh(placed.vertices[used], faces)), crossed)
        bad = np.unique(np.concatenate([bad, triangles[new].ravel()]))
        bad = bad[part[bad] > 0]
        if not len(bad):
            break
        part[bad] = part[bad] / 2 if round_ < HALVINGS else 0.0
    return placed, part > 0
