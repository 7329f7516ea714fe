"""Cortex and core: distance to the pial surface and its normals, cortical weight,
stiffness.

Every rank builds the same search structures from the same pial positions, so that
fields do not depend on the number of ranks.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..geometry.matching import barycentric, nearest_on
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    corners,
    unit,
    vertex_normals,
)
from ..settings.folding import FoldingParameters
from ..settings.terms import CORTICAL_STEEPNESS
from ..settings.varying import Maps, value_at

WEIGHT_REACH = 3.0
"""Depth in cortical thicknesses beyond which the cortical weight, below 1e-8, is taken
as 0."""
TIE_TOL = 1e-9
"""Relative difference below which two distances count as equal."""


def cortical_weight(distance: Floats, thickness: float | Floats) -> Floats:
    """Return w = 1/(1 + exp(10 (d/H − 1))): 1 in the cortex, 0 in the core
    (FetalFoldSim; Tallinen et al. 2016)."""
    return 1.0 / (
        1.0
        + np.exp(np.minimum(CORTICAL_STEEPNESS * (distance / thickness - 1.0), 700.0))
    )


def shear_modulus(
    p: FoldingParameters,
    w: Floats,
    maps: Maps,
    week: float,
) -> Floats:
    """Return the shear modulus (k,) in Pa at points with cortical weights w (k,) and
    values (k,) of maps."""
    core, cortex = (
        value_at(value, week, maps)
        for value in (p.shear_modulus_core_pa, p.shear_modulus_cortex_pa)
    )
    return core * (1 - w) + cortex * w


class PialSearch:
    """Search for nearest points of the pial surface, from (n, 3) positions of all
    vertices and its (f, 3) facets."""

    def __init__(self, positions: Floats, facets: Ints) -> None:
        self.pial = np.unique(facets)
        local = np.searchsorted(self.pial, facets)
        self.surface = TriangleMesh(positions[self.pial], local)
        self.normals = vertex_normals(self.surface)
        self.tree = cKDTree(self.surface.vertices)
        # position of each vertex in the order of coordinates, to choose among equally
        # near ones
        self._order = np.empty(len(self.pial), dtype=np.int64)
        self._order[np.lexsort(self.surface.vertices.T[::-1])] = np.arange(
            len(self.pial)
        )

    def distance(
        self,
        points: Floats,
        reach: float = np.inf,
        to_vertex: Floats | None = None,
    ) -> Floats:
        """Return the distances of (k, 3) points to the pial triangles.

        A distance beyond `reach` may be that to the nearest vertex instead. `to_vertex`
        are the distances to the nearest vertices, if they have been computed before.
        """
        distance = (
            self.tree.query(points)[0] if to_vertex is None else to_vertex
        ).copy()
        near = (distance > 0) & self._within(distance, reach)
        if near.any():
            distance[near] = nearest_on(points[near], self.surface)[0]
        return distance

    def distance_and_normals(
        self, points: Floats, reach: float = np.inf
    ) -> tuple[Floats, Floats]:
        """Return the distances of (k, 3) points to the pial triangles, and the unit
        normals at the nearest points.

        Normals are linear in each triangle between those of its vertices. Beyond
        `reach` the nearest vertex may be taken for the nearest point.
        """
        distance, vertex = self.tree.query(points)
        normals = self.normals[vertex]
        near = self._within(distance, reach)
        if near.any():
            distance[near], face, nearest = nearest_on(points[near], self.surface)
            weights = barycentric(nearest, corners(self.surface)[face])
            normals[near] = unit(
                np.einsum("kc,kci->ki", weights, self.normals[self.surface.faces[face]])
            )
        return distance, normals

    def _within(self, to_vertex: Floats, reach: float) -> NDArray[np.bool_]:
        surface = self.surface
        corners = surface.vertices[surface.faces]
        edges = np.diff(corners, axis=1)
        longest = np.linalg.norm(edges, axis=2).max()
        # a point of a triangle is at most edge/√3 from its nearest vertex
        furthest = np.hypot(reach, longest / np.sqrt(3))
        return np.asarray(to_vertex <= furthest)

    def normals_from(self, points: Floats, candidates: Ints) -> Floats:
        """Return for (k, 3) points the unit normals of the nearest of (k, c) candidate
        pial vertices.

        If several vertices are equally near, it is the mean of their normals, so that
        mirrored brains have mirrored normals. If that mean nearly vanishes, as between
        opposed walls, it is the normal of the vertex with the smallest coordinates. The
        order of points and candidates does not matter.
        """
        gaps = np.linalg.norm(
            self.surface.vertices[candidates] - points[:, None], axis=2
        )
        tied = gaps <= gaps.min(axis=1, keepdims=True) * (1 + TIE_TOL)
        first = np.where(tied, self._order[candidates], len(self.pial)).argmin(axis=1)
        index = np.take_along_axis(candidates, first[:, None], axis=1)
        normals = self.normals[index[:, 0]]
        several = np.flatnonzero((tied & (candidates != index)).any(axis=1))
        if len(several):
            vertices = np.sort(
                np.where(tied[several], candidates[several], index[several]), axis=1
            )
            unique = np.hstack(
                [np.ones((len(vertices), 1), bool), vertices[:, 1:] != vertices[:, :-1]]
            )
            mean = np.einsum("kc,kci->ki", unique, self.normals[vertices]) / unique.sum(
                axis=1, keepdims=True
            )
            clear = np.linalg.norm(mean, axis=1) > 0.1
            normals[several[clear]] = unit(mean[clear])
        return normals

    def nearest_normals(self, points: Floats) -> Floats:
        """Return the (k, 3) unit normals of the pial vertices nearest to (k, 3) points;
        ties as in `normals_from`."""
        neighbours = min(8, len(self.pial))
        index = self.tree.query(points, k=neighbours)[1].reshape(
            len(points), neighbours
        )
        return self.normals_from(points, index)
