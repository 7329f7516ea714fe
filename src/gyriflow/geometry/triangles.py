"""Triangle surfaces: a frozen pair of arrays, and measures of it."""

from dataclasses import dataclass

import numpy as np
import scipy  # submodules load lazily, which keeps dry runs fast
from numpy.typing import ArrayLike, NDArray

from ..errors import MeshError
from ..units import CM2_PER_MM2, ML_PER_MM3

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

# faces whose angle (radians) is smaller coincide
COINCIDENCE_TOL = 1e-3


def frozen(values: ArrayLike, dtype: type, width: int) -> NDArray:
    """Return a read-only (n, width) copy of `values`; ValueError for another shape."""
    array: NDArray = np.array(values, dtype=dtype, order="C")
    if array.ndim != 2 or array.shape[1] != width:
        raise ValueError(f"expected an (n, {width}) array, found shape {array.shape}")
    array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A triangle surface: (n, 3) vertices in mm, and (m, 3) faces, their indices
    counter-clockwise from outside."""

    vertices: Floats
    faces: Ints

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen(self.vertices, np.float64, 3))
        object.__setattr__(self, "faces", frozen(self.faces, np.int64, 3))
        if len(self.faces) and not 0 <= self.faces.min() <= self.faces.max() < len(
            self.vertices
        ):
            raise ValueError("a face has a vertex index out of range")


def corners(mesh: TriangleMesh) -> Floats:
    """Return the (m, 3, 3) corner positions of the faces in mm."""
    return mesh.vertices[mesh.faces]


def area_vectors(mesh: TriangleMesh) -> Floats:
    """Return the (m, 3) face normals with the face areas (mm²) as lengths."""
    a, b, c = corners(mesh).transpose(1, 0, 2)
    return 0.5 * np.cross(b - a, c - a)


def face_areas(mesh: TriangleMesh) -> Floats:
    """Return the (m,) face areas in mm²."""
    return np.linalg.norm(area_vectors(mesh), axis=1)


def area(mesh: TriangleMesh) -> float:
    """Return the area in mm²."""
    return float(face_areas(mesh).sum())


def signed_volume(mesh: TriangleMesh) -> float:
    """Return the enclosed volume in mm³, negative if the faces are oriented inward
    (divergence theorem)."""
    a, b, c = corners(mesh).transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def area_cm2(mesh: TriangleMesh) -> float:
    """Return the area of a mesh in mm, in cm²."""
    return area(mesh) * CM2_PER_MM2


def volume_ml(mesh: TriangleMesh) -> float:
    """Return the volume that a closed mesh in mm encloses, in mL; negative where its
    faces look inwards."""
    return signed_volume(mesh) * ML_PER_MM3


def unit(vectors: Floats) -> Floats:
    """Return (n, 3) vectors scaled to length one; zero vectors stay zero."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0, lengths, 1.0)


def face_normals(mesh: TriangleMesh) -> Floats:
    """Return the (m, 3) unit face normals."""
    return unit(area_vectors(mesh))


def scatter_to_vertices(mesh: TriangleMesh, face_values: NDArray) -> Floats:
    """Return per vertex the sum of (m,) or (m, k) values over its faces."""
    corner = np.repeat(np.arange(len(mesh.faces)), 3)
    incidence = scipy.sparse.csr_matrix(
        (np.ones(corner.size), (mesh.faces.ravel(), corner)),
        shape=(len(mesh.vertices), len(mesh.faces)),
    )
    return incidence @ face_values


def vertex_normals(mesh: TriangleMesh) -> Floats:
    """Return the (n, 3) unit vertex normals: area-weighted means of the normals of
    adjacent faces."""
    return unit(scatter_to_vertices(mesh, area_vectors(mesh)))


def vertex_areas(mesh: TriangleMesh) -> Floats:
    """Return the (n,) areas of the vertices in mm²: a third of each adjacent face."""
    return np.asarray(
        scatter_to_vertices(mesh, face_areas(mesh)) / 3.0, dtype=np.float64
    )


def edges(mesh: TriangleMesh) -> tuple[Ints, Ints]:
    """Return the (e, 2) undirected edges, each once and sorted, and the (e,) number of
    faces at each."""
    pairs = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    # one number per edge: much faster than comparing rows
    count = len(mesh.vertices)
    keys, uses = np.unique(pairs @ [count, 1], return_counts=True)
    return np.stack(np.divmod(keys, count), axis=1), uses


