"""Terraces, the steps that voxels leave on a surface, taken out as far as the voxels allow."""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from ..geometry.deformations import transform_points
from ..geometry.diffusion import stiffness_matrix
from ..geometry.matching import nearest_on
from ..geometry.remeshing import self_intersecting_faces
from ..geometry.triangles import Floats, TriangleMesh, corners, face_areas, face_normals, vertex_areas, vertex_normals

# how far a vertex may move at most, in voxels
FARTHEST_VOXELS = 0.7
# of a round: weight of roughness against distance, √t in mm², which halves waves of 9 mm; and the rounds. In voxels² it
# would leave the terraces of fine voxels, which are as long, and take folds of 8 mm with coarse ones
ROUGHNESS_MM2 = 2.048
ROUNDS = 16
# what is given back of the height of folds: what the Gaussian takes, in voxels², and what the rounds take, by roughness
GAUSSIAN_VOXELS2, OF_ROUGHNESS = 0.35, 0.14
# pivots on the diagonal keep the factors sparse: 60 times faster
SYMMETRIC = {"SymmetricMode": True}
# how many times vertices of faces that would cut others, turn by 60° or become needles are put back, with neighbours
PUT_BACK = 8
LEAST_COSINE, LEAST_SHAPE = 0.5, 0.75


def without_terraces(mesh: TriangleMesh, voxels: Floats, kept: NDArray[np.bool_] | bool = False) -> TriangleMesh:
    """Return the even surface of a smoothed mask without terraces; `voxels` is the mask's (4, 4) affine to mm.

    Of all surfaces that leave the centre of each voxel on the side of the surface on which it is, that of least
    roughness ∫ |Δ²x|² dA is approached by the alternating direction method of multipliers (Boyd et al. 2011, doi
    10.1561/2200000016), each round of which is an implicit step (1 + t² Δ⁴) x = z. Then a step against diffusion gives
    back what this and the Gaussian took of the height of folds. Vertices that are `kept` (n,) stay where they are, and
    so do those of faces that would cut others or become poor ones.
    """
    size = float(np.cbrt(abs(np.linalg.det(voxels[:3, :3]))))
    mass, stiffness = vertex_areas(mesh), stiffness_matrix(mesh.vertices, mesh.faces)
    if not np.isfinite(stiffness.data).all():
        # of faces without area
        return mesh
    # partial fractions: 1/(1 + x⁴) is the real part of −½ ∑ p/(x − p) over the two poles p above the real axis
    poles = np.exp(1j * np.pi * np.array([0.25, 0.75]))
    given_back = GAUSSIAN_VOXELS2 * size**2 + OF_ROUGHNESS * ROUGHNESS_MM2
    weighted = ROUGHNESS_MM2 * stiffness
    matrices = [sparse.csc_matrix(weighted - pole * sparse.diags(mass)) for pole in poles]
    solvers = [splu(matrix, "MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options=SYMMETRIC) for matrix in matrices]

    def smoothed(places: Floats) -> Floats:
        right = (mass[:, None] * places).astype(complex)
        return np.asarray(
            sum((-0.5 * pole * solver.solve(right)).real for pole, solver in zip(poles, solvers, strict=True))
        )

    start = mesh.vertices
    normals = vertex_normals(TriangleMesh(smoothed(start), mesh.faces))
    lowest, highest = (np.where(kept, 0.0, room) for room in _room(mesh, voxels, FARTHEST_VOXELS * size))
    allowed, error = start, np.zeros_like(start)
    for _ in range(ROUNDS):
        smooth = smoothed(allowed - error)
        height = np.einsum("ij,ij->i", smooth + error - start, normals)
        allowed = start + np.clip(height, lowest, highest)[:, None] * normals
        error += smooth - allowed
    sharpened = smooth + given_back * (stiffness @ smooth) / mass[:, None]
    way = np.where(np.reshape(kept, (-1, 1)), 0.0, sharpened - start)
    way *= np.minimum(1.0, size / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9))
    for _ in range(PUT_BACK):
        moved = TriangleMesh(start + way, mesh.faces)
        if not (bad := self_intersecting_faces(moved) | _spoilt(mesh, moved)).any():
            return moved
        near = np.isin(mesh.faces, mesh.faces[bad]).any(axis=1)
        way[mesh.faces[near]] = 0.0
    return mesh


def _spoilt(before: TriangleMesh, after: TriangleMesh) -> NDArray[np.bool_]:
    """Return the faces (m,) that have turned far, or become much thinner for their edges."""
    turned = np.einsum("ij,ij->i", face_normals(before), face_normals(after)) < LEAST_COSINE
    shapes = [
        face_areas(mesh) / (np.diff(corners(mesh), axis=1, append=corners(mesh)[:, :1]) ** 2).sum(axis=(1, 2))
        for mesh in (before, after)
    ]
    return turned | (shapes[1] < LEAST_SHAPE * shapes[0])


def _room(mesh: TriangleMesh, voxels: Floats, farthest_mm: float) -> tuple[Floats, Floats]:
    """Return how far inwards (n,) and outwards (n,) vertices may move before the surface passes a voxel's centre."""
    nearest = np.rint(transform_points(mesh.vertices, np.linalg.inv(voxels))).astype(np.int64)
    around = np.unique((nearest[:, None] + np.array(list(np.ndindex(3, 3, 3))) - 1).reshape(-1, 3), axis=0)
    centres = transform_points(around, voxels)
    away, face, place = nearest_on(centres, mesh)
    near = away < farthest_mm
    height = np.einsum("ij,ij->i", centres - place, face_normals(mesh)[face])[near].repeat(3)
    vertex = mesh.faces[face[near]].ravel()
    lowest, highest = (np.full(len(mesh.vertices), sign * farthest_mm) for sign in (-1.0, 1.0))
    np.maximum.at(lowest, vertex[height <= 0], height[height <= 0])
    np.minimum.at(highest, vertex[height >= 0], height[height >= 0])
    return lowest, highest
