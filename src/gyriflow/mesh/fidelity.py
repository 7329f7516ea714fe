"""How well the surface of a mesh keeps to the one it was made from: distances and narrow gaps."""

import igl
import igl.embree
import numpy as np
from numpy.typing import NDArray

from ..geometry.triangles import TriangleMesh, corners, face_areas, face_normals

Floats = NDArray[np.float64]

QUANTILE = 0.99
GAP_MM = 3.0
"""Walls that face each other within this distance are those of a gap."""
PARALLEL = -0.9
"""Cosine between the normals of walls that face each other; less opposed ones meet at the bottom of a gap."""
OFF_MM = 1e-4
"""A ray starts so far above its own face."""


def surface_distance(mesh: TriangleMesh, other: TriangleMesh) -> dict[str, float]:
    """Returns how far two surfaces are from each other, in mm.

    `hausdorff99` is the distance within which 99 % of either surface's area lies from the other surface, the larger of
    both directions; `hausdorff` is the largest distance found. Every face is sampled at the centroids of the four
    triangles between its corners and the middles of its edges, and for the largest distance at its corners.
    """
    ways = [_distances(mesh, other), _distances(other, mesh)]
    return {
        "hausdorff99": max(_quantile(distance, weight, QUANTILE) for distance, weight in ways),
        "hausdorff": max(float(distance.max()) for distance, _ in ways),
    }


def gaps(mesh: TriangleMesh) -> dict[str, float | None]:
    """Returns the narrow gaps between walls of a closed surface, such as the fissure and sulci.

    From every face's centroid a ray goes outwards; where it meets a parallel wall within 3 mm, there is a gap.
    `percentile1` and `median` are widths in mm below which 1 % and half of the walls' area lies (None where there is
    no gap; at the bottom of a gap the width ends in 0, so that the least one says nothing), `area_mm2` is that area.
    """
    normals = face_normals(mesh)
    start = corners(mesh).mean(axis=1) + OFF_MM * normals
    rays = igl.embree.EmbreeIntersector()
    rays.init(np.asfortranarray(mesh.vertices, dtype=np.float32), np.asfortranarray(mesh.faces, dtype=np.int32), True)
    hits = [
        rays.intersectRay_first(origin, direction, 0.0, GAP_MM)
        for origin, direction in zip(start.astype(np.float32), normals.astype(np.float32), strict=True)
    ]
    face = np.array([hit[0] for hit in hits])
    facing = face >= 0
    facing[facing] = np.einsum("ij,ij->i", normals[facing], normals[face[facing]]) < PARALLEL
    width = OFF_MM + np.array([hit[1] for hit in hits])[facing]
    area = face_areas(mesh)[facing]
    return {
        "percentile1": _quantile(width, area, 0.01) if len(width) else None,
        "median": _quantile(width, area, 0.5) if len(width) else None,
        "area_mm2": float(area.sum()),
    }


def _distances(mesh: TriangleMesh, other: TriangleMesh) -> tuple[Floats, Floats]:
    """Returns the distances in mm of (k,) points of a surface from another one, and the area in mm² of each."""
    a, b, c = corners(mesh).transpose(1, 0, 2)
    centroids = [(a + b + c) / 3, (4 * a + b + c) / 6, (a + 4 * b + c) / 6, (a + b + 4 * c) / 6]
    squared = igl.point_mesh_squared_distance(np.concatenate([*centroids, mesh.vertices]), other.vertices, other.faces)[
        0
    ]
    return np.sqrt(squared), np.concatenate([np.tile(face_areas(mesh) / 4, 4), np.zeros(len(mesh.vertices))])


def _quantile(values: Floats, weights: Floats, share: float) -> float:
    """Returns the value below which so much of the weight lies."""
    order = np.argsort(values)
    reached = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(reached, share * reached[-1]).clip(max=len(values) - 1)]])
