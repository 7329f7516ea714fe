"""Distance between two surfaces, for example a simulated and a real brain of the same week."""

import igl
import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import MeshError
from ..geometry.triangles import Floats, TriangleMesh, area, corners, face_areas, transformed, vertex_areas

ALIGNMENT_POINTS = 2000
"""Points per surface that the alignment is found with."""

MAX_ITERATIONS = 100
CONVERGED_MM = 1e-3
"""The alignment has converged when no point moves further in an iteration."""


def surface_distance(a: TriangleMesh, b: TriangleMesh) -> dict[str, float]:
    """Returns the distances in mm between two surfaces, `a` moved rigidly onto `b` first.

    The keys are symmetric_mean_mm, the mean over both directions of the area-weighted mean distance to the other
    surface; hausdorff95_mm, the larger of the two 95 % quantiles; rotation_deg and shift_mm (of the centroid), the
    motion of the alignment. Both surfaces are to be in RAS+ mm, near the same pose.
    """
    matrix = rigid_alignment(a, b)
    moved = transformed(a, matrix)
    there, back = distances(moved, b), distances(b, moved)
    weights = vertex_areas(moved), vertex_areas(b)
    quantiles = [_weighted_quantile(d, w, 0.95) for d, w in zip((there, back), weights, strict=True)]
    return {
        "symmetric_mean_mm": float(
            0.5 * (np.average(there, weights=weights[0]) + np.average(back, weights=weights[1]))
        ),
        "hausdorff95_mm": max(quantiles),
        "rotation_deg": float(np.degrees(Rotation.from_matrix(matrix[:3, :3]).magnitude())),
        "shift_mm": float(np.linalg.norm(_centroid(moved) - _centroid(a))),
    }


def distances(points_of: TriangleMesh, mesh: TriangleMesh) -> Floats:
    """Returns the (n,) distances in mm from the vertices of one surface to the other surface."""
    squared, _, _ = igl.point_mesh_squared_distance(points_of.vertices, mesh.vertices, mesh.faces)
    return np.sqrt(squared)


def rigid_alignment(a: TriangleMesh, b: TriangleMesh) -> Floats:
    """Returns the (4, 4) rotation and shift that moves `a` onto `b`.

    Iterative closest points (Besl and McKay 1992) from both surfaces' points to the other, from the pose in which the
    centroids meet. MeshError where it does not settle.
    """
    rotation, shift = np.eye(3), _centroid(b) - _centroid(a)
    of_a, of_b = _spread(a), _spread(b)
    for _ in range(MAX_ITERATIONS):
        moved = of_a @ rotation.T + shift
        _, _, on_b = igl.point_mesh_squared_distance(moved, b.vertices, b.faces)
        # points of b are taken back to the pose of a, so that a's search tree is over fixed vertices
        _, _, on_a = igl.point_mesh_squared_distance((of_b - shift) @ rotation, a.vertices, a.faces)
        source, target = np.concatenate([of_a, on_a]), np.concatenate([on_b, of_b])
        middle_source, middle_target = source.mean(axis=0), target.mean(axis=0)
        step, _ = Rotation.align_vectors(target - middle_target, source - middle_source)
        rotation = step.as_matrix()
        shift = middle_target - rotation @ middle_source
        if np.linalg.norm(of_a @ rotation.T + shift - moved, axis=1).max() < CONVERGED_MM:
            matrix = np.eye(4)
            matrix[:3, :3], matrix[:3, 3] = rotation, shift
            return matrix
    raise MeshError(
        "the surfaces cannot be aligned",
        found=f"motion after {MAX_ITERATIONS} iterations",
        remedy="Check that both are brains in RAS+ mm",
    )


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
