"""The thickness of a layer between two surfaces."""

import igl
import numpy as np

from .triangles import Floats, TriangleMesh


def layer_thickness(outer: TriangleMesh, inner: TriangleMesh) -> Floats:
    """Returns the (n,) thickness in mm at the vertices of the outer surface of the layer between two surfaces.

    It is the mean of two distances: from the vertex to the nearest point of the inner surface, and from there to the
    nearest point of the outer one (Fischl and Dale 2000, doi 10.1073/pnas.200033797).
    """
    there, nearest = nearest_on(outer.vertices, inner)
    back, _ = nearest_on(nearest, outer)
    return 0.5 * (there + back)


def nearest_on(points: Floats, surface: TriangleMesh) -> tuple[Floats, Floats]:
    """Returns the (n,) distances of points from a surface, and the (n, 3) nearest points on it."""
    squared, _, nearest = igl.point_mesh_squared_distance(points, surface.vertices, surface.faces)
    return np.sqrt(squared), nearest
