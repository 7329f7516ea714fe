"""Sulcal depth: the straight distance from the pial surface out to its convex hull."""

import igl
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ..errors import MeshError
from ..geometry.triangles import Floats, TriangleMesh


def convex_hull(mesh: TriangleMesh) -> TriangleMesh:
    """Returns the convex hull, its faces outward; MeshError for a flat surface."""
    try:
        hull = ConvexHull(mesh.vertices)
    except QhullError as error:
        raise MeshError("the surface has no convex hull", remedy="It has to enclose a volume") from error
    faces = np.asarray(hull.simplices, dtype=np.int64)
    a, b, c = mesh.vertices[faces].transpose(1, 0, 2)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    used, local = np.unique(faces, return_inverse=True)
    return TriangleMesh(mesh.vertices[used], local.reshape(-1, 3))


def sulcal_depth(mesh: TriangleMesh, around: TriangleMesh) -> Floats:
    """Returns the (n,) straight distance in mm from each vertex outwards to the closed surface around; 0 outside it.

    Around is the convex hull of the hemisphere: of the measures compared in `benchmarks/sulcal_depth.py` it is nearest
    to the known depths of phantoms, and does not jump when the lips of a fissure close.
    """
    signed, *_ = igl.signed_distance(
        mesh.vertices, around.vertices, around.faces, igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    )
    return np.maximum(-signed, 0.0)
