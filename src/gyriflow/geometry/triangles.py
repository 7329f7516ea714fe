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
Indices = NDArray[np.integer]
"""Integers of any size."""

CURVE_BITS = 10
"""Number of halvings of each axis for an order along a curve."""

# faces whose angle (radians) is smaller coincide
COINCIDENCE_TOL = 1e-3


def freeze(
    record: object,
    name: str,
    dtype: type,
    width: int,
    n_vertices: int | None = None,
) -> None:
    """Make a field of a frozen record a read-only (n, width) copy of its values.

    ValueError for another shape, or indices that are not among `n_vertices`.
    """
    array: NDArray = np.array(
        getattr(record, name),
        dtype=dtype,
        order="C",
    )
    if array.ndim != 2 or array.shape[1] != width:
        raise ValueError(f"expected (n, {width}) {name}, found shape {array.shape}")
    if (
        n_vertices is not None
        and array.size
        and not 0 <= array.min() <= array.max() < n_vertices
    ):
        raise ValueError(f"the {name} have a vertex index out of range")
    array.flags.writeable = False
    object.__setattr__(record, name, array)


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A triangle surface: (n, 3) vertices in mm, and (m, 3) faces, their indices
    counter-clockwise from outside."""

    vertices: Floats
    faces: Ints

    def __post_init__(self) -> None:
        freeze(self, "vertices", np.float64, 3)
        freeze(
            self,
            "faces",
            np.int64,
            3,
            len(self.vertices),
        )


def corners(mesh: TriangleMesh) -> Floats:
    """Return the (m, 3, 3) corner positions of the faces in mm."""
    return mesh.vertices[mesh.faces]


def area_vectors(mesh: TriangleMesh) -> Floats:
    """Return the (m, 3) face normals with the face areas (mm²) as lengths."""
    # by coordinates, in a third of the time of np.cross
    x, y, z = _edge_vectors(mesh, 1)
    u, v, w = _edge_vectors(mesh, 2)
    normals = [
        y * w - z * v,
        z * u - x * w,
        x * v - y * u,
    ]
    return 0.5 * np.stack(normals, axis=1)


def _edge_vectors(mesh: TriangleMesh, corner: int) -> list[Floats]:
    """Return the x, y and z of the edges from the first corner of each face to
    another one."""
    start, end = mesh.faces[:, 0], mesh.faces[:, corner]
    return [values[end] - values[start] for values in mesh.vertices.T]


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
    return float(
        np.einsum(
            "ij,ij->",
            a,
            np.cross(b, c),
        )
        / 6.0
    )


def area_cm2(mesh: TriangleMesh) -> float:
    """Return the area of a mesh in mm, in cm²."""
    return area(mesh) * CM2_PER_MM2


def volume_ml(mesh: TriangleMesh) -> float:
    """Return the volume that a closed mesh in mm encloses, in mL; negative where its
    faces look inwards."""
    return signed_volume(mesh) * ML_PER_MM3


def coordinate_ranks(vertices: Floats) -> Ints:
    """Return the (n,) places of vertices in their order by x, y, z."""
    x, y, z = vertices.T
    order = np.lexsort((z, y, x))
    ranks = np.empty_like(order)
    ranks[order] = np.arange(len(vertices))
    return ranks


def dots(first: Floats, second: Floats) -> Floats:
    """Return the (n,) scalar products of the rows of two (n, 3) arrays."""
    return np.einsum("ij,ij->i", first, second)


def order_along_curve(points: Floats) -> Ints:
    """Return the order (n,) of points along a curve on which neighbours are near each
    other (Morton 1966): searches for them in turn find the same data in the processor's
    cache."""
    low = points.min(
        axis=0,
        initial=np.inf,
    )
    offsets = points - low
    size = float(offsets.max(initial=0.0))
    # a single place has no extent
    if size > 0:
        offsets /= size
    cells = np.array(
        offsets * (2**CURVE_BITS - 1),
        dtype=np.int64,
    )
    keys = np.zeros(len(points), dtype=np.int64)
    for bit in range(CURVE_BITS):
        bits = np.bitwise_and(cells >> bit, 1)
        x, y, z = bits.T
        digit = x + 2 * y + 4 * z
        keys += digit << (3 * bit)
    return np.argsort(keys, kind="stable")


def unit(vectors: Floats) -> Floats:
    """Return (n, 3) vectors scaled to length one; zero vectors stay zero."""
    lengths = np.linalg.norm(
        vectors,
        axis=-1,
        keepdims=True,
    )
    return vectors / np.where(lengths > 0, lengths, 1.0)


def face_normals(mesh: TriangleMesh) -> Floats:
    """Return the (m, 3) unit face normals."""
    return unit(area_vectors(mesh))


def _sums_at_vertices(mesh: TriangleMesh, face_values: Floats) -> Floats:
    """Return per vertex the sum of (m,) or (m, k) values over its faces."""
    vertex = mesh.faces.ravel()
    sums = [
        np.bincount(
            vertex,
            np.repeat(values, 3),
            minlength=len(mesh.vertices),
        )
        for values in np.atleast_2d(face_values.T)
    ]
    return np.stack(sums, axis=-1).reshape(-1, *face_values.shape[1:])


def vertex_normals(mesh: TriangleMesh) -> Floats:
    """Return the (n, 3) unit vertex normals: area-weighted means of the normals of
    adjacent faces."""
    return unit(_sums_at_vertices(mesh, area_vectors(mesh)))


def vertex_areas(mesh: TriangleMesh) -> Floats:
    """Return the (n,) areas of the vertices in mm²: a third of each adjacent face."""
    return _sums_at_vertices(mesh, face_areas(mesh)) / 3.0


def half_edges(mesh: TriangleMesh) -> Ints:
    """Return the (3 m, 2) starts and ends of the edges of each face, in turn."""
    return mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def edges(mesh: TriangleMesh) -> tuple[Ints, Ints]:
    """Return the (e, 2) undirected edges, each once and sorted, and the (e,) number of
    faces at each."""
    count = len(mesh.vertices)
    pairs = np.sort(half_edges(mesh), axis=1)
    # one number per edge: much faster than comparing rows
    numbers = pairs @ [count, 1]
    numbers, uses = np.unique(numbers, return_counts=True)
    ends = np.divmod(numbers, count)
    return np.stack(ends, axis=1), uses


def mean_edge_length(mesh: TriangleMesh) -> float:
    """Return the mean edge length in mm."""
    pairs, _ = edges(mesh)
    return float(edge_lengths(mesh.vertices, pairs).mean())


def edge_lengths(vertices: Floats, pairs: Indices) -> Floats:
    """Return the (e,) lengths of edges given as (e, 2) vertex indices, in the vertices'
    unit."""
    first, second = pairs.T
    return np.linalg.norm(
        vertices[second] - vertices[first],
        axis=1,
    )


def rms_length(vectors: Floats) -> float:
    """Return the root mean square length of (n, 3) vectors."""
    return float(np.sqrt(3 * np.mean(vectors**2)))


def is_closed(mesh: TriangleMesh) -> bool:
    """Return whether every edge has exactly two faces that run along it in opposite
    directions."""
    if not len(mesh.faces):
        return False
    start, end = half_edges(mesh).T
    count = len(mesh.vertices)
    is_forward, is_backward = start < end, start > end
    # one number per edge
    forward = np.sort((start * count + end)[is_forward])
    backward = np.sort((end * count + start)[is_backward])
    has_repeated = (np.diff(forward) == 0).any()
    is_degenerate = (start == end).any()
    return not (has_repeated or is_degenerate) and np.array_equal(forward, backward)


def euler_number(mesh: TriangleMesh) -> int:
    """Return vertices − edges + faces, counting used vertices only: 2 for each closed
    surface without handles."""
    pairs, _ = edges(mesh)
    is_used = np.bincount(mesh.faces.ravel()) > 0
    return int(is_used.sum()) - len(pairs) + len(mesh.faces)


def face_components(mesh: TriangleMesh) -> Ints:
    """Return the (m,) number of the connected component of each face, the largest area
    first (0)."""
    # two edges of a face connect it
    links = mesh.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    of_vertex = connected(links, len(mesh.vertices))
    component = of_vertex[mesh.faces[:, 0]]
    areas = np.bincount(component, weights=face_areas(mesh))
    # vertices without a face come last
    areas[np.bincount(component) == 0] = -1.0
    largest_first = np.argsort(-areas, kind="stable")
    rank = np.argsort(largest_first)
    return rank[component]


def split_sheets(mesh: TriangleMesh) -> TriangleMesh:
    """Split a surface into manifold sheets at edges of more than two faces, and at
    vertices where sheets meet.

    At such an edge two faces belong to one sheet if they use it in opposite directions
    and have the inside between them: those with the smallest sum of angles inside are
    paired. A manifold surface is returned unchanged.
    """
    faces = mesh.faces
    # half-edge 3 f + k starts at corner k of face f
    start = faces.ravel()
    end = np.roll(faces, -1, axis=1).ravel()
    numbers = np.arange(faces.size).reshape(-1, 3)
    following = np.roll(numbers, -1, axis=1).ravel()
    is_outward = signed_volume(mesh) >= 0
    is_forward = (start < end) == is_outward
    low = np.minimum(start, end)
    high = np.maximum(start, end)
    # one number per edge
    keys = low * len(mesh.vertices) + high
    order = np.argsort(keys, kind="stable")
    _, first, uses = np.unique(
        keys[order],
        return_index=True,
        return_counts=True,
    )
    of_two = first[uses == 2]
    pairs = [order[of_two[:, None] + [0, 1]]]
    overlapping = []
    is_crowded = uses > 2
    for place, number in zip(
        first[is_crowded],
        uses[is_crowded],
        strict=True,
    ):
        around = order[place : place + number]
        angles = _angles_around_edge(mesh, around)
        forward = is_forward[around]
        inside = angles[forward] - angles[~forward, None]
        inside = (inside - COINCIDENCE_TOL) % (2.0 * np.pi)
        sides = around[~forward], around[forward]
        paired, total = _cheapest_pairs(inside, *sides)
        if total <= 2.0 * np.pi:
            pairs.append(paired)
        else:
            overlapping.append(sides)
    # where faces overlap, faces of the same sheet elsewhere are paired
    joined = np.concatenate(pairs)
    sheet = connected(joined // 3, len(faces))
    for backward, forward in overlapping:
        sheet_behind = sheet[backward // 3]
        sheet_ahead = sheet[forward // 3]
        differs = sheet_behind[:, None] != sheet_ahead
        paired, _ = _cheapest_pairs(differs, backward, forward)
        pairs.append(paired)
    corner = _joined_corners(np.concatenate(pairs), start, following)
    _, first = np.unique(corner, return_index=True)
    if len(first) == len(np.unique(faces)):
        return mesh
    return TriangleMesh(
        mesh.vertices[start[first]],
        corner.reshape(-1, 3),
    )


def _angles_around_edge(mesh: TriangleMesh, half_edges: Ints) -> Floats:
    """Return the (n,) angles in radians of the faces of one edge's half-edges around
    it, from the first."""
    face, corner = np.divmod(half_edges, 3)
    start = mesh.faces[face, corner]
    end = mesh.faces[face, (corner + 1) % 3]
    apex = mesh.faces[face, (corner + 2) % 3]
    low = mesh.vertices[
        min(
            start[0],
            end[0],
        )
    ]
    high = mesh.vertices[
        max(
            start[0],
            end[0],
        )
    ]
    axis = high - low
    axis /= np.linalg.norm(axis)
    arms = mesh.vertices[apex] - low
    first = arms[0]
    radial = first - (first @ axis) * axis
    across = np.cross(axis, radial)
    return np.arctan2(arms @ across, arms @ radial)


def _cheapest_pairs(
    costs: NDArray,
    backward: Ints,
    forward: Ints,
) -> tuple[Ints, float]:
    """Return the (k, 2) pairs of half-edges of both directions with the smallest sum of
    (b, f) costs, and that sum."""
    rows, columns = scipy.optimize.linear_sum_assignment(costs)
    pairs = np.column_stack([backward[rows], forward[columns]])
    return pairs, float(costs[rows, columns].sum())


def _joined_corners(
    pairs: Ints,
    start: Ints,
    following: Ints,
) -> Ints:
    """Return the (3 m,) number of the vertex at each corner of the faces, which share
    vertices only along (k, 2) paired half-edges."""
    edge, partner = pairs.T
    is_opposite = start[edge] != start[partner]
    at_start = np.where(is_opposite, following[partner], partner)
    at_end = np.where(is_opposite, partner, following[partner])
    corners_of_edge = np.concatenate([edge, following[edge]])
    corners_of_partner = np.concatenate([at_start, at_end])
    links = np.column_stack([corners_of_edge, corners_of_partner])
    return connected(links, len(start))


def connected(pairs: Indices, count: int) -> Ints:
    """Return the (count,) number of the connected component of each of `count` nodes,
    from (k, 2) links."""
    ones = np.ones(len(pairs))
    graph = scipy.sparse.coo_matrix(
        (ones, pairs.T),
        shape=(count, count),
    )
    components = scipy.sparse.csgraph.connected_components
    _, component = components(graph, directed=False)
    return component


def smallest_patch(mesh: TriangleMesh, loop: Ints) -> Ints:
    """Return the (n - 2, 3) faces of the smallest area that close a hole with the (n,)
    vertices `loop`, in order.

    No edge of the surface is used inside the patch (Barequet and Sharir 1995, doi
    10.1016/0167-8396(94)00011-G).
    """
    count = len(loop)
    points = mesh.vertices[loop]
    is_edge = _edges_within(mesh, loop)
    # smallest area that the loop from vertex i to j and the edge j-i enclose, and the
    # third vertex of the face there
    cost = np.zeros((count, count))
    third = np.zeros((count, count), dtype=int)
    for gap in range(2, count):
        start = np.arange(count - gap)
        end = start + gap
        middle = start[:, None] + np.arange(1, gap)
        a = points[start][:, None]
        b = points[middle]
        c = points[end][:, None]
        areas = 0.5 * np.linalg.norm(
            np.cross(b - a, c - a),
            axis=-1,
        )
        before = cost[start[:, None], middle]
        after = cost[middle, end[:, None]]
        totals = before + after + areas
        third[start, end] = start + 1 + totals.argmin(axis=1)
        least = totals.min(axis=1)
        if gap < count - 1:
            least[is_edge[start, end]] = np.inf
        cost[start, end] = least
    faces = []
    spans = [(0, count - 1)]
    while spans:
        first, last = spans.pop()
        if last - first > 1:
            between = third[first, last]
            faces.append((first, between, last))
            spans.append((first, between))
            spans.append((between, last))
    return loop[np.array(faces)]


def _edges_within(mesh: TriangleMesh, loop: Ints) -> Mask:
    """Return the (n, n) mask of the pairs of places in a loop whose vertices have an
    edge, for the first before the second."""
    count = len(loop)
    place = np.full(len(mesh.vertices), -1)
    place[loop] = np.arange(count)
    pairs, _ = edges(mesh)
    ends = np.sort(place[pairs], axis=1)
    first, second = ends.T
    is_within = first >= 0
    is_edge = np.zeros((count, count), dtype=bool)
    is_edge[first[is_within], second[is_within]] = True
    return is_edge


def convex_hull(mesh: TriangleMesh) -> TriangleMesh:
    """Return the convex hull, its faces outward; MeshError for a flat surface."""
    try:
        found = scipy.spatial.ConvexHull(mesh.vertices)
    except scipy.spatial.QhullError as error:
        raise MeshError(
            "the surface has no convex hull", remedy="It must enclose a volume"
        ) from error
    faces = found.simplices.astype(np.int64)
    normals = area_vectors(TriangleMesh(mesh.vertices, faces))
    outward = found.equations[:, :3]
    is_inward = dots(normals, outward) < 0
    faces[is_inward] = faces[is_inward][:, ::-1]
    hull, _ = used_part(TriangleMesh(mesh.vertices, faces))
    return hull


def used_part(mesh: TriangleMesh) -> tuple[TriangleMesh, Ints]:
    """Return the surface without vertices that have no face, and the indices of the
    others in `mesh`."""
    used, faces = np.unique(mesh.faces, return_inverse=True)
    return TriangleMesh(
        mesh.vertices[used],
        faces.reshape(-1, 3),
    ), used


def submesh(mesh: TriangleMesh, keep: Mask) -> tuple[TriangleMesh, Ints]:
    """Return the surface of the faces where the (m,) mask `keep` holds, and its
    vertices' indices in `mesh`."""
    return used_part(TriangleMesh(mesh.vertices, mesh.faces[keep]))


def merged(*meshes: TriangleMesh) -> TriangleMesh:
    """Return the surfaces side by side in one, without joining vertices."""
    vertices = []
    faces = []
    count = 0
    for mesh in meshes:
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + count)
        count += len(mesh.vertices)
    return TriangleMesh(np.concatenate(vertices), np.concatenate(faces))


def flipped(mesh: TriangleMesh) -> TriangleMesh:
    """Return the surface with every face flipped."""
    return TriangleMesh(
        mesh.vertices,
        mesh.faces[:, ::-1],
    )


def outward(mesh: TriangleMesh) -> TriangleMesh:
    """Return a surface with its triangles oriented outward."""
    return flipped(mesh) if signed_volume(mesh) < 0 else mesh


def transformed(mesh: TriangleMesh, matrix: ArrayLike) -> TriangleMesh:
    """Apply a (4, 4) affine matrix to a surface; faces are flipped if it mirrors."""
    affine = np.asarray(matrix, dtype=float)
    linear = affine[:3, :3]
    vertices = mesh.vertices @ linear.T + affine[:3, 3]
    moved = TriangleMesh(vertices, mesh.faces)
    is_mirrored = np.linalg.det(linear) < 0
    return flipped(moved) if is_mirrored else moved
