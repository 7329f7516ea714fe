"""Cortex and core: distance to the pial surface, cortical weight, stiffness and growth of a step.

Plain NumPy on whole arrays. Every rank builds the same search structures from the same pial positions, so that fields
do not depend on the number of ranks.
"""

from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..geometry.triangles import TriangleMesh, unit, vertex_normals
from ..mechanics.growth import growth_increments
from ..parameters.folding import VENTRICLES, FoldingParameters
from ..parameters.varying import Maps, value_at

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WEIGHT_REACH = 3.0
"""Depth in cortical thicknesses beyond which the cortical weight, below 1e-8, is taken as 0."""
TIE = 1e-9
"""Relative difference below which two distances count as equal."""


def cortical_weight(distance: Floats, thickness: float | Floats) -> Floats:
    """Returns w = 1/(1 + exp(10 (d/H − 1))): 1 in the cortex, 0 in the core (paper, after Tallinen et al. 2016)."""
    return 1.0 / (1.0 + np.exp(np.minimum(10.0 * (distance / thickness - 1.0), 700.0)))


@dataclass(frozen=True, eq=False)
class Layers:
    """Fields of a step at (n,) points.

    Attributes
    ----------
    weight
        Cortical weight w.
    mu
        Shear modulus in Pa.
    dg, dr
        Growth of the step along the pial surface and across it, as stretches less 1.
    """

    weight: Floats
    mu: Floats
    dg: Floats
    dr: Floats


def layers_at(
    distance_mm: Floats, growth: Floats, parameters: FoldingParameters, maps: Maps, week: float, step_s: float
) -> Layers:
    """Returns the fields of a step around a week.

    Parameters
    ----------
    distance_mm, growth
        Distance to the pial surface, and 1 where tissue grows, at (n,) points.
    maps
        Parameters' maps at the same points.
    """
    p = parameters
    w = cortical_weight(distance_mm, p.thickness_at(week, maps))
    tangential, radial, core = (
        value_at(rate, week, maps)
        for rate in (p.growth_rate_per_s, p.radial_growth_rate_per_s, p.core_growth_rate_per_s)
    )
    if p.with_ventricles:
        core = core + maps[VENTRICLES] * (p.ventricle_growth_rate_per_s - core)
    # where directions are measured, the rates are those of volume
    across = tangential if p.regional_strain else 0.0
    dg, dr = growth_increments(w, growth, tangential, radial, core, step_s, across=across)
    return Layers(
        weight=w,
        mu=value_at(p.shear_modulus_core_pa, week, maps) * (1 - w)
        + value_at(p.shear_modulus_cortex_pa, week, maps) * w,
        dg=dg,
        dr=dr,
    )


