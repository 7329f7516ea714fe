"""Points inside surfaces, nearest and matching points, crossing faces, and transfer of
values between surfaces."""

from collections.abc import Iterable
from dataclasses import dataclass

import igl
import igl.predicates
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from .triangles import (
    Floats,
    Ints,
    TriangleMesh,
    corners,
    edges,
    face_normals,
    transformed,
    vertex_normals,
)

MIN_NORMAL_COSINE = 0.5
"""Normals agree if their cosine is at least this: 60 degrees."""

NEIGHBOURS = (16, 64, 256)
"""Numbers of nearest vertices that are searched for one with an agreeing normal, in
turn."""


@dataclass(frozen=True, eq=False)
class Match:
    """Matching points on a surface, as face corners and barycentric weights (n, 3).

    `agrees` (n,) is False if no normal nearby agrees, so that the nearest point was
    taken.
    """

    corners: Ints
    weights: Floats
    distance_mm: Floats
    agrees: NDArray[np.bool_]


def nearest_on(points: Floats, surface: TriangleMesh) -> tuple[Floats, Ints, Floats]:
    """Return the (n,) distances of points from a surface, and faces and (n, 3)
    positions of its nearest points."""
    squared, face, place = igl.point_mesh_squared_distance(
        points, surface.vertices, surface.faces
    )
    return np.sqrt(squared), face.astype(np.int64), place


def surface_distance(
    ways: Iterable[tuple[Floats, Floats]], share: float = 0.95
) -> tuple[float, float]:
    """Summarise the distance between two surfaces from the (n,) distances and weights
    of the points of either.

    The first value is the mean of both weighted means, the second the larger of both
    weighted quantiles at `share`.
    """
    both = list(ways)
    mean = float(
        np.mean([np.average(distance, weights=weights) for distance, weights in both])
    )
    far = [
        np.quantile(distance, share, weights=weights, method="inverted_cdf")
        for distance, weights in both
    ]
    return mean, float(max(far))


def layer_thickness(outer: TriangleMesh, inner: TriangleMesh) -> Floats:
    """Return the (n,) thickness in mm of the layer between two surfaces, at the
    vertices of the outer one.

    The mean distance to the nearest inner point and back (Fischl and Dale 2000, doi
    10.1073/pnas.200033797).
    """
    inward, _, nearest = nearest_on(outer.vertices, inner)
    outward, _, _ = nearest_on(nearest, outer)
    return 0.5 * (inward + outward)


def surface_mask(
    mesh: TriangleMesh, voxel_mm: float, box: Floats | None = None
) -> tuple[NDArray[np.int32], Floats]:
    """Return a volume, 1 inside a closed surface, and its affine; 4 voxels around it or
    a (2, 3) `box`."""
    low, high = (
        (mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)) if box is None else box
    )
    low = low - 4 * voxel_mm
    shape = np.ceil((high - low) / voxel_mm + 4).astype(int) + 1
    affine = np.diag([voxel_mm, voxel_mm, voxel_mm, 1.0])
    affine[:3, 3] = low
    return _inside(mesh, tuple(shape), affine).astype(np.int32), affine


def layer_labels(
    mesh: TriangleMesh, thickness: Floats, shape: tuple[int, ...], affine: Floats
) -> NDArray[np.int32]:
    """Return labels in a volume's grid, its (4, 4) affine in mm: 2 less deep than (n,)
    thickness in mm, 1 deeper."""
    inside = np.argwhere(_inside(mesh, shape, affine))
    depth, faces, _ = nearest_on(inside @ affine[:3, :3].T + affine[:3, 3], mesh)
    labels = np.zeros(shape, dtype=np.int32)
    labels[tuple(inside.T)] = np.where(
        depth <= thickness[mesh.faces[faces]].mean(axis=1), 2, 1
    )
    return labels


