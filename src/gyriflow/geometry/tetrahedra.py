"""Tetrahedral meshes: a frozen pair of arrays, and measures of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy import sparse

from .jacobians import (
    CORNER_PARTS,
    EDGES,
    SLOPES,
    chunks,
    coefficients,
    determinants,
    element_maps,
    lower_bounds,
    shape_values,
)
from .triangles import (
    Floats,
    Indices,
    Ints,
    Mask,
    TriangleMesh,
    connected,
    dots,
    freeze,
    used_part,
)

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
# the face opposite to each corner, outward
FACES = ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))
_MIDDLES = {frozenset(edge): node for node, edge in enumerate(EDGES, start=4)}


def _quarters(face: tuple[int, int, int]) -> list[tuple[int, int, int]]:
    """Return the triangles between the six nodes of a face: at its corners, between."""
    a, b, c = face
    ab = _MIDDLES[frozenset((a, b))]
    bc = _MIDDLES[frozenset((b, c))]
    ca = _MIDDLES[frozenset((c, a))]
    return [
        (a, ab, ca),
        (ab, b, bc),
        (ca, bc, c),
        (ab, bc, ca),
    ]


TRIANGLES_OF_ORDER = {
    1: np.array([[face] for face in FACES]),
    2: np.array([_quarters(face) for face in FACES]),
}
"""Corners (4, 1, 3) or nodes (4, 4, 3) of the triangles of the faces."""
# the linear elements between the nodes of a quadratic one: at its corners, and around
# the diagonal from node 6 to 8
PIECES = (
    *CORNER_PARTS,
    (6, 8, 4, 5),
    (6, 8, 5, 9),
    (6, 8, 9, 7),
    (6, 8, 7, 4),
)
PIECES_OF_ORDER = {1: 1, 2: 4}
"""Number of triangles of a face; with nodes on its edges, one at each corner and one in
the middle."""

FINER = 4
"""Number of pieces of each edge of a face: two between neighbouring nodes."""
PLACES = [
    (i, j, k) for i, j, k in product(range(FINER + 1), repeat=3) if i + j + k == FINER
]
LATTICE = np.array(PLACES)
"""Vertices of the triangles within a face: barycentric coordinates times `FINER`."""


def _lattice_triangles() -> Ints:
    """Return the (16, 3) triangles of the lattice, all with the same orientation."""
    number = {place: vertex for vertex, place in enumerate(PLACES)}
    triangles = []
    for place in PLACES:
        i, j, k = place
        along = (i + 1, j, k - 1)
        across = (i, j + 1, k - 1)
        back = (i - 1, j + 1, k)
        for triangle in ([place, along, across], [place, across, back]):
            vertices = [number.get(corner) for corner in triangle]
            # not beyond the face
            if None not in vertices:
                triangles.append(vertices)
    return np.array(triangles)


LATTICE_TRIANGLES = _lattice_triangles()


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
        freeze(self, "vertices", np.float64, 3)
        is_quadratic = np.shape(self.tets)[1:] == (NODES_OF_ORDER[2],)
        order = 2 if is_quadratic else 1
        freeze(
            self,
            "tets",
            np.int64,
            NODES_OF_ORDER[order],
            len(self.vertices),
        )

    @property
    def order(self) -> int:
        """1 for linear, 2 for quadratic elements."""
        return 1 if self.tets.shape[1] == NODES_OF_ORDER[1] else 2

    @property
    def corners(self) -> Ints:
        """The (m, 4) corners of the elements."""
        return self.tets[:, : NODES_OF_ORDER[1]]


def volumes_between(vertices: Floats, tets: Indices) -> Floats:
    """Return the (m,) volumes of (m, 4) or (m, 10) tetrahedra, negative if inverted, in
    cubes of the vertices' unit."""
    if tets.shape[1] == NODES_OF_ORDER[2]:
        # the mean of the Bernstein coefficients of the Jacobian determinant is its mean
        return coefficients(vertices, tets).mean(axis=1) / 6
    volumes = np.empty(len(tets))
    for chunk in chunks(len(tets)):
        (edges,) = element_maps(
            vertices,
            tets[chunk],
            SLOPES[None],
        )
        volumes[chunk] = determinants(np.moveaxis(edges, 2, 0)) / 6.0
    return volumes


