"""Rigid alignment of two surfaces, with a measure of how sure its pose is."""

from dataclasses import dataclass

import igl
import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.triangles import Floats, TriangleMesh, area, corners, face_areas, face_normals

POINTS = 2000
"""Points per surface that the alignment is found with."""

MAX_ITERATIONS = 60
CONVERGED_MM = 0.01
"""The alignment ends when no point moves further in an iteration."""

ROUGH_POINTS = 150
ROUGH_ITERATIONS = 10
ROUGHLY_CONVERGED_MM = 0.5
"""The same for poses that are only compared with each other."""

TURNS = np.array(sorted(Rotation.create_group("O").as_matrix(), key=lambda turn: -np.trace(turn)))
"""The 24 rotations of a cube, none first: no rotation is more than 63 degrees from all of them."""

SAME_POSE_DEG = 30.0
"""Rotations that differ by less are one pose."""

CLEARLY_BETTER = 0.95
"""A pose other than that from the given one has to have a smaller share of its distance to be taken."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """A rigid motion.

    Attributes
    ----------
    matrix : (4, 4) float
        Rotation and shift in mm.
    margin : float
        Mean distance between the surfaces in the best pose that is turned away from this one, over that in this one.
        Near 1 the surfaces fit as well in another pose; infinity where there is no other one.
    """

    matrix: Floats
    margin: float

    @property
    def rotation_deg(self) -> float:
        """The angle of the rotation."""
        return _angle_deg(self.matrix)


@dataclass(frozen=True, eq=False)
class _Surface:
    mesh: TriangleMesh
    tree: igl.AABB
    normals: Floats
    centroid: Floats

    def nearest(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Returns per point the distance in mm, and the nearest point of the surface with the normal there."""
        squared, face, on = self.tree.squared_distance(self.mesh.vertices, self.mesh.faces, points)
        return np.sqrt(squared), on, self.normals[face]

    def spread(self, count: int) -> Floats:
        """Returns about `count` points spread over the surface, the same in every call."""
        return self.mesh.vertices[:: max(1, len(self.mesh.vertices) // count)]


def centroid(mesh: TriangleMesh) -> Floats:
    """Returns the (3,) area-weighted centroid in mm."""
    return face_areas(mesh) @ corners(mesh).mean(axis=1) / area(mesh)


def rigid_alignment(a: TriangleMesh, b: TriangleMesh) -> Alignment:
    """Returns the motion of `a` onto `b` with the least distance among those found from 24 poses.

    Iterative closest points find the nearest pose that fits, which need not be the best. They are therefore begun
    roughly from each rotation of a cube, the centroids together, and ended in full from the best. The pose from the
    surfaces as given is kept unless another one is clearly better.
    """
    surfaces = _surface(a), _surface(b)
    rough = [
        _closest_points(*surfaces, _together(*surfaces, turn), ROUGH_POINTS, ROUGH_ITERATIONS, ROUGHLY_CONVERGED_MM)
        for turn in TURNS
    ]
    far = np.array([_mean_distance(*surfaces, matrix, ROUGH_POINTS) for matrix in rough])
    # the first is the one from the surfaces as given
    ends = dict.fromkeys((0, int(far.argmin())))
    chosen = [_closest_points(*surfaces, rough[end], POINTS, MAX_ITERATIONS, CONVERGED_MM) for end in ends]
    given, best = chosen[0], chosen[-1]
    left = [_mean_distance(*surfaces, matrix, POINTS) for matrix in (given, best)]
    better = left[1] < CLEARLY_BETTER * left[0] - CONVERGED_MM
    matrix, distance = (best, left[1]) if better else (given, left[0])
    elsewhere = [_angle_deg(other @ np.linalg.inv(matrix)) > SAME_POSE_DEG for other in rough]
    margin = max(far[elsewhere].min(initial=np.inf), CONVERGED_MM) / max(distance, CONVERGED_MM)
    return Alignment(matrix, float(margin))


def _surface(mesh: TriangleMesh) -> _Surface:
    tree = igl.AABB()
    tree.init(mesh.vertices, mesh.faces)
    return _Surface(mesh, tree, face_normals(mesh), centroid(mesh))


def _together(a: _Surface, b: _Surface, turn: Floats) -> Floats:
    """Returns the (4, 4) motion that turns `a` about its centroid and takes that onto the centroid of `b`."""
    matrix = np.eye(4)
    matrix[:3, :3] = turn
    matrix[:3, 3] = b.centroid - turn @ a.centroid
    return matrix


def _closest_points(
    a: _Surface, b: _Surface, matrix: Floats, count: int, max_iterations: int, converged_mm: float
) -> Floats:
    """Returns the (4, 4) motion of `a` onto `b` that closest points lead to from the motion `matrix`.

    In both directions, each iteration the least-squares motion of points towards the planes of their nearest faces
    (Chen and Medioni 1992).
    """
    of_a, of_b = a.spread(count), b.spread(count)
    for _ in range(max_iterations):
        rotation, shift = matrix[:3, :3], matrix[:3, 3]
        moved = of_a @ rotation.T + shift
        _, on_b, normals_b = b.nearest(moved)
        # points of b are taken back to where a is given
        _, on_a, normals_a = a.nearest((of_b - shift) @ rotation)
        points = np.concatenate([moved, on_a @ rotation.T + shift])
        targets = np.concatenate([on_b, of_b])
        normals = np.concatenate([normals_b, normals_a @ rotation.T])
        centre = points.mean(axis=0)
        # a turn w and a shift t move a point p by w x (p - centre) + t; directions without a pull (a sphere) stay
        columns = np.hstack([np.cross(points - centre, normals), normals])
        pull = np.einsum("ij,ij->i", targets - points, normals)
        turn, move = np.split(np.linalg.lstsq(columns, pull, rcond=1e-6)[0], 2)
        step = np.eye(4)
        step[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
        step[:3, 3] = centre + move - step[:3, :3] @ centre
        matrix = step @ matrix
        if np.linalg.norm(moved @ step[:3, :3].T + step[:3, 3] - moved, axis=1).max() < converged_mm:
            break
    return matrix


def _mean_distance(a: _Surface, b: _Surface, matrix: Floats, count: int) -> float:
    """Returns the mean over both directions of the distance in mm of points of one surface to the other."""
    rotation, shift = matrix[:3, :3], matrix[:3, 3]
    there, _, _ = b.nearest(a.spread(count) @ rotation.T + shift)
    back, _, _ = a.nearest((b.spread(count) - shift) @ rotation)
    return float(0.5 * (there.mean() + back.mean()))


def _angle_deg(matrix: Floats) -> float:
    return float(np.degrees(Rotation.from_matrix(matrix[:3, :3]).magnitude()))
