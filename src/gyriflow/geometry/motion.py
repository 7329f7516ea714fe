"""Rigid motions between matched points, and of a surface onto another one near it."""

import igl
import numpy as np
from scipy.spatial.transform import Rotation

from .alignment import step_towards_planes
from .triangles import Floats, TriangleMesh, face_normals

POINTS = 4000
ROUNDS = 60
CONVERGED_MM = 0.005


def rigid_fit(points: Floats, onto: Floats, weights: Floats) -> Floats:
    """Returns the (4, 4) rigid motion of (n, 3) points onto matched ones by weighted least squares.

    Kabsch 1976, doi 10.1107/S0567739476001873.
    """
    centre, other = (np.average(places, axis=0, weights=weights) for places in (points, onto))
    turn, _ = Rotation.align_vectors(onto - other, points - centre, weights=weights)
    return _motion(turn.as_matrix(), other - turn.apply(centre))


def without_rigid_motion(first: Floats, second: Floats, weights: Floats) -> Floats:
    """Returns the (n, 3) displacement from `first` to `second`, the latter moved rigidly onto the former."""
    motion = rigid_fit(second, first, weights)
    return np.asarray(second @ motion[:3, :3].T + motion[:3, 3] - first)


def fit_onto(mesh: TriangleMesh, onto: TriangleMesh) -> Floats:
    """Returns the (4, 4) rigid motion of a surface onto another in nearly the same pose, by iterative closest points.

    Each round moves points of both surfaces towards the planes of their nearest faces on the other one (Chen and
    Medioni 1992). It begins with the surfaces as they are, centroids of the vertices together.
    """
    points, others = (shape.vertices[:: max(1, len(shape.vertices) // POINTS)] for shape in (mesh, onto))
    normals, other_normals = face_normals(mesh), face_normals(onto)
    motion = _motion(np.eye(3), others.mean(axis=0) - points.mean(axis=0))
    for _ in range(ROUNDS):
        rotation, shift = motion[:3, :3], motion[:3, 3]
        there = points @ rotation.T + shift
        _, face, on = igl.point_mesh_squared_distance(there, onto.vertices, onto.faces)
        _, back_face, back = igl.point_mesh_squared_distance((others - shift) @ rotation, mesh.vertices, mesh.faces)
        places = np.concatenate([there, back @ rotation.T + shift])
        ahead = np.concatenate([on, others]) - places
        facing = np.concatenate([other_normals[face], normals[back_face] @ rotation.T])
        step = step_towards_planes(places, facing, np.einsum("ij,ij->i", ahead, facing))
        motion = _motion(*step) @ motion
        if np.linalg.norm(points @ motion[:3, :3].T + motion[:3, 3] - there, axis=1).max() < CONVERGED_MM:
            break
    return motion


def _motion(rotation: Floats, shift: Floats) -> Floats:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, shift
    return matrix
