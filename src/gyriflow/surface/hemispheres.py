"""Left and right: a whole surface split at the fissure, two hemispheres merged without crossing."""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from gyriflow.geometry.triangles import TriangleMesh, corners, face_areas, submesh


def left_faces(mesh: TriangleMesh, fissure_x_mm: float) -> NDArray[np.bool_]:
    """Returns the (m,) mask of the faces of the left hemisphere: x below the fissure in RAS+.

    Patches that bulge over the fissure are given back to the hemisphere that surrounds them, so that each
    hemisphere is in one piece for each closed surface it has a part of.
    """
    side = corners(mesh)[:, :, 0].mean(axis=1) < fissure_x_mm
    directed = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    face = np.repeat(np.arange(len(mesh.faces)), 3)
    order = np.lexsort(directed.T)
    same = (directed[order][1:] == directed[order][:-1]).all(axis=1)
    a, b = face[order][:-1][same], face[order][1:][same]
    surface = _components(a, b, len(side))
    areas = face_areas(mesh)
    within = side[a] == side[b]
    piece = _components(a[within], b[within], len(side))
    size = np.bincount(piece, weights=areas)
    for number in np.unique(surface):
        for value in (True, False):
            pieces = np.unique(piece[(surface == number) & (side == value)])
            largest = pieces[np.argmax(size[pieces])] if len(pieces) else -1
            small = np.isin(piece, pieces) & (piece != largest) & (size[piece] < 0.5 * size[largest])
            side = np.where(small, not value, side)
    return side


def split(mesh: TriangleMesh, fissure_x_mm: float) -> tuple[TriangleMesh, TriangleMesh]:
    """Returns the left and the right hemisphere's pial surfaces; together they have every face of `mesh` once.

    They are open where a connected brain is cut at the fissure.
    """
    left = left_faces(mesh, fissure_x_mm)
    return submesh(mesh, left)[0], submesh(mesh, ~left)[0]


def _components(a: NDArray, b: NDArray, count: int) -> NDArray:
    graph = sparse.coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
    return connected_components(graph, directed=False)[1]