def has_volume(positions: Floats, tets: Indices) -> Mask:
    """Return whether each (m, 4) or (m, 10) element is valid everywhere, for (n, 3)
    positions of its nodes."""
    is_linear = tets.shape[1] == NODES_OF_ORDER[1]
    bounds = volumes_between if is_linear else lower_bounds
    return bounds(positions, tets) > 0


def signed_volumes(mesh: TetrahedralMesh) -> Floats:
    """Return the (m,) volumes in mm³, negative for inverted elements."""
    return volumes_between(mesh.vertices, mesh.tets)


def radius_ratios(mesh: TetrahedralMesh) -> Floats:
    """Return the (m,) ratios 3 × inscribed / circumscribed radius of the corners: 1
    regular, 0 flat."""
    ratios = np.empty(len(mesh.tets))
    tiny = np.finfo(float).tiny
    for chunk in chunks(len(ratios)):
        a, b, c, d = mesh.vertices[mesh.corners[chunk].T]
        p = b - a
        q = c - a
        r = d - a
        pq = np.cross(p, q)
        qr = np.cross(q, r)
        rp = np.cross(r, p)
        opposite = np.cross(q - p, r - p)
        # circumradius = |p|²(q×r) + |q|²(r×p) + |r|²(p×q)| / (2·6V), inradius = 6V /
        # (sum of twice the face areas)
        volume6 = np.abs(dots(pq, r))
        surface2 = np.zeros(len(a))
        for normal in (pq, qr, rp, opposite):
            surface2 += np.linalg.norm(normal, axis=1)
        centre = np.zeros_like(p)
        for edge, normal in (
            (p, qr),
            (q, rp),
            (r, pq),
        ):
            squared_length = dots(edge, edge)
            centre += squared_length[:, None] * normal
        product = surface2 * np.linalg.norm(centre, axis=1)
        ratios[chunk] = 6 * volume6**2 / np.maximum(product, tiny)
    return ratios


def connected_parts(mesh: TetrahedralMesh) -> Ints:
    """Return the (n,) number of the connected part of the mesh that each vertex belongs
    to."""
    first = mesh.tets[:, 0]
    links = []
    for other in mesh.tets.T[1:]:
        links.append(np.column_stack([first, other]))
    parts = connected(np.concatenate(links), len(mesh.vertices))
    return parts.astype(np.int64)