def mean_edge_length(mesh: TriangleMesh) -> float:
    """Return the mean edge length in mm."""
    return mean_length(mesh.vertices, edges(mesh)[0])


def edge_lengths(vertices: Floats, pairs: NDArray[np.integer]) -> Floats:
    """Return the (e,) lengths of edges given as (e, 2) vertex indices, in the vertices'
    unit."""
    return np.asarray(
        np.linalg.norm(vertices[pairs[:, 1]] - vertices[pairs[:, 0]], axis=1)
    )


def mean_length(vertices: Floats, pairs: NDArray[np.integer]) -> float:
    """Return the mean length of edges given as (e, 2) vertex indices, in the vertices'
    unit."""
    return float(edge_lengths(vertices, pairs).mean())


def is_closed(mesh: TriangleMesh) -> bool:
    """Return whether every edge has exactly two faces that run along it in opposite
    directions."""
    directed = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    if not len(directed) or len(np.unique(directed @ [len(mesh.vertices), 1])) != len(
        directed
    ):
        return False
    _, counts = edges(mesh)
    return bool((counts == 2).all())


def euler_number(mesh: TriangleMesh) -> int:
    """Return vertices − edges + faces, counting used vertices only: 2 for each closed
    surface without handles."""
    return int(len(np.unique(mesh.faces)) - len(edges(mesh)[0]) + len(mesh.faces))


def face_components(mesh: TriangleMesh) -> Ints:
    """Return the (m,) number of the connected component of each face, the largest area
    first (0)."""
    label = connected(mesh.faces[:, [0, 1, 1, 2]].reshape(-1, 2), len(mesh.vertices))
    _, component = np.unique(label[mesh.faces[:, 0]], return_inverse=True)
    order = np.argsort(-np.bincount(component, weights=face_areas(mesh)), kind="stable")
    return np.argsort(order)[component]


