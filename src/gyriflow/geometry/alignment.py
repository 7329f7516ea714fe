"""Rigid motions: between matched points, and of a shape onto another by iterative closest points."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from .triangles import Floats, TriangleMesh, face_normals, transformed

CUBE_ROTATIONS: Floats = np.array(sorted(Rotation.create_group("O").as_matrix(), key=lambda turn: -np.trace(turn)))
"""The 24 rotations of a cube, none first: no rotation is more than 63 degrees from all of them."""

MIRROR: Floats = np.diag([-1.0, 1.0, 1.0, 1.0])
"""The (4, 4) reflection that exchanges left and right in RAS coordinates."""

Planes = tuple[Floats, Floats, Floats, Floats | None]
"""Points, unit normals of the planes that they are to reach, how far these are along them, and weights."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A rigid motion p → rotation p + shift of one shape onto another, and the distance left, in the shapes' unit."""

    rotation: Floats
    shift: Floats
    residual: float


POINTS, ROUNDS, ARRIVED_MM = 4000, 60, 0.005
"""Of closest points: how many of either surface, most rounds, and the move that ends them."""

PATIENCE, NEARER = 5, 1e-3
"""Surfaces that differ never stand still: rounds also end when so many brought them no nearer by this share."""


def motion(rotation: ArrayLike | None = None, shift: ArrayLike | None = None) -> Floats:
    """Return the (4, 4) motion p → rotation p + shift; without one of the two, the identity in its place."""
    matrix = np.eye(4)
    if rotation is not None:
        matrix[:3, :3] = rotation
    if shift is not None:
        matrix[:3, 3] = shift
    return matrix


def angle_deg(rotation: Floats) -> float:
    """Return the angle of a (3, 3) rotation in degrees."""
    return float(np.degrees(Rotation.from_matrix(rotation).magnitude()))


def rigid_fit(points: Floats, onto: Floats, weights: Floats) -> Floats:
    """Return the (4, 4) rigid motion of (n, 3) points onto matched ones by weighted least squares.

    Kabsch 1976, doi 10.1107/S0567739476001873.
    """
    centre, other = (np.average(places, axis=0, weights=weights) for places in (points, onto))
    turn, _ = Rotation.align_vectors(onto - other, points - centre, weights=weights)
    return motion(turn.as_matrix(), other - turn.apply(centre))


def without_rigid_motion(first: Floats, second: Floats, weights: Floats) -> Floats:
    """Return the (n, 3) displacement from `first` to `second`, the latter moved rigidly onto the former."""
    back = rigid_fit(second, first, weights)
    return np.asarray(second @ back[:3, :3].T + back[:3, 3] - first)


def step_towards_planes(
    points: Floats, normals: Floats, ahead: Floats, weights: Floats | None = None
) -> tuple[Floats, Floats]:
    """Return the rotation and shift by which (n, 3) points come nearest to planes in the least-squares sense.

    One step of the point-to-plane iteration (Chen and Medioni 1992). The planes have unit `normals` and lie `ahead`
    (n,) along these; `weights` (n,) are those of the squared distances. Directions in which nothing pulls, such as the
    turns of a sphere, stay.
    """
    centre = points.mean(axis=0)
    rows = np.hstack([np.cross(points - centre, normals), normals])
    size = np.ones(len(points)) if weights is None else np.sqrt(weights)
    turn, move = np.split(np.linalg.lstsq(rows * size[:, None], ahead * size, rcond=1e-6)[0], 2)
    rotation = Rotation.from_rotvec(turn).as_matrix()
    return rotation, centre + move - rotation @ centre


def follow_planes(
    rotation: Floats,
    shift: Floats,
    planes: Callable[[Floats, Floats], Planes],
    rounds: int,
    arrived: Callable[[Floats, Floats, Floats], bool],
) -> tuple[Floats, Floats]:
    """Return the rotation and shift that iterative closest points lead to from given ones, in at most `rounds` steps.

    `planes` leads from rotation and shift to the moved points and the planes that they are to reach, `arrived` from the
    points of a step, its turn and its move to whether it is the last one.
    """
    for _ in range(rounds):
        points, normals, ahead, weights = planes(rotation, shift)
        turn, move = step_towards_planes(points, normals, ahead, weights)
        # as (4, 4) matrices: round-off decides which of two equally near faces is taken
        whole = motion(turn, move) @ motion(rotation, shift)
        rotation, shift = whole[:3, :3], whole[:3, 3]
        if arrived(points, turn, move):
            break
    return rotation, shift


