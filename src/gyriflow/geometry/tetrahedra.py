"""Tetrahedral meshes: a frozen pair of arrays, and measures of it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .jacobians import (
    CORNER_PARTS,
    EDGES,
    chunks,
    coefficients,
    determinants,
    lower_bounds,
    shape_values,
)
from .triangles import Floats, Ints, TriangleMesh, connected, frozen

# the six tetrahedra of a cube around its diagonal (Kuhn), corners numbered 4x + 2y + z
KUHN = (
    (0, 4, 6, 7),
    (0, 6, 2, 7),
    (0, 2, 3, 7),
    (0, 3, 1, 7),
    (0, 1, 5, 7),
    (0, 5, 4, 7),
)
NODES_OF_ORDER = {1: 4, 2: 10}
MIN_RADIUS_RATIO = 0.02
"""Least accepted quality of an element (`radius_ratios`)."""
# the face opposite to each corner, outward; and its four triangles if its edges have
# nodes: at its corners, between
FACES = ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))
FINE_FACES = (
    ((1, 5, 8), (5, 2, 9), (8, 9, 3), (5, 9, 8)),
    ((0, 7, 6), (7, 3, 9), (6, 9, 2), (7, 9, 6)),
    ((0, 4, 7), (4, 1, 8), (7, 8, 3), (4, 8, 7)),
    ((0, 6, 4), (6, 2, 5), (4, 5, 1), (6, 5, 4)),
)
# the linear elements between the nodes of a quadratic one: at its corners, and around
# the diagonal from node 6 to 8
PIECES = (*CORNER_PARTS, (6, 8, 4, 5), (6, 8, 5, 9), (6, 8, 9, 7), (6, 8, 7, 4))
PIECES_OF_ORDER = {1: 1, 2: 4}
"""Number of triangles of a face; with nodes on its edges, one at each corner and one in
the middle."""

FINER = 4
"""Number of pieces of each edge of a face: two between neighbouring nodes."""
LATTICE = np.array(
    [(i, j, FINER - i - j) for i in range(FINER + 1) for j in range(FINER + 1 - i)]
)
"""Vertices of the triangles within a face: barycentric coordinates times `FINER`."""
PLACE = {(i, j, k): place for place, (i, j, k) in enumerate(LATTICE.tolist())}
LATTICE_TRIANGLES = np.array(
    [
        (PLACE[i, j, k], PLACE[second], PLACE[third])
        for i, j, k in PLACE
        for second, third in (
            ((i + 1, j, k - 1), (i, j + 1, k - 1)),
            ((i, j + 1, k - 1), (i - 1, j + 1, k)),
        )
        if second in PLACE and third in PLACE
    ]
)
"""The (16, 3) triangles of the lattice, all with the same orientation."""


@dataclass(frozen=True, eq=False)
class TetrahedralMesh:
    """A tetrahedral mesh: (n, 3) nodes in mm, and (m, 4) linear or (m, 10) quadratic
    elements of positive volume.

    Nodes are in the order of VTK: four corners, and those on the edges 01, 12, 02, 03,
    13, 23.
    """

    vertices: Floats
    tets: Ints

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen(self.vertices, np.float64, 3))
        wide = np.ndim(self.tets) == 2 and np.shape(self.tets)[1] == NODES_OF_ORDER[2]
        object.__setattr__(
            self, "tets", frozen(self.tets, np.int64, NODES_OF_ORDER[2 if wide else 1])
        )
        if len(self.tets) and not 0 <= self.tets.min() <= self.tets.max() < len(
            self.vertices
        ):
            raise ValueError("a tetrahedron has a vertex index out of range")

    @property
    def order(self) -> int:
        """1 for linear, 2 for quadratic elements."""
        return 1 if self.tets.shape[1] == NODES_OF_ORDER[1] else 2

    @property
    def corners(self) -> Ints:
        """The (m, 4) corners of the elements."""
        return self.tets[:, : NODES_OF_ORDER[1]]


def volumes_between(vertices: Floats, tets: NDArray[np.integer]) -> Floats:
    """Return the (m,) volumes of (m, 4) or (m, 10) tetrahedra, negative if inverted, in
    cubes of the vertices' unit."""
    if tets.shape[1] == NODES_OF_ORDER[2]:
        return np.asarray(coefficients(vertices, tets).mean(axis=1) / 6)
    volumes = np.empty(len(tets))
    for part in chunks(len(tets)):
        places = np.take(vertices, tets[part], axis=0)
        volumes[part] = determinants(places[:, 1:] - places[:, :1]) / 6.0
    return volumes


