"""What lies inside surfaces, where they are near each other, match or cross, and values brought from one to another."""

from collections.abc import Iterable
from dataclasses import dataclass

import igl
import igl.predicates
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from .triangles import Floats, Ints, TriangleMesh, corners, face_normals, transformed, vertex_normals

AGREEING = 0.5
"""Least cosine between normals that agree: 60 degrees."""

NEIGHBOURS = (16, 64, 256)
"""How many nearest vertices are looked through for an agreeing one, in turn."""


@dataclass(frozen=True, eq=False)
class Match:
    """Points of a surface for n points, by the vertices of their face and barycentric weights (n, 3).

    `agrees` (n,) is False where no normal near it agrees, and the nearest point of all was taken.
    """

    corners: Ints
    weights: Floats
    distance_mm: Floats
    agrees: NDArray[np.bool_]


def nearest_on(points: Floats, surface: TriangleMesh) -> tuple[Floats, Ints, Floats]:
    """Return the (n,) distances of points from a surface, and the faces and (n, 3) positions of its nearest points."""
    squared, face, place = igl.point_mesh_squared_distance(points, surface.vertices, surface.faces)
    return np.sqrt(squared), face.astype(np.int64), place


def surface_distance(ways: Iterable[tuple[Floats, Floats]], share: float = 0.95) -> tuple[float, float]:
    """Summarise how far two surfaces are from each other, given the (n,) distances of points of either and weights.

    The mean of both weighted means, and the larger of the distances within which a `share` of each weight lies.
    """
    both = list(ways)
    mean = float(np.mean([np.average(away, weights=weights) for away, weights in both]))
    far = [np.quantile(away, share, weights=weights, method="inverted_cdf") for away, weights in both]
    return mean, float(max(far))


def layer_thickness(outer: TriangleMesh, inner: TriangleMesh) -> Floats:
    """Return the (n,) thickness in mm at the vertices of the outer surface of the layer between two surfaces.

    It is the mean of two distances: from the vertex to the nearest point of the inner surface, and from there to the
    nearest point of the outer one (Fischl and Dale 2000, doi 10.1073/pnas.200033797).
    """
    there, _, nearest = nearest_on(outer.vertices, inner)
    back, _, _ = nearest_on(nearest, outer)
    return 0.5 * (there + back)


def surface_mask(mesh: TriangleMesh, voxel_mm: float, box: Floats | None = None) -> tuple[NDArray[np.int32], Floats]:
    """Return a label volume with 1 inside a closed surface, and its (4, 4) affine: what a brain without labels has.

    The volume holds the surface with a margin of four voxels, or else the (2, 3) corners of a box with that margin.
    """
    low, high = (mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)) if box is None else box
    low = low - 4 * voxel_mm
    shape = np.ceil((high - low) / voxel_mm + 4).astype(int) + 1
    affine = np.diag([voxel_mm, voxel_mm, voxel_mm, 1.0])
    affine[:3, 3] = low
    return _inside(mesh, tuple(shape), affine).astype(np.int32), affine


def layer_labels(mesh: TriangleMesh, thickness: Floats, shape: tuple[int, ...], affine: Floats) -> NDArray[np.int32]:
    """Return an (i, j, k) label volume with 2 in the layer of (n,) thickness in mm below a closed surface, 1 deeper.

    `affine` (4, 4) leads from voxels to mm; what lies beyond the volume is not in it.
    """
    inside = np.argwhere(_inside(mesh, shape, affine))
    depth, faces, _ = nearest_on(inside @ affine[:3, :3].T + affine[:3, 3], mesh)
    labels = np.zeros(shape, dtype=np.int32)
    labels[tuple(inside.T)] = np.where(depth <= thickness[mesh.faces[faces]].mean(axis=1), 2, 1)
    return labels


def _inside(mesh: TriangleMesh, shape: tuple[int, ...], affine: Floats) -> NDArray[np.bool_]:
    """Return whether the centres of an (i, j, k) volume's voxels lie inside a closed surface, by winding numbers.

    They are asked for beside the surface, and once for each region of voxels that it does not part.
    """
    index = transformed(mesh, np.linalg.inv(affine))
    pieces, _ = trimesh.remesh.subdivide_to_size(index.vertices, index.faces, 1.0, max_iter=20)
    points = np.rint(pieces).astype(np.int64)
    beside = np.zeros(shape, dtype=bool)
    beside[tuple(points[((points >= 0) & (points < shape)).all(axis=1)].T)] = True
    beside = ndimage.binary_dilation(beside, np.ones((3, 3, 3)))
    regions, number = ndimage.label(~beside)
    some = np.zeros(number + 1, dtype=np.int64)
    some[regions.ravel()] = np.arange(regions.size)
    asked = np.stack(np.unravel_index(np.concatenate([some, np.flatnonzero(beside)]), shape), axis=1)
    winding = igl.fast_winding_number(index.vertices, index.faces, asked.astype(float)) > 0.5
    inside = winding[: len(some)][regions]
    inside[beside] = winding[len(some) :]
    return np.asarray(inside)


def faces_that_cross(mesh: TriangleMesh) -> Ints:
    """Return the faces that cut other faces, ascending, found with exact predicates."""
    _, pairs, _ = igl.predicates.find_self_intersections(mesh.vertices, mesh.faces)
    return np.unique(pairs).astype(np.int64)


def crossing_faces(mesh: TriangleMesh) -> int:
    """Return the number of faces that cut other faces."""
    return len(faces_that_cross(mesh))


def match_points(points: Floats, normals: Floats, mesh: TriangleMesh) -> Match:
    """Return for (n, 3) points with unit normals the nearest points of a surface whose normal agrees.

    So the other wall of a sulcus or of the fissure is not taken. It is the nearest point of all where the face there
    agrees; else the nearest of the 256 nearest vertices that does.
    """
    distance, face, on = nearest_on(points, mesh)
    nearest_corners = mesh.faces[face].astype(np.int64)
    weights = barycentric(on, corners(mesh)[face])
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
        nearest_corners[rows] = near[some, first][:, None]
        weights[rows] = [1.0, 0.0, 0.0]
        distance[rows] = away[some, first]
        agrees[rows] = True
    return Match(nearest_corners, weights, distance, agrees)


def match_surface(mesh: TriangleMesh, surface: TriangleMesh) -> Match:
    """Match the vertices of a mesh with the nearest points of another surface whose normal agrees."""
    return match_points(mesh.vertices, vertex_normals(mesh), surface)


def values_at(match: Match, values: NDArray) -> Floats:
    """Return (n,) or (n, k) values at matched points from those at the surface's vertices, linear in each face."""
    weights = match.weights if values.ndim == 1 else match.weights[..., None]
    return np.asarray((values[match.corners] * weights).sum(axis=1))


def labels_at(match: Match, labels: NDArray[np.integer]) -> Ints:
    """Return the (n,) labels at matched points: those of the nearest corner of the face."""
    nearest = match.weights.argmax(axis=1)
    return np.asarray(labels[match.corners[np.arange(len(nearest)), nearest]], dtype=np.int64)


def barycentric(points: Floats, triangles: Floats) -> Floats:
    """Return the (n, 3) coordinates of points in the planes of (n, 3, 3) triangles; flat triangles give a corner."""
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
