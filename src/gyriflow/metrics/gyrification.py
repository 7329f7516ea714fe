"""Gyrification indices: pial area over the area of a smooth surface around, and what closes an open hemisphere."""

import igl
import numpy as np
import pymeshlab
from scipy.spatial import ConvexHull, QhullError

from ..errors import MeshError
from ..geometry.triangles import TriangleMesh, area, area_vectors, corners, edges, face_areas, signed_volume

ENVELOPE_RADIUS_MM = 5.0
"""The envelope bridges sulci narrower than twice this radius."""

ENVELOPE_OFFSET_MM = 0.25
"""Distance from the surface to the envelope around it."""


def capped(mesh: TriangleMesh) -> TriangleMesh:
    """Returns the surface with each boundary loop closed by a fan of faces from its centroid, after its own faces.

    For a loop in a plane, as a cut at the midline, the cap is that part of the plane.
    """
    vertices, faces = [mesh.vertices], [mesh.faces]
    for number, loop in enumerate(igl.boundary_loop_all(mesh.faces)):
        rim = np.asarray(loop, dtype=np.int64)
        centre = np.full(len(rim), len(mesh.vertices) + number)
        vertices.append(mesh.vertices[rim].mean(axis=0, keepdims=True))
        faces.append(np.stack([np.roll(rim, -1), rim, centre], axis=1))
    return TriangleMesh(np.concatenate(vertices), np.concatenate(faces))