def _inside(
    mesh: TriangleMesh, shape: tuple[int, ...], affine: Floats
) -> NDArray[np.bool_]:
    """Return the (i, j, k) mask of the voxels whose centres lie inside a closed
    surface, by winding numbers.

    These change by ±1 where a line of voxels along k crosses a face. Both faces of an
    edge agree on which side a line passes, and a line through an edge or vertex counts
    as shifted by (ε, ε²), ε → 0, so each crossing counts once.
    """
    index = transformed(mesh, np.linalg.inv(affine))
    flat, heights, faces = index.vertices[:, :2], index.vertices[:, 2], index.faces
    # the lines (i, j) that may cross each face
    low = np.maximum(np.ceil(flat[faces].min(axis=1)), 0).astype(np.int64)
    high = np.minimum(
        np.floor(flat[faces].max(axis=1)), np.array(shape[:2]) - 1
    ).astype(np.int64)
    sizes = np.maximum(high - low + 1, 0)
    counts = sizes.prod(axis=1)
    face = np.repeat(np.arange(len(faces)), counts)
    order = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts)
    lines = low[face] + np.stack(np.divmod(order, sizes[face, 1]), axis=1)
    sides, is_left = np.zeros((3, len(face))), np.zeros((3, len(face)), dtype=bool)
    for corner in range(3):
        ends = faces[face][:, [corner - 2, corner - 1]]
        forwards = ends[:, 0] < ends[:, 1]
        along = np.diff(flat[np.sort(ends)], axis=1)[:, 0]
        offset = lines - flat[ends.min(axis=1)]
        side = along[:, 0] * offset[:, 1] - along[:, 1] * offset[:, 0]
        shifted = (along[:, 1] < 0) | ((along[:, 1] == 0) & (along[:, 0] > 0))
        sides[corner] = np.abs(side)
        is_left[corner] = ((side > 0) | ((side == 0) & shifted)) == forwards
    upwards, downwards = (np.asarray(way.all(axis=0)) for way in (is_left, ~is_left))
    crosses = (upwards | downwards) & (sides.sum(axis=0) > 0)
    weights = sides[:, crosses] / sides[:, crosses].sum(axis=0)
    crossing = np.einsum("ij,ji->j", weights, heights[faces[face[crosses]]])
    first = np.clip(np.ceil(crossing), 0, shape[2]).astype(np.int64)
    winding = np.zeros((shape[0], shape[1], shape[2] + 1), dtype=np.int64)
    np.add.at(winding, (*lines[crosses].T, first), np.where(upwards[crosses], -1, 1))
    return np.asarray(winding.cumsum(axis=2)[:, :, :-1] > 0)


def faces_that_cross(mesh: TriangleMesh) -> Ints:
    """Return the faces that cut other faces, ascending, found with exact predicates."""
    _, pairs, _ = igl.predicates.find_self_intersections(mesh.vertices, mesh.faces)
    return np.unique(pairs).astype(np.int64)


def crossing_faces(mesh: TriangleMesh) -> int:
    """Return the number of faces that cut other faces."""
    return len(faces_that_cross(mesh))


def match_points(points: Floats, normals: Floats, mesh: TriangleMesh) -> Match:
    """Match (n, 3) points with unit normals to the nearest points of a surface whose
    normals agree.

    Thus the opposite wall of a sulcus or of the fissure is not taken. A match is the
    nearest point of the surface if the normal of its face agrees, or else the closest
    agreeing one of the 256 nearest vertices.
    """
    distance, face, on = nearest_on(points, mesh)
    nearest_corners = mesh.faces[face].astype(np.int64)
    weights = barycentric(on, corners(mesh)[face])
    agrees = (
        np.einsum("ij,ij->i", normals, face_normals(mesh)[face]) >= MIN_NORMAL_COSINE
    )
    tree, directions = cKDTree(mesh.vertices), vertex_normals(mesh)
    for count in NEIGHBOURS:
        unmatched = np.flatnonzero(~agrees)
        if not len(unmatched):
            break
        distances, vertices = tree.query(
            points[unmatched], k=min(count, len(mesh.vertices))
        )
        distances = distances.reshape(len(unmatched), -1)
        vertices = vertices.reshape(len(unmatched), -1)
        agreeing = (
            np.einsum("ik,ijk->ij", normals[unmatched], directions[vertices])
            >= MIN_NORMAL_COSINE
        )
        is_matched = agreeing.any(axis=1)
        first = agreeing.argmax(axis=1)[is_matched]
        rows = unmatched[is_matched]
        nearest_corners[rows] = vertices[is_matched, first][:, None]
        weights[rows] = [1.0, 0.0, 0.0]
        distance[rows] = distances[is_matched, first]
        agrees[rows] = True
    return Match(nearest_corners, weights, distance, agrees)


