"""Hulls and envelopes of pial surfaces: gyrification indices and sulcal depth."""

import igl
import numpy as np
import pymeshlab
import trimesh
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from ..errors import MeshError
from ..geometry.triangles import Floats, TriangleMesh, area, corners, face_areas, vertex_normals

ENVELOPE_RADIUS_MM = 5.0
"""The envelope bridges sulci narrower than twice this radius."""

ENVELOPE_OFFSET_MM = 0.1
"""Distance at which the envelope is first wrapped round the surface."""

CAP_RESOLUTION_MM = 2.0
"""Size of the pieces that are told apart as lying over the cut or over the pial surface."""


def capped(mesh: TriangleMesh) -> TriangleMesh:
    """Returns the surface with every boundary closed, the faces that close it after its own.

    Each boundary gets a fan of faces from its centroid. A cut in a plane is closed by that part of the plane. A closed
    surface is returned as it is. MeshError where a boundary is not a closed line.
    """
    directed = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = len(mesh.vertices)
    alone = ~np.isin(directed[:, 0] * size + directed[:, 1], directed[:, 1] * size + directed[:, 0])
    rim = directed[alone]
    if not len(rim):
        return mesh
    if not np.array_equal(np.bincount(rim[:, 0], minlength=size), np.bincount(rim[:, 1], minlength=size)):
        raise MeshError("the boundary of the surface is not made of closed lines", remedy="Repair the surface")
    vertices, local = np.unique(rim, return_inverse=True)
    local = local.reshape(-1, 2)
    links = sparse.coo_matrix((np.ones(len(rim)), (local[:, 0], local[:, 1])), shape=(len(vertices),) * 2)
    number, label = connected_components(links, directed=False)
    centres = np.stack([mesh.vertices[vertices[label == k]].mean(axis=0) for k in range(number)])
    fan = np.column_stack([rim[:, ::-1], size + label[local[:, 0]]])
    return TriangleMesh(np.concatenate([mesh.vertices, centres]), np.concatenate([mesh.faces, fan]))


def convex_hull(mesh: TriangleMesh) -> TriangleMesh:
    """Returns the convex hull, its faces outward; MeshError for a flat surface."""
    try:
        hull = ConvexHull(mesh.vertices)
    except QhullError as error:
        raise MeshError("the surface has no convex hull", remedy="It has to enclose a volume") from error
    faces = np.asarray(hull.simplices, dtype=np.int64)
    a, b, c = mesh.vertices[faces].transpose(1, 0, 2)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    used, local = np.unique(faces, return_inverse=True)
    return TriangleMesh(mesh.vertices[used], local.reshape(-1, 3))


def envelope(mesh: TriangleMesh, *, radius_mm: float = ENVELOPE_RADIUS_MM) -> TriangleMesh:
    """Returns a closed surface that follows the outer folds and bridges sulci narrower than twice `radius_mm`.

    It is an alpha wrap (Portaneri et al. 2022, in pymeshlab) of the capped surface, moved back onto it by the offset
    that the wrap needs. The area of a sphere comes out 0.3 % small.
    """
    closed = capped(mesh)
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(closed.vertices, closed.faces))
    meshes.generate_alpha_wrap(alpha=pymeshlab.PureValue(radius_mm), offset=pymeshlab.PureValue(ENVELOPE_OFFSET_MM))
    wrap = meshes.current_mesh()
    outside = TriangleMesh(wrap.vertex_matrix(), wrap.face_matrix())
    return TriangleMesh(outside.vertices - ENVELOPE_OFFSET_MM * vertex_normals(outside), outside.faces)


def area_over(surface: TriangleMesh, mesh: TriangleMesh) -> float:
    """Returns the area in mm² of a surface around `mesh` without what lies over the cuts that `mesh` is open at.

    A piece of the surface is left out where its nearest point of the capped mesh is on a cap.
    """
    closed = capped(mesh)
    if len(closed.faces) == len(mesh.faces):
        return area(surface)
    vertices, faces = trimesh.remesh.subdivide_to_size(surface.vertices, surface.faces, CAP_RESOLUTION_MM, max_iter=20)
    pieces = TriangleMesh(vertices, faces)
    centres = corners(pieces).mean(axis=1)
    _, nearest, _ = igl.point_mesh_squared_distance(centres, closed.vertices, closed.faces)
    return float(face_areas(pieces)[nearest < len(mesh.faces)].sum())


def gyrification_index(mesh: TriangleMesh, around: TriangleMesh) -> float:
    """Returns the area of the surface over that of the hull or envelope around it, cuts left out of both."""
    return area(mesh) / area_over(around, mesh)


def sulcal_depth(mesh: TriangleMesh, around: TriangleMesh) -> Floats:
    """Returns the (n,) straight distance in mm from each vertex outwards to the envelope; 0 on it and outside it."""
    signed, *_ = igl.signed_distance(
        mesh.vertices, around.vertices, around.faces, igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    )
    return np.maximum(-signed, 0.0)
