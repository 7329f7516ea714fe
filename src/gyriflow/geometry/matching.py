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
    Indices,
    Ints,
    Mask,
    TriangleMesh,
    corners,
    dots,
    edges,
    face_normals,
    order_along_curve,
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
    agrees: Mask


def nearest_on(points: Floats, surface: TriangleMesh) -> tuple[Floats, Ints, Floats]:
    """Return the (n,) distances of points from a surface, and faces and (n, 3)
    positions of its nearest points."""
    order = order_along_curve(points)
    found = igl.point_mesh_squared_distance(
        points[order],
        surface.vertices,
        surface.faces,
    )
    squared, face, place = (np.empty_like(values) for values in found)
    squared[order], face[order], place[order] = found
    return np.sqrt(squared), face.astype(np.int64), place


def surface_distance(
    ways: Iterable[tuple[Floats, Floats]], share: float = 0.95
) -> tuple[float, float]:
    """Summarise the distance between two surfaces from the (n,) distances and weights
    of the points of either.

    The first value is the mean of both weighted means, the second the larger of both
    weighted quantiles at `share`.
    """
    means = []
    quantiles = []
    for distances, weights in ways:
        means.append(np.average(distances, weights=weights))
        quantile = np.quantile(
            distances,
            share,
            weights=weights,
            method="inverted_cdf",
        )
        quantiles.append(float(quantile))
    return float(np.mean(means)), max(quantiles)


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
    mesh: TriangleMesh,
    voxel_mm: float,
    box: Floats | None = None,
) -> tuple[NDArray[np.int32], Floats]:
    """Return a volume, 1 inside a closed surface, and its affine; 4 voxels around it or
    a (2, 3) `box`."""
    if box is None:
        box = np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
    low, high = box
    low = low - 4 * voxel_mm
    size = np.ceil((high - low) / voxel_mm + 4)
    shape = tuple(size.astype(int) + 1)
    affine = np.diag([voxel_mm, voxel_mm, voxel_mm, 1.0])
    affine[:3, 3] = low
    return _inside_mask(mesh, shape, affine).astype(np.int32), affine


def layer_labels(
    mesh: TriangleMesh,
    thickness: Floats,
    shape: tuple[int, ...],
    affine: Floats,
) -> NDArray[np.int32]:
    """Return labels in a volume's grid, its (4, 4) affine in mm: 2 less deep than (n,)
    thickness in mm, 1 deeper."""
    index = np.argwhere(_inside_mask(mesh, shape, affine))
    centres = index @ affine[:3, :3].T + affine[:3, 3]
    depth, faces, _ = nearest_on(centres, mesh)
    thickness_there = thickness[mesh.faces[faces]].mean(axis=1)
    labels = np.zeros(shape, dtype=np.int32)
    labels[tuple(index.T)] = np.where(depth <= thickness_there, 2, 1)
    return labels


def _inside_mask(
    mesh: TriangleMesh,
    shape: tuple[int, ...],
    affine: Floats,
) -> Mask:
    """Return the (i, j, k) mask of the voxels whose centres lie inside a closed
    surface, by winding numbers.

    These change by ±1 where a line of voxels along k crosses a face.
    """
    in_voxels = transformed(mesh, np.linalg.inv(affine))
    lines, heights, is_upwards = _crossings(in_voxels, shape)
    columns, rows, layers = shape
    first = np.clip(np.ceil(heights), 0, layers)
    first = first.astype(np.int64)
    # crossings above the volume count in a layer of their own
    changes = np.zeros(
        (columns, rows, layers + 1),
        dtype=np.int64,
    )
    change = np.where(is_upwards, -1, 1)
    np.add.at(
        changes,
        (*lines.T, first),
        change,
    )
    winding = changes.cumsum(axis=2)
    is_inside = winding > 0
    return is_inside[..., :layers]


def _crossings(mesh: TriangleMesh, shape: tuple[int, ...]) -> tuple[Ints, Floats, Mask]:
    """Return where lines along k through a volume of this shape cross a surface: the
    (n, 2) indices of the lines, the (n,) heights, and whether faces look upwards there.

    Both faces of an edge agree on which side a line passes, and a line through an edge
    or vertex counts as shifted by (ε, ε²), ε → 0, so each crossing counts once.
    """
    flat = mesh.vertices[:, :2]
    lines, face = _lines_near_faces(flat[mesh.faces], shape)
    corners_of_face = mesh.faces[face]
    all_sides = []
    all_left = []
    for corner in range(3):
        start = corners_of_face[:, corner - 2]
        end = corners_of_face[:, corner - 1]
        # along the edge from the vertex of the smaller number
        low = np.minimum(start, end)
        along = flat[np.maximum(start, end)] - flat[low]
        offset = lines - flat[low]
        along_x, along_y = along.T
        offset_x, offset_y = offset.T
        side = along_x * offset_y - along_y * offset_x
        is_shifted_left = (along_y < 0) | ((along_y == 0) & (along_x > 0))
        is_left = (side > 0) | ((side == 0) & is_shifted_left)
        all_sides.append(np.abs(side))
        all_left.append(is_left == (start < end))
    is_upwards = np.all(all_left, axis=0)
    is_downwards = ~np.any(all_left, axis=0)
    sides = np.stack(all_sides)
    crosses = (is_upwards | is_downwards) & (sides.sum(axis=0) > 0)
    sides = sides[:, crosses]
    weights = sides / sides.sum(axis=0)
    corner_heights = mesh.vertices[corners_of_face[crosses], 2]
    heights = np.einsum("ij,ji->j", weights, corner_heights)
    return lines[crosses], heights, is_upwards[crosses]