def grid(ticks: Sequence[Floats]) -> TetrahedralMesh:
    """Return a box of six tetrahedra per cell on the grid of three ascending arrays of
    coordinates in mm."""
    axes = np.meshgrid(*ticks, indexing="ij")
    points = np.stack(axes, axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(axes[0].shape)
    low = slice(None, -1)
    high = slice(1, None)
    corners = []
    for side in product((low, high), repeat=3):
        corners.append(number[side].ravel())
    tets = []
    for tet in KUHN:
        nodes = [corners[corner] for corner in tet]
        tets.append(np.stack(nodes, axis=1))
    return TetrahedralMesh(points, np.concatenate(tets))


def quadratic(mesh: TetrahedralMesh) -> TetrahedralMesh:
    """Add nodes at the midpoints of a linear mesh's edges; corners keep their
    numbers."""
    count = len(mesh.vertices)
    pairs = np.sort(
        mesh.tets[:, EDGES],
        axis=2,
    )
    # one number per edge: much faster than comparing rows
    edges, place = np.unique(
        pairs @ [count, 1],
        return_inverse=True,
    )
    first, second = np.divmod(edges, count)
    ends = np.stack([first, second], axis=1)
    middles = mesh.vertices[ends].mean(axis=1)
    nodes = count + place.reshape(-1, len(EDGES))
    return TetrahedralMesh(
        np.concatenate([mesh.vertices, middles]),
        np.hstack([mesh.tets, nodes]),
    )


def linear_pieces(mesh: TetrahedralMesh) -> Ints:
    """Return the (p, 4) linear tetrahedra between the nodes: the elements, or eight for
    each quadratic one."""
    if mesh.order == 1:
        return mesh.tets
    return mesh.tets[:, PIECES].reshape(-1, 4)


def boundary_faces(mesh: TetrahedralMesh) -> tuple[Ints, Ints]:
    """Return the (f, 3) triangles of the faces that belong to one element only,
    outward, and the (f,) element of each.

    Elements must have positive volume. The four triangles of a quadratic element's face
    are consecutive: with corners a, b, c, these are (a, ab, ca), (ab, b, bc), (ca, bc,
    c) and (ab, bc, ca).
    """
    faces = mesh.tets[:, FACES].reshape(-1, 3)
    faces = np.sort(faces)
    # one number per face: much faster than comparing rows
    count = len(mesh.vertices)
    numbers = faces @ [count * count, count, 1]
    _, first, uses = np.unique(
        numbers,
        return_index=True,
        return_counts=True,
    )
    outer = np.sort(first[uses == 1])
    element, face = np.divmod(outer, len(FACES))
    nodes = TRIANGLES_OF_ORDER[mesh.order][face]
    triangles = mesh.tets[element[:, None, None], nodes]
    element = np.repeat(element, nodes.shape[1])
    return triangles.reshape(-1, 3), element


def whole_faces(triangles: Indices, order: int) -> Indices:
    """Return the (f, 3) corners of the faces whose triangles are those of
    `boundary_faces`."""
    if order == 1:
        return triangles
    by_face = triangles.reshape(-1, PIECES_OF_ORDER[2], 3)
    corner = [0, 1, 2]
    return by_face[:, corner, corner]


def on_whole_faces(selected: Mask, order: int) -> Mask:
    """Return the (f,) mask of the triangles of `boundary_faces` whose whole face is
    selected."""
    pieces = PIECES_OF_ORDER[order]
    return np.repeat(
        selected.reshape(-1, pieces).all(axis=1),
        pieces,
    )


def boundary_surface(mesh: TetrahedralMesh) -> tuple[TriangleMesh, Ints]:
    """Return the outward surface of the mesh and the indices of its vertices in the
    mesh."""
    faces, _ = boundary_faces(mesh)
    return used_part(TriangleMesh(mesh.vertices, faces))


def finer_surface(triangles: Ints) -> tuple[sparse.csr_array, Ints]:
    """Return a refined surface of curved faces: weights (t, n) of the nodes at its
    vertices, and its (16 f, 3) faces.

    Its first n vertices are the nodes. `triangles` (4 f, 3) are those of
    `boundary_faces`.
    """
    corners = whole_faces(triangles, order=2)
    # the triangle between has the nodes on the edges
    nodes = np.hstack([corners, triangles[3::4]])
    nodes = np.repeat(nodes, len(LATTICE), axis=0)
    # shape functions on a tetrahedron's face with the nodes 0, 1, 2 and 4, 5, 6
    places = np.pad(
        LATTICE / FINER,
        ((0, 0), (0, 1)),
    )
    on_lattice = shape_values(places)
    on_lattice = on_lattice[:, [0, 1, 2, 4, 5, 6]]
    weights = np.tile(on_lattice, (len(corners), 1))
    nodes[weights == 0] = -1
    is_new = ~(weights == 1).any(axis=1)
    new_nodes = nodes[is_new]
    new_weights = weights[is_new]
    first, place = _distinct_points(new_nodes, new_weights)
    n_nodes = int(triangles.max()) + 1
    # at a node there is no other
    number = nodes.max(axis=1)
    number[is_new] = n_nodes + place
    columns = np.maximum(new_nodes[first], 0)
    n_new, n_around = columns.shape
    rows = np.repeat(np.arange(n_new), n_around)
    values = new_weights[first].ravel()
    new = sparse.coo_array(
        (values, (rows, columns.ravel())),
        shape=(n_new, n_nodes),
    )
    matrix = sparse.vstack([sparse.eye_array(n_nodes), new])
    by_face = number.reshape(-1, len(LATTICE))
    faces = by_face[:, LATTICE_TRIANGLES].reshape(-1, 3)
    return sparse.csr_array(matrix), faces


def _distinct_points(nodes: Ints, weights: Floats) -> tuple[Ints, Ints]:
    """Number points with the same (p, 6) nodes and weights, in any order; return where
    each point is first, and the (p,) numbers."""
    order = np.argsort(nodes, axis=1, kind="stable")
    sorted_nodes = np.take_along_axis(nodes, order, axis=1)
    sorted_weights = np.take_along_axis(weights, order, axis=1)
    _, first, number = np.unique(
        np.hstack([sorted_nodes, sorted_weights]),
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    return first, number.ravel()
