"""Nearest points of a surface whose normal agrees: not the other wall of a sulcus or fissure."""

from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .triangles import Floats, Ints, TriangleMesh, corners, face_normals, vertex_normals

AGREEING = 0.5
"""Least cosine between normals that agree: 60 degrees."""

NEIGHBOURS = (16, 64, 256)
"""How many nearest vertices are looked through for an agreeing one, in turn."""


@dataclass(frozen=True, eq=False)
class Match:
    """Points of a surface that were found for n points.

    Attributes
    ----------
    corners : (n, 3) int
        Vertices of the face that the point lies on.
    weights : (n, 3) float
        Barycentric coordinates there.
    distance_mm : (n,) float
    agrees : (n,) bool
        False where no normal near it agrees, and the nearest point of all was taken.
    """

    corners: Ints
    weights: Floats
    distance_mm: Floats
    agrees: NDArray[np.bool_]


def match_points(points: Floats, normals: Floats, mesh: TriangleMesh) -> Match:
    """Returns for (n, 3) points with unit normals the nearest points of a surface whose normal agrees.

    That is the nearest point of all where the face there agrees; else the nearest of the 256 nearest vertices that
    does.
    """
    squared, face, on = igl.point_mesh_squared_distance(points, mesh.vertices, mesh.faces)
    found = mesh.faces[face].astype(np.int64)
    weights = _barycentric(on, corners(mesh)[face])
    distance = np.sqrt(squared)
    agrees = np.einsum("ij,ij->i", normals, face_normals(mesh)[face]) >= AGREEING
    tree, directions = cKDTree(mesh.vertices), vertex_normals(mesh)
    for count in NEIGHBOURS:
        left = np.flatnonzero(~agrees)
        if not len(left):
            break
        away, near = tree.query(points[left], k=min(count, len(mesh.vertices)))
        away, near = away.reshape(len(left), -1), near.reshape(len(left), -1)
        good = np.einsum("ik,ijk->ij", normals[left], directions[near]) >= AGREEING
        some = good.any(axis=1)
        first = good.argmax(axis=1)[some]
        rows = left[some]
        found[rows] = near[some, first][:, None]
        weights[rows] = [1.0, 0.0, 0.0]
        distance[rows] = away[some, first]
        agrees[rows] = True
    return Match(found, weights, distance, agrees)


def values_at(match: Match, values: NDArray) -> Floats:
    """Returns (n,) or (n, k) values at matched points from those at the surface's vertices, linear in each face."""
    weights = match.weights if values.ndim == 1 else match.weights[..., None]
    return np.asarray((values[match.corners] * weights).sum(axis=1))


def labels_at(match: Match, labels: NDArray[np.integer]) -> Ints:
    """Returns the (n,) labels at matched points: those of the nearest corner of the face."""
    nearest = match.weights.argmax(axis=1)
    return np.asarray(labels[match.corners[np.arange(len(nearest)), nearest]], dtype=np.int64)


def _barycentric(points: Floats, triangles: Floats) -> Floats:
    """Returns the (n, 3) coordinates of points in the planes of (n, 3, 3) triangles; flat triangles give a corner."""
    a, b, c = triangles.transpose(1, 0, 2)
    u, v, w = b - a, c - a, points - a
    uu, uv, vv = (np.einsum("ij,ij->i", *pair) for pair in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("ij,ij->i", w, u), np.einsum("ij,ij->i", w, v)
    size = uu * vv - uv * uv
    flat = size <= 1e-12 * np.maximum(uu, vv) ** 2
    size = np.where(flat, 1.0, size)
    second = np.where(flat, 0.0, (vv * wu - uv * wv) / size)
    third = np.where(flat, 0.0, (uu * wv - uv * wu) / size)
    weights = np.clip(np.stack([1.0 - second - third, second, third], axis=1), 0.0, 1.0)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
