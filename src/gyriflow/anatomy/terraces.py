"""Remove terraces, the steps that voxels leave on a surface, as far as the voxels
allow."""

from collections.abc import Sequence
from functools import partial

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from ..geometry.deformations import transform_points
from ..geometry.diffusion import stiffness_matrix
from ..geometry.matching import nearest_on
from ..geometry.remeshing import self_intersecting_faces
from ..geometry.triangles import (
    Floats,
    TriangleMesh,
    face_areas,
    face_normals,
    submesh,
    vertex_areas,
    vertex_normals,
)

# largest motion of a vertex
MAX_MOVE_VOXELS = 0.7
# weight of roughness against distance in a round, √t in mm², which halves waves of 9
# mm; number of rounds. In voxels², terraces of fine voxels, which are as long, would
# stay, and coarse voxels would lose folds of 8 mm
ROUGHNESS_MM2 = 2.048
# as near after ten rounds as after sixteen without over-relaxation
ROUNDS = 10
RELAXATION = 1.6
# compensation of the lost height of folds: for the Gaussian in voxels², for the rounds
# relative to the roughness weight
GAUSSIAN_VOXELS2, ROUGHNESS_SHARE = 0.35, 0.14
# pivots on the diagonal keep the factors sparse: 60 times faster. Larger panels and
# relaxed supernodes, which help denser matrices, would take a third longer
SYMMETRIC = {"SymmetricMode": True}
# vertices of faces that cross others, rotate by 60° or become needles are reset, with
# their neighbours, after all checks but the last
N_CHECKS = 16
MIN_COSINE, MIN_SHAPE_RATIO = 0.5, 0.75


def without_terraces(
    mesh: TriangleMesh,
    voxels: Floats,
    fixed: NDArray[np.bool_] | bool = False,
) -> TriangleMesh:
    """Remove the terraces of a smoothed mask's surface; `voxels` is the mask's (4, 4)
    affine to mm.

    Among surfaces that leave each voxel's centre on its side, the least rough, ∫ |Δ²x|²
    dA, is approximated by over-relaxed ADMM (Boyd et al. 2011, section 3.4.3, doi
    10.1561/2200000016) with steps (1 + t² Δ⁴) x = z. Inverse diffusion restores the
    height of folds. Vertices that are `fixed` (n,), or of faces that would cross others
    or degenerate, do not move.
    """
    size = float(np.cbrt(abs(np.linalg.det(voxels[:3, :3]))))
    mass, stiffness = vertex_areas(mesh), stiffness_matrix(mesh.vertices, mesh.faces)
    if not np.isfinite(stiffness.data).all():
        # the mesh has faces without area
        return mesh
    # partial fractions: 1/(1 + x⁴) is the real part of −½ ∑ p/(x − p) over the two
    # poles p above the real axis
    poles = np.exp(1j * np.pi * np.array([0.25, 0.75]))
    compensation = GAUSSIAN_VOXELS2 * size**2 + ROUGHNESS_SHARE * ROUGHNESS_MM2
    weighted = ROUGHNESS_MM2 * stiffness
    matrices = [
        sparse.csc_matrix(weighted - pole * sparse.diags(mass)) for pole in poles
    ]
    solvers = [
        splu(
            matrix,
            "MMD_AT_PLUS_A",
            diag_pivot_thresh=0.01,
            relax=1,
            panel_size=1,
            options=SYMMETRIC,
        )
        for matrix in matrices
    ]

    smoothed = partial(_smoothed, mass=mass, poles=poles, solvers=solvers)
    start = mesh.vertices
    smooth = smoothed(start)
    normals = vertex_normals(TriangleMesh(smooth, mesh.faces))
    lowest, highest = (
        np.where(fixed, 0.0, room)
        for room in _room(mesh, voxels, MAX_MOVE_VOXELS * size)
    )
    allowed, error = start, np.zeros_like(start)
    for _ in range(ROUNDS - 1):
        smooth = RELAXATION * smooth + (1.0 - RELAXATION) * allowed
        height = np.einsum("ij,ij->i", smooth + error - start, normals)
        allowed = start + np.clip(height, lowest, highest)[:, None] * normals
        error += smooth - allowed
        smooth = smoothed(allowed - error)
    sharpened = smooth + compensation * (stiffness @ smooth) / mass[:, None]
    moves = np.where(
        np.reshape(fixed, (-1, 1)),
        0.0,
        sharpened - start,
    )
    moves *= np.minimum(
        1.0,
        size
        / np.maximum(
            np.linalg.norm(moves, axis=1, keepdims=True),
            1e-9,
        ),
    )
    is_changed = np.ones(len(mesh.faces), dtype=bool)
    needs_search = is_changed.copy()
    for _ in range(N_CHECKS):
        moved = TriangleMesh(start + moves, mesh.faces)
        is_bad = np.zeros_like(is_changed)
        is_bad[is_changed] = _degraded(
            submesh(mesh, is_changed)[0],
            submesh(moved, is_changed)[0],
        )
        if not is_bad.any():
            # the search for crossings takes longest, so it comes last
            is_bad = self_intersecting_faces(moved, needs_search)
            needs_search[:] = False
        if not is_bad.any():
            return moved
        is_near = np.isin(mesh.faces, mesh.faces[is_bad]).any(axis=1)
        moves[mesh.faces[is_near]] = 0.0
        # all other faces are as they were when they were checked
        is_changed = np.isin(mesh.faces, mesh.faces[is_near]).any(axis=1)
        needs_search |= is_changed
    return mesh