def _nearest_planes(mesh: TriangleMesh) -> Callable[[Floats], tuple[Floats, Floats]]:
    tree, normals = igl.AABB(), face_normals(mesh)
    tree.init(mesh.vertices, mesh.faces)

    def nearest(points: Floats) -> tuple[Floats, Floats]:
        _, face, on = tree.squared_distance(mesh.vertices, mesh.faces, points)
        return on, normals[face]

    return nearest


def fit_onto(mesh: TriangleMesh, onto: TriangleMesh) -> Floats:
    """Return the (4, 4) rigid motion of a surface onto another in nearly the same pose, by iterative closest points.

    Points of both surfaces move towards the planes of their nearest faces on the other one.
    """
    left: list[float] = []
    nearest_of_a, nearest_of_b = _nearest_planes(mesh), _nearest_planes(onto)
    of_a, of_b = (one.vertices[:: max(1, len(one.vertices) // POINTS)] for one in (mesh, onto))

    def planes(rotation: Floats, shift: Floats) -> Planes:
        moved = of_a @ rotation.T + shift
        on_b, normals_b = nearest_of_b(moved)
        # points of b are taken back to where a is given
        on_a, normals_a = nearest_of_a((of_b - shift) @ rotation)
        points = np.concatenate([moved, on_a @ rotation.T + shift])
        normals = np.concatenate([normals_b, normals_a @ rotation.T])
        ahead = np.einsum("ij,ij->i", np.concatenate([on_b, of_b]) - points, normals)
        left.append(float(np.linalg.norm(ahead)))
        return points, normals, ahead, None

    def arrived(points: Floats, turn: Floats, move: Floats) -> bool:
        if len(left) > PATIENCE and min(left[-PATIENCE:]) > (1 - NEARER) * min(left[:-PATIENCE]):
            return True
        moved = points[: len(of_a)]
        return bool(np.linalg.norm(moved @ turn.T + move - moved, axis=1).max() < ARRIVED_MM)

    apart = of_b.mean(axis=0) - of_a.mean(axis=0)
    return motion(*follow_planes(np.eye(3), apart, planes, ROUNDS, arrived))


def align(mesh: TriangleMesh, onto: TriangleMesh) -> TriangleMesh:
    """Move a surface rigidly onto another in nearly the same pose, by `fit_onto`."""
    return transformed(mesh, fit_onto(mesh, onto))


def fits_from_all_sides(
    starts: Iterable[Floats],
    roughly: Callable[[Floats], Fit],
    better: Callable[[Fit], Fit],
    candidates: int,
    apart_deg: float,
) -> list[Fit]:
    """Return the fits that an alignment without a known start leads to, that from the first start first.

    An iteration finds the nearest pose that fits, which need not be the best. It is therefore begun `roughly` from
    each of the (3, 3) rotations `starts`; the best `candidates` of the poses that differ by more than `apart_deg`, and
    that from the first start, are made `better`, all alike, so that their residuals can be compared.
    """
    rough = [roughly(start) for start in starts]
    apart: list[int] = []
    for i in map(int, np.argsort([fit.residual for fit in rough], kind="stable")):
        if all(angle_deg(rough[i].rotation @ rough[j].rotation.T) > apart_deg for j in apart):
            apart.append(i)
    return [better(rough[i]) for i in dict.fromkeys([0, *apart[:candidates]])]


def margin(fits: Iterable[Fit], chosen: Fit, apart_deg: float) -> float:
    """Return how many times more the best fit of another pose leaves than the chosen one; infinity without any.

    Near 1 the shapes fit as well in another pose.
    """
    others = [fit.residual for fit in fits if angle_deg(fit.rotation @ chosen.rotation.T) > apart_deg]
    return float(min(others, default=np.inf) / chosen.residual)
