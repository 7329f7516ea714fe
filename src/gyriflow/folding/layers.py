"""Cortex and core: distance to the pial surface and its normals, cortical weight,
stiffness.

Every rank builds the same search structures from the same pial positions, so that
fields do not depend on the number of ranks.
"""

from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from ..geometry.matching import barycentric, nearest_on
from ..geometry.triangles import (
    Floats,
    Ints,
    Mask,
    TriangleMesh,
    coordinate_ranks,
    corners,
    unit,
    used_part,
    vertex_normals,
)
from ..settings.folding import FoldingParameters
from ..settings.terms import CORTICAL_STEEPNESS
from ..settings.varying import Maps, value_at
from .nearest_faces import FaceTree, nearest_candidates

WEIGHT_REACH = 3.0
"""Depth in cortical thicknesses beyond which depth need not be exact, as the cortical
weight is below 1e-8."""
TIE_TOL = 1e-9
"""Relative difference below which two distances count as equal."""


def cortical_weight(distance: Floats, thickness: float | Floats) -> Floats:
    """Return w = 1/(1 + exp(10 (d/H − 1))): 1 in the cortex, 0 in the core
    (FetalFoldSim; Tallinen et al. 2016)."""
    exponent = CORTICAL_STEEPNESS * (distance / thickness - 1.0)
    # beyond 709 the exponential is infinite
    return 1.0 / (1.0 + np.exp(np.minimum(exponent, 700.0)))


def shear_modulus(
    p: FoldingParameters,
    w: Floats,
    maps: Maps,
    week: float,
) -> Floats:
    """Return the shear modulus (k,) in Pa at points with cortical weights w (k,) and
    values (k,) of maps."""
    core = value_at(p.shear_modulus_core_pa, week, maps)
    cortex = value_at(p.shear_modulus_cortex_pa, week, maps)
    return core * (1 - w) + cortex * w


class PialSearch:
    """Search for nearest points of the pial surface, from (n, 3) positions of all
    vertices and its (f, 3) facets."""

    def __init__(self, positions: Floats, facets: Ints) -> None:
        whole = TriangleMesh(positions, facets)
        self.surface, self.pial = used_part(whole)
        self.normals = vertex_normals(self.surface)
        # to choose among equally near vertices
        self._rank = coordinate_ranks(self.surface.vertices)

    @cached_property
    def _faces(self) -> FaceTree:
        return FaceTree(self.surface)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.surface.vertices)

    def nearest(self, points: Floats) -> tuple[Floats, Ints]:
        """Return the distances of (k, 3) points to the pial triangles, and their
        nearest pial vertices."""
        return self._faces.nearest(points)

    def distance_and_normals(
        self, points: Floats, reach: float
    ) -> tuple[Floats, Floats]:
        """Return the distances of (k, 3) points to the pial triangles, and the unit
        normals at the nearest points.

        Normals are linear in each triangle between those of its vertices. Beyond
        `reach` the nearest vertex may be taken for the nearest point.
        """
        distance, vertex = self._tree.query(points)
        normals = self.normals[vertex]
        near = self._within(distance, reach)
        if near.any():
            distance[near], face, nearest = nearest_on(points[near], self.surface)
            weights = barycentric(nearest, corners(self.surface)[face])
            vertices = self.surface.faces[face]
            normals[near] = unit(self._weighted_normals(weights, vertices))
        return distance, normals

    def _weighted_normals(self, weights: Floats | Mask, vertices: Ints) -> Floats:
        """Return the (k, 3) weighted sums of the normals of (k, c) vertices."""
        # k: point, c: vertex, i: axis
        return np.einsum("kc,kci->ki", weights, self.normals[vertices])

    def _within(self, to_vertex: Floats, reach: float) -> Mask:
        """Return (k,) whether a triangle may be within reach, from distances to
        vertices."""
        edges = np.diff(corners(self.surface), axis=1)
        lengths = np.linalg.norm(edges, axis=2)
        longest = lengths.max()
        # a point of a triangle is at most edge/√3 from its nearest vertex
        furthest = np.hypot(reach, longest / np.sqrt(3))
        is_within = to_vertex <= furthest
        return np.asarray(is_within)

    def normals_from(self, points: Floats, candidates: Ints) -> Floats:
        """Return for (k, 3) points the unit normals of the nearest of (k, c) candidate
        pial vertices.

        If several vertices are equally near, it is the mean of their normals, so that
        mirrored brains have mirrored normals. If that mean nearly vanishes, as between
        opposed walls, it is the normal of the vertex with the smallest coordinates. The
        order of points and candidates does not matter.
        """
        vertices = self.surface.vertices
        # twice the tolerance, for squares, and some round-off
        nearest, may_tie = nearest_candidates(points, candidates, vertices, 3 * TIE_TOL)
        normals = self.normals[nearest]
        tied = np.flatnonzero(may_tie)
        if len(tied):
            offsets = vertices[candidates[tied]] - points[tied, None]
            normals[tied] = self._tied_normals(offsets, candidates[tied])
        return normals

    def _tied_normals(self, offsets: Floats, candidates: Ints) -> Floats:
        """Return the normals of `normals_from` for points at (k, c, 3) offsets from
        their candidates, of which several may be equally near."""
        gaps = np.linalg.norm(offsets, axis=2)
        least = gaps.min(axis=1, keepdims=True)
        is_nearest = gaps <= least * (1 + TIE_TOL)
        ranks = np.where(
            is_nearest,
            self._rank[candidates],
            len(self.pial),
        )
        first = ranks.argmin(axis=1)[:, None]
        chosen = np.take_along_axis(candidates, first, axis=1)
        normals = self.normals[chosen[:, 0]]
        is_other = is_nearest & (candidates != chosen)
        tied = np.flatnonzero(is_other.any(axis=1))
        if len(tied):
            # each of the nearest vertices once, although candidates may repeat
            vertices = np.where(
                is_nearest[tied],
                candidates[tied],
                chosen[tied],
            )
            vertices.sort(axis=1)
            is_new = np.ones(vertices.shape, dtype=bool)
            is_new[:, 1:] = np.diff(vertices, axis=1) != 0
            counts = is_new.sum(axis=1, keepdims=True)
            mean = self._weighted_normals(is_new, vertices) / counts
            lengths = np.linalg.norm(mean, axis=1)
            is_clear = lengths > 0.1
            normals[tied[is_clear]] = unit(mean[is_clear])
        return normals

    def nearest_normals(self, points: Floats) -> Floats:
        """Return the (k, 3) unit normals of the pial vertices nearest to (k, 3) points;
        ties as in `normals_from`."""
        count = min(8, len(self.pial))
        # a list of ranks, so that also one neighbour is a column
        ranks = range(1, count + 1)
        _, candidates = self._tree.query(points, k=ranks)
        return self.normals_from(points, candidates)
