"""Where a triangle surface crosses itself."""

import igl.predicates
import numpy as np

from .triangles import TriangleMesh


def crossing_faces(mesh: TriangleMesh) -> int:
    """Returns the number of faces that cut other faces, found with exact predicates."""
    _, pairs, _ = igl.predicates.find_self_intersections(mesh.vertices, mesh.faces)
    return len(np.unique(pairs))
