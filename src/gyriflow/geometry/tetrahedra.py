"""Tetrahedral meshes: a frozen pair of arrays, and what can be measured on it."""

from dataclasses import dataclass

import numpy as np

from .triangles import Floats, Ints, TriangleMesh, frozen


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


def signed_volumes(mesh: TetrahedralMesh) -> Floats:
    """Returns the (m,) volumes in mm³, negative for inverted elements."""
    a, b, c, d = mesh.vertices[mesh.tets].transpose(1, 0, 2)
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0


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
