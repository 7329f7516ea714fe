"""Where a triangle surface crosses itself."""

import igl.predicates
import numpy as np

from .triangles import Ints, TriangleMesh


def faces_that_cross(mesh: TriangleMesh) -> Ints:
    """Returns the faces that cut other faces, ascending, found with exact predicates."""
    _, pairs, _ = igl.predicates.find_self_intersections(mesh.vertices, mesh.faces)
    return np.unique(pairs).astype(np.int64)


def crossing_faces(mesh: TriangleMesh) -> int:
    """Returns the number of faces that cut other faces."""
    return len(faces_that_cross(mesh))