def match_layers(
    points: Floats,
    normals: Floats,
    inner: Floats,
    mesh: TriangleMesh,
    inner_of_mesh: Floats,
) -> Match:
    """Match (n, 3) points with unit normals to a surface by their places and by those
    of tissue below them.

    `inner` (n, 3) and `inner_of_mesh`, at the vertices of the mesh, are points of that
    tissue: they distinguish the banks of a sulcus, and its bottom from its lips, also
    where one surface has no sulcus yet. A match has the smallest sum of both squared
    distances, among the match by normals, the vertices of the mesh and the middles of
    its edges.
    """
    match = match_points(points, normals, mesh)
    misfit = [
        values_at(match, mesh.vertices) - points,
        values_at(match, inner_of_mesh) - inner,
    ]
    ends = np.concatenate(
        [np.repeat(np.arange(len(mesh.vertices))[:, None], 2, axis=1), edges(mesh)[0]]
    )
    places = np.hstack(
        [mesh.vertices[ends].mean(axis=1), inner_of_mesh[ends].mean(axis=1)]
    )
    distance, nearest = cKDTree(places).query(np.hstack([points, inner]))
    better = distance < np.linalg.norm(np.hstack(misfit), axis=1)
    rows, nearest = np.flatnonzero(better), nearest[better]
    match.corners[rows] = ends[nearest][:, [0, 1, 1]]
    match.weights[rows] = [0.5, 0.5, 0.0]
    match.distance_mm[rows] = np.linalg.norm(places[nearest, :3] - points[rows], axis=1)
    return Match(
        match.corners,
        match.weights,
        match.distance_mm,
        np.ones(len(points), dtype=bool),
    )


def match_surface(mesh: TriangleMesh, surface: TriangleMesh) -> Match:
    """Match the vertices of a mesh to the nearest points of another surface whose
    normals agree."""
    return match_points(mesh.vertices, vertex_normals(mesh), surface)


def values_at(match: Match, values: NDArray) -> Floats:
    """Return (n,) or (n, k) values at matched points from those at the surface's
    vertices, linear in each face."""
    weights = match.weights if values.ndim == 1 else match.weights[..., None]
    return np.asarray((values[match.corners] * weights).sum(axis=1))


def interpolation(match: Match, size: int) -> sparse.csr_matrix:
    """Return the matrix (n, size) that takes values at the vertices of a surface to the
    n matching points."""
    rows = np.repeat(np.arange(len(match.corners)), 3)
    return sparse.csr_matrix(
        (match.weights.ravel(), (rows, match.corners.ravel())),
        (len(match.corners), size),
    )


def labels_at(match: Match, labels: NDArray[np.integer]) -> Ints:
    """Return the (n,) labels at matched points, those of the nearest corner of the
    face."""
    nearest = match.weights.argmax(axis=1)
    return np.asarray(
        labels[match.corners[np.arange(len(nearest)), nearest]], dtype=np.int64
    )


def barycentric(points: Floats, triangles: Floats) -> Floats:
    """Return the (n, 3) coordinates of points in the planes of (n, 3, 3) triangles;
    flat triangles give a corner."""
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
