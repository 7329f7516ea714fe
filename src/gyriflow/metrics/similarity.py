"""Distance between two surfaces, for example a simulated and a real brain of the same week."""

import igl
import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.triangles import (
    Floats,
    TriangleMesh,
    area,
    corners,
    face_areas,
    face_normals,
    transformed,
    vertex_areas,
)

ALIGNMENT_POINTS = 2000
"""Points per surface that the alignment is found with."""

MAX_ITERATIONS = 60
CONVERGED_MM = 0.01
"""The alignment ends when no point moves further in an iteration."""


def surface_distance(a: TriangleMesh, b: TriangleMesh) -> dict[str, float]:
    """Returns the distances in mm between two surfaces, `a` moved rigidly onto `b` first.

    The keys are symmetric_mean_mm, the mean over both directions of the area-weighted mean distance to the other
    surface; hausdorff95_mm, the larger of the two 95 % quantiles; rotation_deg and shift_mm (of the centroid), the
    motion of the alignment. Both surfaces are to be in RAS+ mm, near the same pose.
    """
    matrix = rigid_alignment(a, b)
    moved = transformed(a, matrix)
    ways = [(distances(moved, b), vertex_areas(moved)), (distances(b, moved), vertex_areas(b))]
    return {
        "symmetric_mean_mm": float(np.mean([np.average(way, weights=areas) for way, areas in ways])),
        "hausdorff95_mm": max(_weighted_quantile(way, areas, 0.95) for way, areas in ways),
        "rotation_deg": float(np.degrees(Rotation.from_matrix(matrix[:3, :3]).magnitude())),
        "shift_mm": float(np.linalg.norm(_centroid(moved) - _centroid(a))),
    }


def distances(points_of: TriangleMesh, mesh: TriangleMesh) -> Floats:
    """Returns the (n,) distances in mm from the vertices of one surface to the other surface."""
    squared, _, _ = igl.point_mesh_squared_distance(points_of.vertices, mesh.vertices, mesh.faces)
    return np.sqrt(squared)


def rigid_alignment(a: TriangleMesh, b: TriangleMesh) -> Floats:
    """Returns the (4, 4) rotation and shift that moves `a` onto `b`.

    Iterative closest points, in both directions, each iteration the least-squares motion of points towards the planes
    of their nearest faces (Chen and Medioni 1992), from the pose in which the centroids meet.
    """
    matrix = np.eye(4)
    matrix[:3, 3] = _centroid(b) - _centroid(a)
    of_a, of_b, normals_a, normals_b = _spread(a), _spread(b), face_normals(a), face_normals(b)
    tree_a, tree_b = igl.AABB(), igl.AABB()
    tree_a.init(a.vertices, a.faces)
    tree_b.init(b.vertices, b.faces)
    for _ in range(MAX_ITERATIONS):
        rotation, shift = matrix[:3, :3], matrix[:3, 3]
        moved = of_a @ rotation.T + shift
        _, face_b, on_b = tree_b.squared_distance(b.vertices, b.faces, moved)
        # points of b are taken back to where a is given
        _, face_a, on_a = tree_a.squared_distance(a.vertices, a.faces, (of_b - shift) @ rotation)
        points = np.concatenate([moved, on_a @ rotation.T + shift])
        targets = np.concatenate([on_b, of_b])
        normals = np.concatenate([normals_b[face_b], normals_a[face_a] @ rotation.T])
        centre = points.mean(axis=0)
        # a turn w and a shift t move a point p by w x (p - centre) + t; directions without a pull (a sphere) stay
        columns = np.hstack([np.cross(points - centre, normals), normals])
        pull = np.einsum("ij,ij->i", targets - points, normals)
        turn, move = np.split(np.linalg.lstsq(columns, pull, rcond=1e-6)[0], 2)
        step = np.eye(4)
        step[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
        step[:3, 3] = centre + move - step[:3, :3] @ centre
        matrix = step @ matrix
        if np.linalg.norm(moved @ step[:3, :3].T + step[:3, 3] - moved, axis=1).max() < CONVERGED_MM:
            break
    return matrix


def _spread(mesh: TriangleMesh) -> Floats:
    """Returns points spread evenly over the surface, the same in every call."""
    return mesh.vertices[:: max(1, len(mesh.vertices) // ALIGNMENT_POINTS)]


def _centroid(mesh: TriangleMesh) -> Floats:
    """Returns the (3,) area-weighted centroid in mm."""
    return face_areas(mesh) @ corners(mesh).mean(axis=1) / area(mesh)


def _weighted_quantile(values: Floats, weights: Floats, share: float) -> float:
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(cumulative, share * cumulative[-1])])
