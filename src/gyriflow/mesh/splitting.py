"""Split the edges inside a mesh that join two vertices of its surface.

An element of four vertices of the surface turns over where the surface bends the other
way, as at a new sulcus, and no vertex inside can be moved to prevent that. A vertex in
the middle of its inner edge can.
"""

import logging

import numpy as np

from ..geometry.jacobians import EDGES
from ..geometry.tetrahedra import TetrahedralMesh, boundary_faces
from ..geometry.triangles import Floats, Ints, TriangleMesh, edges
from .improvement import signed_ratios

log = logging.getLogger(__name__)

ROUNDS = 2
"""Rounds in which each new vertex takes the best place between those around it."""
PARTS = np.linspace(0.0, 1.0, 9)
"""Parts of the way from the middle of its edge to the mean of those around."""


def split_inner_edges(mesh: TetrahedralMesh) -> TetrahedralMesh:
    """Return a linear mesh without an inner edge between two vertices of the surface.

    Each such edge has a vertex near its middle, and the elements around it are halved.
    The vertices of the given mesh come first, and its surface stays as it is.
    """
    between, elements = _inner_edges(mesh)
    tets = {int(element): mesh.tets[element].copy() for element in elements}
    around: dict[int, set[int]] = {}
    for element, corners in tets.items():
        for vertex in corners.tolist():
            around.setdefault(vertex, set()).add(element)
    n_elements = len(mesh.tets)
    middles: list[Floats] = []
    for first, second in between.tolist():
        middle = len(mesh.vertices) + len(middles)
        middles.append(mesh.vertices[[first, second]].mean(axis=0))
        around[middle] = set()
        for element in around[first] & around[second]:
            half = tets[element].copy()
            half[half == first] = middle
            tets[n_elements] = half
            for vertex in half.tolist():
                around[vertex].add(n_elements)
            n_elements += 1
            tets[element][tets[element] == second] = middle
            around[second].remove(element)
            around[middle].add(element)
    if not middles:
        return mesh
    log.info("%d inner edges between vertices of the surface are split", len(middles))
    new_tets = np.empty((n_elements, 4), dtype=np.int64)
    new_tets[: len(mesh.tets)] = mesh.tets
    for element, corners in tets.items():
        new_tets[element] = corners
    vertices = np.vstack([mesh.vertices, middles])
    for _ in range(ROUNDS):
        for vertex in range(len(mesh.vertices), len(vertices)):
            star = np.array([tets[element] for element in around[vertex]])
            vertices[vertex] = _best_place(vertices, vertex, star)
    return TetrahedralMesh(vertices, new_tets)


def _best_place(
    vertices: Floats,
    vertex: int,
    star: Ints,
) -> Floats:
    """Return the place of a vertex, on the way to the mean of those around, where the
    flattest of its elements (k, 4) is least flat."""
    used, local = np.unique(star, return_inverse=True)
    elements = local.reshape(star.shape)
    is_own = used == vertex
    places = vertices[used]
    start = vertices[vertex]
    way = places[~is_own].mean(axis=0) - start
    best, best_ratio = start, -np.inf
    for part in PARTS:
        places[is_own] = start + part * way
        ratio = signed_ratios(places[elements]).min()
        if ratio > best_ratio:
            best, best_ratio = start + part * way, ratio
    return best


def _inner_edges(mesh: TetrahedralMesh) -> tuple[Ints, Ints]:
    """Return the inner edges (k, 2) between vertices of the surface, and the elements
    that have one."""
    count = len(mesh.vertices)
    faces, _ = boundary_faces(mesh)
    is_outer = np.zeros(count, dtype=bool)
    is_outer[faces] = True
    pairs = np.sort(
        mesh.tets[:, EDGES],
        axis=2,
    )
    on_surface, _ = edges(TriangleMesh(mesh.vertices, faces))
    # one number per edge
    number = [count, 1]
    is_along_surface = np.isin(pairs @ number, on_surface @ number)
    is_inner = is_outer[pairs].all(axis=2) & ~is_along_surface
    between = np.unique(pairs[is_inner], axis=0)
    elements = np.flatnonzero(is_inner.any(axis=1))
    return between, elements
