"""Cortex and core: distance to the pial surface, cortical weight, stiffness and growth fields of a step.

Plain NumPy on whole arrays. Every rank builds the same search structures from the same pial positions, so that fields
do not depend on the number of ranks.
"""

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..geometry.triangles import TriangleMesh, vertex_normals

Floats = NDArray[np.float64]

WEIGHT_REACH = 3.0
"""Depth in cortical thicknesses beyond which the cortical weight is below 1e-8."""


def cortical_weight(distance: Floats, thickness: float | Floats) -> Floats:
    """Returns w = 1/(1 + exp(10 (d/H − 1))): 1 in the cortex, 0 in the core (paper, after Tallinen et al. 2016)."""
    return 1.0 / (1.0 + np.exp(np.minimum(10.0 * (distance / thickness - 1.0), 700.0)))


class PialSearch:
    """Nearest points of the pial surface at one moment.

    Parameters
    ----------
    positions : (n, 3) float
        Positions of all vertices, in any unit.
    facets : (f, 3) int
        Pial facets, outward, as vertex indices.
    """

    def __init__(self, positions: Floats, facets: NDArray[np.int64]) -> None:
        self.pial = np.unique(facets)
        local = np.searchsorted(self.pial, facets)
        self.surface = TriangleMesh(positions[self.pial], local)
        self.normals = vertex_normals(self.surface)
        self.tree = cKDTree(self.surface.vertices)

    def distance(self, points: Floats, reach: float = np.inf) -> Floats:
        """Returns the distances of (k, 3) points to the pial triangles.

        Points that are further than `reach` from every pial vertex get the distance to the nearest vertex.
        """
        distance = self.tree.query(points)[0]
        near = (distance > 0) & (distance <= reach)
        if near.any():
            faces = self.surface.faces.astype(np.int32)
            squared = igl.point_mesh_squared_distance(points[near], self.surface.vertices.copy(), faces)[0]
            distance[near] = np.sqrt(squared)
        return distance

    def nearest_normals(self, points: Floats) -> Floats:
        """Returns the (k, 3) unit normals of the pial vertices nearest to (k, 3) points.

        Ties (to 1e-9 of the distance) go to the vertex with the smaller coordinates, whatever the order of points.
        """
        neighbours = min(2, len(self.pial))
        distance, index = self.tree.query(points, k=neighbours)
        if neighbours == 1:
            return self.normals[index]
        tied = np.flatnonzero(distance[:, 1] <= distance[:, 0] * (1 + 1e-9))
        index = index[:, 0]
        for i in tied:
            ball = self.tree.query_ball_point(points[i], distance[i, 0] * (1 + 1e-9))
            index[i] = min(ball, key=lambda j: tuple(self.surface.vertices[j]))
        return self.normals[index]
