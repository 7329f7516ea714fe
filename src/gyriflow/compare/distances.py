"""Distances between two surfaces: over both of them, by side, and in bootstrap samples of patches."""

import numpy as np
from scipy.spatial import cKDTree

from ..geometry.alignment import align
from ..geometry.matching import nearest_on, surface_distance
from ..geometry.triangles import Floats, Ints, TriangleMesh, vertex_areas

type VertexDistances = tuple[TriangleMesh, Floats]
"""A surface, and the (n,) distances of its vertices from another one in mm."""


def pairwise_distances(
    surface: TriangleMesh, observed: TriangleMesh, even: TriangleMesh | None = None
) -> list[VertexDistances]:
    """Measure how far the vertices of each of two aligned surfaces are from the other one, in mm.

    `even` is the observed surface with even triangles. If given, distances are measured at its vertices instead of
    those of `observed`.
    """
    pairs = (surface, observed), (observed if even is None else even, surface)
    return [(mesh, nearest_on(mesh.vertices, target)[0]) for mesh, target in pairs]


def surface_distances(pair: list[VertexDistances]) -> dict[str, float]:
    """Summarise the distances of `pairwise_distances` in mm.

    distance_mm is the mean of the two area-weighted means, distance95_mm the larger of the two 95 % quantiles (a robust
    Hausdorff distance); distance_left_mm and distance_right_mm are distance_mm of the parts left and right of x = 0,
    NaN where a surface has none there.
    """
    mean, quantile = surface_distance((distances, vertex_areas(mesh)) for mesh, distances in pair)
    by_side = []
    for on_side in (np.less, np.greater_equal):
        parts = [(distances, vertex_areas(mesh) * on_side(mesh.vertices[:, 0], 0)) for mesh, distances in pair]
        has_both = all(areas.any() for _, areas in parts)
        by_side.append(surface_distance(parts)[0] if has_both else float("nan"))
    left, right = by_side
    return {"distance_mm": mean, "distance_left_mm": left, "distance_right_mm": right, "distance95_mm": quantile}


def aligned_distances(surface: TriangleMesh, observed: TriangleMesh) -> dict[str, float]:
    """Align a surface rigidly with the observed one, and return their `surface_distances`."""
    return surface_distances(pairwise_distances(align(surface, observed), observed))


def bootstrap_distances(pair: list[VertexDistances], points: Floats, patch: Ints, drawn: Ints) -> Floats:
    """Return the (k,) mean distances in mm in k bootstrap samples of patches.

    `drawn` (k, p) counts how often each of p patches is in a sample; `patch` (n,) is the patch of each of `points`
    (n, 3). Every vertex belongs to the patch of the nearest point.
    """
    tree, means = cKDTree(points), []
    for mesh, distances in pair:
        vertex_patch, areas = patch[tree.query(mesh.vertices)[1]], vertex_areas(mesh)
        sums, total = (
            np.bincount(vertex_patch, weights, minlength=drawn.shape[1]) for weights in (areas * distances, areas)
        )
        means.append((drawn @ sums) / (drawn @ total))
    return np.asarray(np.mean(means, axis=0))
