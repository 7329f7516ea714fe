"""Tetrahedral meshes: a frozen pair of arrays, and what can be measured on it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from .triangles import Floats, Ints, TriangleMesh, frozen

# the six tetrahedra of a cube around its diagonal (Kuhn), corners numbered 4x + 2y + z
KUHN = ((0, 4, 6, 7), (0, 6, 2, 7), (0, 2, 3, 7), (0, 3, 1, 7), (0, 1, 5, 7), (0, 5, 4, 7))


@dataclass(frozen=True, eq=False)
class TetrahedralMesh:
    """A tetrahedral mesh.

    Attributes
    ----------
    vertices : (n, 3) float
        Positions in mm.
    tets : (m, 4) int
        Vertex indices; volumes are positive in the order of VTK.
    """

    vertices: Floats
    tets: Ints

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen(self.vertices, np.float64, 3))
        object.__setattr__(self, "tets", frozen(self.tets, np.int64, 4))
        if len(self.tets) and not 0 <= self.tets.min() <= self.tets.max() < len(self.vertices):
            raise ValueError("a tetrahedron names a vertex that does not exist")


def volumes_between(vertices: Floats, tets: NDArray[np.integer]) -> Floats:
    """Returns the (m,) volumes of (m, 4) tetrahedra, negative for inverted ones, in the cube of the vertices' unit."""
    a, b, c, d = (np.take(vertices, tets[:, i], axis=0) for i in range(4))
    # the triple product of edges written out: faster than with NumPy's cross product
    (b0, b1, b2), (c0, c1, c2), (d0, d1, d2) = ((end - a).T for end in (b, c, d))
    return np.asarray(((b1 * c2 - b2 * c1) * d0 + (b2 * c0 - b0 * c2) * d1 + (b0 * c1 - b1 * c0) * d2) / 6.0)


def signed_volumes(mesh: TetrahedralMesh) -> Floats:
    """Returns the (m,) volumes in mm³, negative for inverted elements."""
    return volumes_between(mesh.vertices, mesh.tets)


def radius_ratios(mesh: TetrahedralMesh) -> Floats:
    """Returns the (m,) ratios 3 × inscribed / circumscribed radius: 1 for the regular element, 0 for a flat one."""
    a, b, c, d = mesh.vertices[mesh.tets].transpose(1, 0, 2)
    p, q, r = b - a, c - a, d - a
    volume6 = np.abs(np.einsum("ij,ij->i", np.cross(p, q), r))
    surface2 = sum(np.linalg.norm(np.cross(x, y), axis=1) for x, y in ((p, q), (q, r), (r, p), (q - p, r - p)))
    # circumradius = |p|²(q×r) + |q|²(r×p) + |r|²(p×q)| / (2·6V), inradius = 6V / (sum of twice the face areas)
    squared = [np.einsum("ij,ij->i", x, x)[:, None] for x in (p, q, r)]
    numerator = np.linalg.norm(
        squared[0] * np.cross(q, r) + squared[1] * np.cross(r, p) + squared[2] * np.cross(p, q), axis=1
    )
    return 6 * volume6**2 / np.maximum(surface2 * numerator, np.finfo(float).tiny)


def connected_parts(mesh: TetrahedralMesh) -> Ints:
    """Returns for each of the (n,) vertices the number of the connected part of the mesh that it belongs to."""
    pairs = mesh.tets[:, [0, 1, 1, 2, 2, 3]].reshape(-1, 2)
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(mesh.vertices),) * 2)
    return connected_components(graph, directed=False)[1].astype(np.int64)


def grid(ticks: Sequence[Floats]) -> TetrahedralMesh:
    """Returns a box of six tetrahedra per cell on the grid of three ascending arrays of coordinates in mm."""
    points = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1)
    x, y, z = points.shape[:3]
    number = np.arange(x * y * z).reshape(x, y, z)
    corner = [
        number[i : x - 1 + i, j : y - 1 + j, k : z - 1 + k].ravel() for i in (0, 1) for j in (0, 1) for k in (0, 1)
    ]
    tets = np.concatenate([np.stack([corner[c] for c in tet], axis=1) for tet in KUHN])
    return TetrahedralMesh(points.reshape(-1, 3), tets)


def boundary_faces(mesh: TetrahedralMesh) -> tuple[Ints, Ints]:
    """Returns the (f, 3) faces that belong to one element only, outward, and the (f,) element of each.

    Outward holds for elements of positive volume.
    """
    # the face opposite to each corner, seen counter-clockwise from outside
    opposite = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
    faces = mesh.tets[:, opposite].reshape(-1, 3)
    # one number per face: much faster than comparing rows
    count = len(mesh.vertices)
    _, first, counts = np.unique(
        np.sort(faces, axis=1) @ [count * count, count, 1], return_index=True, return_counts=True
    )
    outer = np.sort(first[counts == 1])
    return faces[outer], outer // 4


def boundary_surface(mesh: TetrahedralMesh) -> tuple[TriangleMesh, Ints]:
    """Returns the outward surface of the mesh and its vertices' indices in the mesh."""
    faces, _ = boundary_faces(mesh)
    used, local = np.unique(faces, return_inverse=True)
    return TriangleMesh(mesh.vertices[used], local.reshape(-1, 3)), used