def split_sheets(mesh: TriangleMesh) -> TriangleMesh:
    """Split a surface into manifold sheets at edges of more than two faces, and at
    vertices where sheets meet.

    At such an edge two faces belong to one sheet if they use it in opposite directions
    and have the inside between them: those with the smallest sum of angles inside are
    paired. A manifold surface is returned unchanged.
    """
    faces, count = mesh.faces, len(mesh.vertices)
    # half-edge 3 f + k starts at corner k of face f
    start, end, apex = (np.roll(faces, -k, axis=1).ravel() for k in range(3))
    following = np.roll(np.arange(faces.size).reshape(-1, 3), -1, axis=1).ravel()
    keys = np.minimum(start, end) * count + np.maximum(start, end)
    order = np.argsort(keys, kind="stable")
    _, first, uses = np.unique(keys[order], return_index=True, return_counts=True)
    pairs, ambiguous = [order[first[uses == 2, None] + [0, 1]]], []
    is_forward = (start < end) == (signed_volume(mesh) >= 0)
    for place, number in zip(first[uses > 2], uses[uses > 2], strict=True):
        around = order[place : place + number]
        sides = around[~is_forward[around]], around[is_forward[around]]
        low, high = mesh.vertices[np.sort([start[around[0]], end[around[0]]])]
        axis = (high - low) / np.linalg.norm(high - low)
        arms = [mesh.vertices[apex[side]] - low for side in (around[:1], *sides)]
        radial = arms[0][0] - (arms[0][0] @ axis) * axis
        backward, forward = (
            np.arctan2(arm @ np.cross(axis, radial), arm @ radial) for arm in arms[1:]
        )
        inside = (forward - backward[:, None] - COINCIDENCE_TOL) % (2.0 * np.pi)
        matched = scipy.optimize.linear_sum_assignment(inside)
        if inside[matched].sum() <= 2.0 * np.pi:
            pairs.append(
                np.stack(
                    [side[index] for side, index in zip(sides, matched, strict=True)],
                    axis=1,
                )
            )
        else:
            ambiguous.append(sides)
    # where faces overlap, faces of the same sheet elsewhere are paired
    sheet = connected(np.concatenate(pairs) // 3, len(faces))
    for sides in ambiguous:
        matched = scipy.optimize.linear_sum_assignment(
            sheet[sides[0] // 3][:, None] != sheet[sides[1] // 3]
        )
        pairs.append(
            np.stack(
                [side[index] for side, index in zip(sides, matched, strict=True)],
                axis=1,
            )
        )
    edge, partner = np.concatenate(pairs).T
    is_opposite = start[edge] != start[partner]
    joined = np.where(
        is_opposite, [following[partner], partner], [partner, following[partner]]
    )
    corner = connected(
        np.concatenate([[edge, following[edge]], joined]).reshape(2, -1).T, faces.size
    )
    _, first = np.unique(corner, return_index=True)
    if len(first) == len(np.unique(faces)):
        return mesh
    return TriangleMesh(mesh.vertices[faces.ravel()[first]], corner.reshape(-1, 3))


def connected(pairs: NDArray[np.integer], count: int) -> Ints:
    """Return the (count,) number of the connected component of each of `count` nodes,
    from (k, 2) links."""
    graph = scipy.sparse.coo_matrix(
        (np.ones(len(pairs)), pairs.T), shape=(count, count)
    )
    return scipy.sparse.csgraph.connected_components(graph, directed=False)[1]


def smallest_patch(mesh: TriangleMesh, loop: Ints) -> Ints:
    """Return the (n - 2, 3) faces of the smallest area that close a hole with the (n,)
    vertices `loop`, in order.

    No edge of the surface is used inside the patch (Barequet and Sharir 1995, doi
    10.1016/0167-8396(94)00011-G).
    """
    count, points = len(loop), mesh.vertices[loop]
    place = np.full(len(mesh.vertices), -1)
    place[loop] = np.arange(count)
    pairs = np.sort(place[edges(mesh)[0]], axis=1)
    low, high = pairs[pairs[:, 0] >= 0].T
    # smallest area that the loop from vertex i to j and the edge j-i enclose, and the
    # third vertex of the face there
    cost, third = np.zeros((count, count)), np.zeros((count, count), dtype=int)
    for gap in range(2, count):
        first = np.arange(count - gap)
        middle = first[:, None] + np.arange(1, gap)
        a, b, c = points[first][:, None], points[middle], points[first + gap][:, None]
        areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=-1)
        totals = (
            cost[first[:, None], middle] + cost[middle, first[:, None] + gap] + areas
        )
        third[first, first + gap] = first + 1 + totals.argmin(axis=1)
        cost[first, first + gap] = totals.min(axis=1)
        if gap < count - 1:
            cost[low[high - low == gap], high[high - low == gap]] = np.inf
    faces, spans = [], [(0, count - 1)]
    while spans:
        start, end = spans.pop()
        if end - start > 1:
            middle = third[start, end]
            faces.append((start, middle, end))
            spans += [(start, middle), (middle, end)]
    return loop[np.array(faces)]


def convex_hull(mesh: TriangleMesh) -> TriangleMesh:
    """Return the convex hull, its faces outward; MeshError for a flat surface."""
    try:
        hull = scipy.spatial.ConvexHull(mesh.vertices)
    except scipy.spatial.QhullError as error:
        raise MeshError(
            "the surface has no convex hull", remedy="It must enclose a volume"
        ) from error
    faces = np.asarray(hull.simplices, dtype=np.int64)
    a, b, c = mesh.vertices[faces].transpose(1, 0, 2)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    used, local = np.unique(faces, return_inverse=True)
    return TriangleMesh(mesh.vertices[used], local.reshape(-1, 3))


def submesh(mesh: TriangleMesh, keep: NDArray[np.bool_]) -> tuple[TriangleMesh, Ints]:
    """Return the surface of the faces where the (m,) mask `keep` holds, and its
    vertices' indices in `mesh`."""
    used, faces = np.unique(mesh.faces[keep], return_inverse=True)
    return TriangleMesh(mesh.vertices[used], faces.reshape(-1, 3)), used


def merged(*meshes: TriangleMesh) -> TriangleMesh:
    """Return the surfaces side by side in one, without joining vertices."""
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return TriangleMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate(
            [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]
        ),
    )


def flipped(mesh: TriangleMesh) -> TriangleMesh:
    """Return the surface with every face flipped."""
    return TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


def transformed(mesh: TriangleMesh, matrix: ArrayLike) -> TriangleMesh:
    """Apply a (4, 4) affine matrix to a surface; faces are flipped if it mirrors."""
    matrix = np.asarray(matrix, dtype=float)
    moved = TriangleMesh(mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3], mesh.faces)
    return flipped(moved) if np.linalg.det(matrix[:3, :3]) < 0 else moved