class PialSearch:
    """Nearest points of the pial surface at one moment.

    Parameters
    ----------
    positions : (n, 3) float
        Positions of all vertices, in any unit.
    facets : (f, 3) int
        Pial facets, outward, as vertex indices.
    """

    def __init__(self, positions: Floats, facets: Ints) -> None:
        self.pial = np.unique(facets)
        local = np.searchsorted(self.pial, facets)
        self.surface = TriangleMesh(positions[self.pial], local)
        self.normals = vertex_normals(self.surface)
        self.tree = cKDTree(self.surface.vertices)
        # which of several vertices comes first where they are as near
        self._order = np.empty(len(self.pial), dtype=np.int64)
        self._order[np.lexsort(self.surface.vertices.T[::-1])] = np.arange(len(self.pial))

    def nearest(self, points: Floats) -> tuple[Floats, Ints]:
        """Returns distance and index of the pial vertex nearest to each of (k, 3) points."""
        return self.tree.query(points)

    def distance(self, points: Floats, reach: float = np.inf, to_vertex: Floats | None = None) -> Floats:
        """Returns the distances of (k, 3) points to the pial triangles.

        Where a distance is beyond `reach`, that to the nearest vertex may stand for it. `to_vertex` are the distances
        to the nearest vertices, where they are known.
        """
        distance = (self.nearest(points)[0] if to_vertex is None else to_vertex).copy()
        near = (distance > 0) & self._within(distance, reach)
        if near.any():
            distance[near] = self._nearest_places(points[near])[0]
        return distance

    def distance_and_normals(self, points: Floats, reach: float = np.inf) -> tuple[Floats, Floats]:
        """Returns the distances of (k, 3) points to the pial triangles, and the unit normals at the nearest places.

        Normals are linear in each triangle between those of its vertices. Beyond `reach` the nearest vertex may stand
        for the nearest place.
        """
        distance, vertex = self.nearest(points)
        normals = self.normals[vertex]
        near = self._within(distance, reach)
        if near.any():
            distance[near], face, weights = self._nearest_places(points[near])
            normals[near] = unit(np.einsum("kc,kci->ki", weights, self.normals[self.surface.faces[face]]))
        return distance, normals

    def _within(self, to_vertex: Floats, reach: float) -> NDArray[np.bool_]:
        """Returns which points may be within reach of a triangle, from their distances to the nearest vertices."""
        # a point of a triangle is at most edge/√3 from its nearest vertex
        longest = np.linalg.norm(np.diff(self.surface.vertices[self.surface.faces], axis=1), axis=2).max()
        return np.asarray(to_vertex <= np.hypot(reach, longest / np.sqrt(3)))

    def _nearest_places(self, points: Floats) -> tuple[Floats, Ints, Floats]:
        """Returns distances of (k, 3) points to the triangles, the nearest ones, and barycentric coordinates there."""
        faces = self.surface.faces.astype(np.int32)
        vertices = self.surface.vertices.copy()
        squared, face, place = igl.point_mesh_squared_distance(points, vertices, faces)
        a, b, c = (np.ascontiguousarray(vertices[faces[face, i]]) for i in range(3))
        return np.sqrt(squared), face, igl.barycentric_coordinates(place, a, b, c)

    def normals_from(self, points: Floats, candidates: Ints) -> Floats:
        """Returns for (k, 3) points the unit normals of the nearest of (k, c) candidate pial vertices.

        Where several are as near it is their mean, so that mirrored brains have mirrored normals; where that all but
        vanishes, as between opposed walls, that of the vertex with the smaller coordinates. The order of points and
        candidates does not matter.
        """
        gaps = np.linalg.norm(self.surface.vertices[candidates] - points[:, None], axis=2)
        tied = gaps <= gaps.min(axis=1, keepdims=True) * (1 + TIE)
        first = np.where(tied, self._order[candidates], len(self.pial)).argmin(axis=1)
        index = np.take_along_axis(candidates, first[:, None], axis=1)
        normals = self.normals[index[:, 0]]
        several = np.flatnonzero((tied & (candidates != index)).any(axis=1))
        if len(several):
            names = np.sort(np.where(tied[several], candidates[several], index[several]), axis=1)
            once = np.hstack([np.ones((len(names), 1), bool), names[:, 1:] != names[:, :-1]])
            mean = np.einsum("kc,kci->ki", once, self.normals[names]) / once.sum(axis=1, keepdims=True)
            clear = np.linalg.norm(mean, axis=1) > 0.1
            normals[several[clear]] = unit(mean[clear])
        return normals

    def nearest_normals(self, points: Floats) -> Floats:
        """Returns the (k, 3) unit normals of the pial vertices nearest to (k, 3) points, ties as in `normals_from`."""
        neighbours = min(8, len(self.pial))
        index = self.tree.query(points, k=neighbours)[1].reshape(len(points), neighbours)
        return self.normals_from(points, index)


def normals_between(normals: Floats, smooth: Floats, bounded: Floats) -> Floats:
    """Returns the (c, q, 3) unit normals at points inside elements from those (c, k, 3) at their nodes.

    Only the direction of a normal counts, not its sense: walls that face each other have the same. So normals are
    turned to the side of the first before their mean is taken; where that all but vanishes, the nearest node's stands
    for it.

    Parameters
    ----------
    smooth, bounded : (q, k) float
        Weights of the nodes at the points, see `IntegrationPoints`.
    """
    turned = normals * np.where(np.einsum("cki,ci->ck", normals, normals[:, 0]) < 0, -1.0, 1.0)[:, :, None]
    mean = np.matmul(smooth, turned)
    length = np.linalg.norm(mean, axis=2, keepdims=True)
    heaviest = turned[:, bounded.argmax(axis=1)]
    return np.where(length > 0.1, mean / np.maximum(length, 0.1), heaviest)