def _smoothed(
    places: Floats,
    *,
    mass: Floats,
    poles: NDArray[np.complex128],
    solvers: Sequence[SuperLU],
) -> Floats:
    right = (mass[:, None] * places).astype(complex)
    return np.asarray(
        sum(
            (-0.5 * pole * solver.solve(right)).real
            for pole, solver in zip(poles, solvers, strict=True)
        )
    )


def _degraded(before: TriangleMesh, after: TriangleMesh) -> NDArray[np.bool_]:
    """Return the (m,) mask of the faces that rotated far or became much thinner."""
    turned = (
        np.einsum("ij,ij->i", face_normals(before), face_normals(after)) < MIN_COSINE
    )
    shapes = [
        face_areas(mesh)
        / igl.squared_edge_lengths(mesh.vertices, mesh.faces).sum(axis=1)
        for mesh in (before, after)
    ]
    return turned | (shapes[1] < MIN_SHAPE_RATIO * shapes[0])


def _room(
    mesh: TriangleMesh,
    voxels: Floats,
    max_move_mm: float,
) -> tuple[Floats, Floats]:
    """Return how far vertices may move inward (n,) and outward (n,) until the surface
    meets a voxel's centre."""
    nearest = np.rint(
        transform_points(
            mesh.vertices,
            np.linalg.inv(voxels),
        )
    ).astype(np.int64)
    first = nearest.min(axis=0) - 1
    shape = np.ptp(nearest, axis=0) + 3
    around = np.zeros(shape, dtype=bool)
    for step in np.ndindex(3, 3, 3):
        around[tuple((nearest - 1 - first + step).T)] = True
    centres = transform_points(np.argwhere(around) + first, voxels)
    distance, face, place = nearest_on(centres, mesh)
    near = distance < max_move_mm
    heights = np.einsum(
        "ij,ij->i",
        centres - place,
        face_normals(mesh)[face],
    )
    height = heights[near].repeat(3)
    vertex = mesh.faces[face[near]].ravel()
    lowest, highest = (
        np.full(len(mesh.vertices), sign * max_move_mm) for sign in (-1.0, 1.0)
    )
    np.maximum.at(
        lowest,
        vertex[height <= 0],
        height[height <= 0],
    )
    np.minimum.at(
        highest,
        vertex[height >= 0],
        height[height >= 0],
    )
    return lowest, highest
