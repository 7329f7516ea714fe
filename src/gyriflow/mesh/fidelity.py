"""How well the surface of a mesh keeps to the one it was made from: distances and narrow gaps."""

from dataclasses import dataclass

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
STILL_OPEN = 0.5
"""A gap counts as kept where so much of its width is left."""


@dataclass(frozen=True, eq=False)
class GapWalls:
    """Faces of a closed surface that face a parallel wall across a narrow gap.

    Attributes
    ----------
    middle : (g, 3) float
        The middle of the gap before each face, in mm.
    normal : (g, 3) float
        Unit normal of the face.
    width : (g,) float
        Distance to the wall opposite, in mm.
    area : (g,) float
        Area of the face in mm².
    """

    middle: Floats
    normal: Floats
    width: Floats
    area: Floats


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


def gap_walls(mesh: TriangleMesh) -> GapWalls:
    """Returns the walls of narrow gaps of a closed surface, such as the fissure and sulci.

    From every face's centroid a ray goes outwards; where it meets a parallel wall within 3 mm, there is a gap.
    """
    normals = face_normals(mesh)
    start = corners(mesh).mean(axis=1) + OFF_MM * normals
    face, distance = _first_hits(mesh, start, normals)
    facing = face >= 0
    facing[facing] = np.einsum("ij,ij->i", normals[facing], normals[face[facing]]) < PARALLEL
    half = 0.5 * distance[facing, None] * normals[facing]
    return GapWalls(start[facing] + half, normals[facing], OFF_MM + distance[facing], face_areas(mesh)[facing])


def gap_summary(walls: GapWalls) -> dict[str, float | None]:
    """Returns the widths of gaps and the area of their walls.

    `percentile1` and `median` are widths in mm below which 1 % and half of the walls' area lies (None where there is
    no gap; at the bottom of a gap the width ends in 0, so that the least one says nothing), `area_mm2` is that area.
    """
    return {
        "percentile1": _quantile(walls.width, walls.area, 0.01) if len(walls.width) else None,
        "median": _quantile(walls.width, walls.area, 0.5) if len(walls.width) else None,
        "area_mm2": float(walls.area.sum()),
    }


def gap_kept(walls: GapWalls, mesh: TriangleMesh) -> float | None:
    """Returns the share of the walls' area before which another surface leaves the gap open; None without a gap.

    It is open where its middle is outside the closed surface `mesh`, and the walls of that are at least half as far
    apart there.
    """
    if not len(walls.width):
        return None
    # a ray finds the wall in front of it and the one behind
    width = np.zeros(len(walls.width))
    for sign in (1.0, -1.0):
        face, distance = _first_hits(mesh, walls.middle, sign * walls.normal)
        width += np.where(face >= 0, distance, GAP_MM)
    outside = igl.fast_winding_number(mesh.vertices, mesh.faces, walls.middle) < 0.5
    return float(walls.area[outside & (width >= STILL_OPEN * walls.width)].sum() / walls.area.sum())


def _first_hits(mesh: TriangleMesh, start: Floats, direction: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Returns the face that each of (n,) rays meets first within 3 mm, −1 where there is none, and its distance."""
    rays = igl.embree.EmbreeIntersector()
    rays.init(np.asfortranarray(mesh.vertices, dtype=np.float32), np.asfortranarray(mesh.faces, dtype=np.int32), True)
    hits = [
        rays.intersectRay_first(origin, towards, 0.0, GAP_MM)
        for origin, towards in zip(start.astype(np.float32), direction.astype(np.float32), strict=True)
    ]
    return np.array([hit[0] for hit in hits], dtype=np.int64), np.array([hit[1] for hit in hits], dtype=np.float64)


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
