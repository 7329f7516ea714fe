"""Rigid registration: of matched points, and of surfaces by iterative closest
points."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial

import igl
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from .deformations import transform_points
from .triangles import Floats, TriangleMesh, dots, face_normals, transformed

_TURNS = Rotation.create_group("O").as_matrix()
CUBE_ROTATIONS: Floats = np.array(
    sorted(
        _TURNS,
        key=np.trace,
        reverse=True,
    )
)
"""The 24 rotations of a cube, the identity first. Every rotation is within 63 degrees
of one of them."""

IDENTITY: Floats = np.eye(3)
MIRROR: Floats = np.diag([-1.0, 1.0, 1.0, 1.0])
"""The (4, 4) reflection that exchanges left and right in RAS coordinates."""


@dataclass(frozen=True, eq=False)
class Planes:
    """Points (n, 3), the unit `normals` of their target planes, the signed `distances`
    to these along the normals, and weights."""

    points: Floats
    normals: Floats
    distances: Floats
    weights: Floats | None = None


@dataclass(frozen=True, eq=False)
class RigidFit:
    """A rigid motion p → rotation p + shift that registers a shape to another, and the
    residual distance."""

    rotation: Floats
    shift: Floats
    residual: float


N_POINTS, MAX_ROUNDS, MOVE_TOL_MM = 4000, 60, 0.005
"""Iterative closest points: points of either surface, rounds, and the motion at which
they end."""

STALL_ROUNDS, STALL_TOL = 5, 1e-3
"""Surfaces that differ never stop moving, so rounds also end when this many reduced the
distance by less than this."""


def motion(rotation: ArrayLike = IDENTITY, shift: ArrayLike = 0.0) -> Floats:
    """Return the (4, 4) motion p → rotation p + shift. The default of each is the
    identity."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = shift
    return matrix


def angle_deg(rotation: Floats) -> float:
    """Return the angle of a (3, 3) rotation in degrees."""
    return float(np.degrees(Rotation.from_matrix(rotation).magnitude()))


def rigid_fit(
    points: Floats,
    onto: Floats,
    weights: Floats,
) -> Floats:
    """Return the (4, 4) least-squares motion of (n, 3) points onto others (Kabsch 1976,
    10.1107/S0567739476001873)."""
    source = np.average(points, axis=0, weights=weights)
    target = np.average(onto, axis=0, weights=weights)
    turn, _ = Rotation.align_vectors(
        onto - target,
        points - source,
        weights=weights,
    )
    shift = target - turn.apply(source)
    return motion(turn.as_matrix(), shift)


def align_points(
    points: Floats,
    onto: Floats,
    weights: Floats,
) -> Floats:
    """Return (n, 3) points after their least-squares rigid motion onto others."""
    return transform_points(points, rigid_fit(points, onto, weights))


def _step_towards_planes(planes: Planes) -> tuple[Floats, Floats]:
    """Return the rotation and shift that minimise the squared distances of points from
    planes.

    One step of Chen and Medioni 1992. Undetermined directions, such as the rotations of
    a sphere, are not changed.
    """
    points = planes.points
    distances = planes.distances
    centre = points.mean(axis=0)
    turns = np.cross(points - centre, planes.normals)
    rows = np.hstack([turns, planes.normals])
    if planes.weights is not None:
        roots = np.sqrt(planes.weights)
        rows = rows * roots[:, None]
        distances = distances * roots
    solution, *_ = np.linalg.lstsq(rows, distances, rcond=1e-6)
    turn, move = solution[:3], solution[3:]
    rotation = Rotation.from_rotvec(turn).as_matrix()
    return rotation, centre + move - rotation @ centre


def follow_planes(
    rotation: Floats,
    shift: Floats,
    find_planes: Callable[[Floats, Floats], Planes],
    rounds: int,
    is_converged: Callable[[Floats, Floats, Floats], bool],
) -> tuple[Floats, Floats]:
    """Return the rotation and shift after at most `rounds` steps of iterative closest
    points.

    `find_planes` gives the planes for a rotation and shift; `is_converged` gets a
    step's points, rotation and shift.
    """
    for _ in range(rounds):
        planes = find_planes(rotation, shift)
        turn, move = _step_towards_planes(planes)
        # as (4, 4) matrices, since round-off decides between two equally close faces
        whole = motion(turn, move) @ motion(rotation, shift)
        rotation = whole[:3, :3]
        shift = whole[:3, 3]
        if is_converged(planes.points, turn, move):
            break
    return rotation, shift


# a surface may be the target of several in turn
@lru_cache(maxsize=2)
def _nearest_planes(mesh: TriangleMesh) -> Callable[[Floats], tuple[Floats, Floats]]:
    """Return a function that finds the nearest points of a surface, and the normals
    there."""
    tree = igl.AABB()
    tree.init(mesh.vertices, mesh.faces)
    return partial(_nearest_plane, tree, mesh, face_normals(mesh))


def _nearest_plane(
    tree: igl.AABB,
    mesh: TriangleMesh,
    normals: Floats,
    points: Floats,
) -> tuple[Floats, Floats]:
    _, face, places = tree.squared_distance(
        mesh.vertices,
        mesh.faces,
        points,
    )
    return places, normals[face]


def _some_points(mesh: TriangleMesh) -> Floats:
    step = max(1, len(mesh.vertices) // N_POINTS)
    return mesh.vertices[::step]


def _fit_onto(mesh: TriangleMesh, onto: TriangleMesh) -> Floats:
    """Return the (4, 4) rigid motion that aligns a surface to one in a similar pose:
    point to plane, both ways."""
    residuals: list[float] = []
    nearest_of_a = _nearest_planes(mesh)
    nearest_of_b = _nearest_planes(onto)
    points_a = _some_points(mesh)
    points_b = _some_points(onto)

    def find_planes(rotation: Floats, shift: Floats) -> Planes:
        moved_a = points_a @ rotation.T + shift
        on_b, normals_b = nearest_of_b(moved_a)
        # points of b are moved back to the original place of a
        back = (points_b - shift) @ rotation
        on_a, normals_a = nearest_of_a(back)
        moved_on_a = on_a @ rotation.T + shift
        turned_normals = normals_a @ rotation.T
        points = np.concatenate([moved_a, moved_on_a])
        targets = np.concatenate([on_b, points_b])
        normals = np.concatenate([normals_b, turned_normals])
        distances = dots(targets - points, normals)
        residuals.append(float(np.linalg.norm(distances)))
        return Planes(points, normals, distances)

    def is_converged(
        points: Floats,
        turn: Floats,
        move: Floats,
    ) -> bool:
        before = residuals[:-STALL_ROUNDS]
        last = residuals[-STALL_ROUNDS:]
        if before and min(last) > (1 - STALL_TOL) * min(before):
            return True
        start = points[: len(points_a)]
        moves = start @ turn.T + move - start
        lengths = np.linalg.norm(moves, axis=1)
        return bool(lengths.max() < MOVE_TOL_MM)

    rotation, shift = follow_planes(
        np.eye(3),
        points_b.mean(axis=0) - points_a.mean(axis=0),
        find_planes,
        MAX_ROUNDS,
        is_converged,
    )
    return motion(rotation, shift)


def align(mesh: TriangleMesh, onto: TriangleMesh) -> TriangleMesh:
    """Align a surface rigidly to another in a similar pose, by iterative closest
    points."""
    return transformed(mesh, _fit_onto(mesh, onto))