def has_volume(positions: Floats, tets: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Return whether each (m, 4) or (m, 10) element is valid everywhere, for (n, 3)
    positions of its nodes."""
    is_linear = tets.shape[1] == NODES_OF_ORDER[1]
    return (
        volumes_between(positions, tets) if is_linear else lower_bounds(positions, tets)
    ) > 0


def signed_volumes(mesh: TetrahedralMesh) -> Floats:
    """Return the (m,) volumes in mm³, negative for inverted elements."""
    return volumes_between(mesh.vertices, mesh.tets)


def radius_ratios(mesh: TetrahedralMesh) -> Floats:
    """Return the (m,) ratios 3 × inscribed / circumscribed radius of the corners: 1
    regular, 0 flat."""
    ratios = np.empty(len(mesh.tets))
    for part in chunks(len(ratios)):
        a, b, c, d = mesh.vertices[mesh.corners[part].T]
        p, q, r = b - a, c - a, d - a
        volume6 = np.abs(np.einsum("ij,ij->i", np.cross(p, q), r))
        surface2 = sum(
            np.linalg.norm(np.cross(x, y), axis=1)
            for x, y in ((p, q), (q, r), (r, p), (q - p, r - p))
        )
        # circumradius = |p|²(q×r) + |q|²(r×p) + |r|²(p×q)| / (2·6V), inradius = 6V /
        # (sum of twice the face areas)
        squared = [np.einsum("ij,ij->i", x, x)[:, None] for x in (p, q, r)]
        numerator = np.linalg.norm(
            squared[0] * np.cross(q, r)
            + squared[1] * np.cross(r, p)
            + squared[2] * np.cross(p, q),
            axis=1,
        )
        ratios[part] = (
            6 * volume6**2 / np.maximum(surface2 * numerator, np.finfo(float).tiny)
        )
    return ratios


def connected_parts(mesh: TetrahedralMesh) -> Ints:
    """Return the (n,) number of the connected part of the mesh that each vertex belongs
    to."""
    pairs = np.stack(
        np.broadcast_arrays(mesh.tets[:, :1], mesh.tets[:, 1:]), axis=-1
    ).reshape(-1, 2)
    return connected(pairs, len(mesh.vertices)).astype(np.int64)


def grid(ticks: Sequence[Floats]) -> TetrahedralMesh:
    """Return a box of six tetrahedra per cell on the grid of three ascending arrays of
    coordinates in mm."""
    points = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1)
    x, y, z = points.shape[:3]
    number = np.arange(x * y * z).reshape(x, y, z)
    corner = [
        number[i : x - 1 + i, j : y - 1 + j, k : z - 1 + k].ravel()
        for i in (0, 1)
        for j in (0, 1)
        for k in (0, 1)
    ]
    tets = np.concatenate([np.stack([corner[c] for c in tet], axis=1) for tet in KUHN])
    return TetrahedralMesh(points.reshape(-1, 3), tets)


def quadratic(mesh: TetrahedralMesh) -> TetrahedralMesh:
    """Add nodes at the midpoints of a linear mesh's edges; corners keep their
    numbers."""
    pairs = np.sort(mesh.tets[:, EDGES], axis=2).reshape(-1, 2)
    names, place = np.unique(pairs @ [len(mesh.vertices), 1], return_inverse=True)
    ends = np.stack(np.divmod(names, len(mesh.vertices)), axis=1)
    tets = np.hstack([mesh.tets, len(mesh.vertices) + place.reshape(-1, len(EDGES))])
    return TetrahedralMesh(
        np.concatenate([mesh.vertices, mesh.vertices[ends].mean(axis=1)]), tets
    )


def linear_pieces(mesh: TetrahedralMesh) -> Ints:
    """Return the (p, 4) linear tetrahedra between the nodes: the elements, or eight for
    each quadratic one."""
    return (
        mesh.tets
        if mesh.order == 1
        else np.asarray(mesh.tets[:, PIECES]).reshape(-1, 4)
    )


def boundary_faces(mesh: TetrahedralMesh) -> tuple[Ints, Ints]:
    """Return the (f, 3) triangles of the faces that belong to one element only,
    outward, and the (f,) element of each.

    Elements must have positive volume. The four triangles of a quadratic element's face
    are consecutive: with corners a, b, c, these are (a, ab, ca), (ab, b, bc), (ca, bc,
    c) and (ab, bc, ca).
    """
    faces = np.sort(mesh.tets[:, FACES].reshape(-1, 3))
    # one number per face: much faster than comparing rows
    count = len(mesh.vertices)
    _, first, counts = np.unique(
        faces @ [count * count, count, 1], return_index=True, return_counts=True
    )
    outer = np.sort(first[counts == 1])
    pieces = PIECES_OF_ORDER[mesh.order]
    triangles = mesh.tets[:, FACES if mesh.order == 1 else FINE_FACES]
    triangles = triangles.reshape(-1, pieces, 3)[outer]
    return triangles.reshape(-1, 3), np.repeat(outer // 4, pieces)


def whole_faces(triangles: NDArray[np.integer], order: int) -> NDArray[np.integer]:
    """Return the (f, 3) corners of the faces whose triangles are those of
    `boundary_faces`."""
    if order == 1:
        return triangles
    return triangles.reshape(-1, PIECES_OF_ORDER[2], 3)[:, [0, 1, 2], [0, 1, 2]]


def on_whole_faces(selected: NDArray[np.bool_], order: int) -> NDArray[np.bool_]:
    """Return the (f,) mask of the triangles of `boundary_faces` whose whole face is
    selected."""
    pieces = PIECES_OF_ORDER[order]
    return np.repeat(selected.reshape(-1, pieces).all(axis=1), pieces)


def boundary_surface(mesh: TetrahedralMesh) -> tuple[TriangleMesh, Ints]:
    """Return the outward surface of the mesh and the indices of its vertices in the
    mesh."""
    faces, _ = boundary_faces(mesh)
    used, local = np.unique(faces, return_inverse=True)
    return TriangleMesh(mesh.vertices[used], local.reshape(-1, 3)), used


def finer_surface(triangles: Ints) -> tuple[sparse.csr_array, Ints]:
    """Return a refined surface of curved faces: weights (t, n) of the nodes at its
    vertices, and its (16 f, 3) faces.

    Its first n vertices are the nodes. `triangles` (4 f, 3) are those of
    `boundary_faces`.
    """
    split = triangles.reshape(-1, 4, 3)
    nodes = np.concatenate([split[:, [0, 1, 2], [0, 1, 2]], split[:, 3]], axis=1)
    # shape functions on a tetrahedron's face with the nodes 0, 1, 2 and 4, 5, 6
    on_lattice = shape_values(np.pad(LATTICE / FINER, ((0, 0), (0, 1))))
    on_lattice = on_lattice[:, [0, 1, 2, 4, 5, 6]]
    weights = np.broadcast_to(on_lattice, (len(nodes), len(LATTICE), 6)).reshape(-1, 6)
    names = np.repeat(nodes, len(LATTICE), axis=0)
    # faces share a vertex if it has the same nodes with the same weights
    parts = np.rint(weights * 2 * FINER).astype(np.int64)
    names = np.where(parts == 0, -1, names)
    order = np.argsort(names, axis=1, kind="stable")
    keys = np.concatenate(
        [np.take_along_axis(names, order, 1), np.take_along_axis(parts, order, 1)],
        axis=1,
    )
    at_node = (parts == 2 * FINER).sum(axis=1) * ((parts != 0).sum(axis=1) == 1) > 0
    count = int(triangles.max()) + 1
    number = np.empty(len(keys), dtype=np.int64)
    number[at_node] = names[at_node].max(axis=1)
    _, first, place = np.unique(
        keys[~at_node], axis=0, return_index=True, return_inverse=True
    )
    number[~at_node] = count + place.ravel()
    between = np.flatnonzero(~at_node)[first]
    rows = np.repeat(np.arange(count, count + len(between)), 6)
    columns = np.maximum(names[between], 0).ravel()
    new = sparse.coo_array(
        (weights[between].ravel(), (rows - count, columns)), shape=(len(between), count)
    )
    matrix = sparse.csr_array(sparse.vstack([sparse.eye_array(count), new]))
    faces = number.reshape(-1, len(LATTICE))[:, LATTICE_TRIANGLES].reshape(-1, 3)
    return matrix, faces