def _lines_near_faces(corners: Floats, shape: tuple[int, ...]) -> tuple[Ints, Ints]:
    """Return the (n, 2) lines of voxels that may cross the (m, 3, 2) corners of faces,
    and the (n,) face of each."""
    low = np.ceil(corners.min(axis=1))
    low = np.maximum(low, 0)
    high = np.floor(corners.max(axis=1))
    last = np.array(shape[:2]) - 1
    high = np.minimum(high, last)
    sizes = np.maximum(high - low + 1, 0)
    sizes = sizes.astype(np.int64)
    counts = sizes.prod(axis=1)
    faces = np.arange(len(corners))
    face = np.repeat(faces, counts)
    # the lines of a face are numbered by rows
    ends = np.cumsum(counts)
    starts = ends - counts
    number = np.arange(len(face)) - starts[face]
    widths = sizes[:, 1]
    offset = np.divmod(number, widths[face])
    first = low.astype(np.int64)
    return first[face] + np.stack(offset, axis=1), face


def faces_that_cross(mesh: TriangleMesh) -> Ints:
    """Return the faces that cut other faces, ascending, found with exact predicates."""
    _, pairs, _ = igl.predicates.find_self_intersections(mesh.vertices, mesh.faces)
    return np.unique(pairs).astype(np.int64)


def match_points(
    points: Floats,
    normals: Floats,
    mesh: TriangleMesh,
) -> Match:
    """Match (n, 3) points with unit normals to the nearest points of a surface whose
    normals agree.

    Thus the opposite wall of a sulcus or of the fissure is not taken. A match is the
    nearest point of the surface if the normal of its face agrees, or else the closest
    agreeing one of the 256 nearest vertices.
    """
    distance, face, places = nearest_on(points, mesh)
    nearest_corners = mesh.faces[face]
    weights = barycentric(places, corners(mesh)[face])
    agrees = dots(normals, face_normals(mesh)[face]) >= MIN_NORMAL_COSINE
    tree = cKDTree(mesh.vertices)
    directions = vertex_normals(mesh)
    for count in NEIGHBOURS:
        unmatched = np.flatnonzero(~agrees)
        if not len(unmatched):
            break
        # a list of ranks, so that also one neighbour is a column
        ranks = np.arange(min(count, len(mesh.vertices))) + 1
        distances, vertices = tree.query(points[unmatched], k=ranks)
        cosines = np.einsum(
            "ik,ijk->ij",
            normals[unmatched],
            directions[vertices],
        )
        is_agreeing = cosines >= MIN_NORMAL_COSINE
        is_matched = is_agreeing.any(axis=1)
        first = is_agreeing.argmax(axis=1)[is_matched]
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
    misfit = values_at(match, mesh.vertices) - points
    inner_misfit = values_at(match, inner_of_mesh) - inner
    distance = np.linalg.norm(
        np.hstack([misfit, inner_misfit]),
        axis=1,
    )
    # a vertex is an edge with equal ends
    vertices = np.arange(len(mesh.vertices))
    pairs, _ = edges(mesh)
    ends = np.concatenate([np.column_stack([vertices, vertices]), pairs])
    places = mesh.vertices[ends].mean(axis=1)
    inner_places = inner_of_mesh[ends].mean(axis=1)
    tree = cKDTree(np.hstack([places, inner_places]))
    order = order_along_curve(points)
    other_distance = np.empty(len(points))
    nearest = np.empty(len(points), dtype=np.int64)
    other_distance[order], nearest[order] = tree.query(
        np.hstack([points, inner])[order]
    )
    rows = np.flatnonzero(other_distance < distance)
    nearest = nearest[rows]
    match.corners[rows] = ends[nearest][:, [0, 1, 1]]
    match.weights[rows] = [0.5, 0.5, 0.0]
    match.distance_mm[rows] = np.linalg.norm(
        places[nearest] - points[rows],
        axis=1,
    )
    match.agrees[:] = True
    return match


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
    count = len(match.corners)
    rows = np.repeat(np.arange(count), 3)
    columns = match.corners.ravel()
    weights = match.weights.ravel()
    return sparse.csr_matrix(
        (weights, (rows, columns)),
        shape=(count, size),
    )


def labels_at(match: Match, labels: Indices) -> Ints:
    """Return the (n,) labels at matched points, those of the nearest corner of the
    face."""
    nearest = match.weights.argmax(axis=1)
    rows = np.arange(len(nearest))
    vertices = match.corners[rows, nearest]
    return labels[vertices].astype(np.int64)


def barycentric(points: Floats, triangles: Floats) -> Floats:
    """Return the (n, 3) barycentric coordinates of points in (n, 3, 3) triangles.

    The points are in their triangles but for rounding, which is clipped. Flat triangles
    give their first corner.
    """
    a, b, c = triangles.transpose(1, 0, 2)
    u = b - a
    v = c - a
    w = points - a
    uu = dots(u, u)
    uv = dots(u, v)
    vv = dots(v, v)
    wu = dots(w, u)
    wv = dots(w, v)
    size = uu * vv - uv * uv
    flat = size <= 1e-12 * np.maximum(uu, vv) ** 2
    size[flat] = 1.0
    second = (vv * wu - uv * wv) / size
    third = (uu * wv - uv * wu) / size
    second[flat] = 0.0
    third[flat] = 0.0
    weights = np.stack(
        [1.0 - second - third, second, third],
        axis=1,
    )
    weights = np.clip(weights, 0.0, 1.0)
    return weights / weights.sum(axis=1, keepdims=True)
