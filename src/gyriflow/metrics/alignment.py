"""Rigid alignment of two surfaces, with a measure of how sure its pose is."""

from dataclasses import dataclass

import igl
import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.triangles import Floats, TriangleMesh, area, corners, face_areas, face_normals

CONVERGED_MM = 0.01

FULL = 2000, 60, CONVERGED_MM
"""Points per surface that the alignment is found with, its most iterations, and when it ends before: no point moves by
more."""

FAIR = 500, 30, 0.05
"""The same for the few poses that are compared with each other."""

ROUGH = 150, 10, 0.5
"""The same for all poses, to find those few."""

CANDIDATES = 5
"""How many poses that differ from each other are compared."""

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
        Mean distance between the surfaces in the best pose that is turned away from this one, over that in this one,
        both aligned in the same way. Near 1 the surfaces fit as well in another pose; infinity where there is no other.
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
    roughly from each rotation of a cube, the centroids together. The best few of these poses, and that from the
    surfaces as given, are aligned better and all alike, and compared. The last is kept unless another one is clearly
    better. The pose that is kept is aligned in full.
    """
    surfaces = _surface(a), _surface(b)
    rough = [_closest_points(*surfaces, _together(*surfaces, turn), ROUGH) for turn in TURNS]
    poses = [_closest_points(*surfaces, end, FAIR) for end in _apart(surfaces, rough)]
    # of less than they are aligned to, distances say nothing
    far = np.array([max(_mean_distance(*surfaces, pose, FULL[0]), CONVERGED_MM) for pose in poses])
    best = int(far.argmin())
    chosen = best if far[best] < CLEARLY_BETTER * far[0] else 0
    elsewhere = [_angle_deg(pose @ np.linalg.inv(poses[chosen])) > SAME_POSE_DEG for pose in poses]
    margin = far[elsewhere].min(initial=np.inf) / far[chosen]
    return Alignment(_closest_points(*surfaces, poses[chosen], FULL), float(margin))


def _apart(surfaces: tuple[_Surface, _Surface], rough: list[Floats]) -> list[Floats]:
    """Returns the first of the motions, and after it the best of all that differ from each other."""
    far = [_mean_distance(*surfaces, matrix, ROUGH[0]) for matrix in rough]
    apart: list[int] = []
    for end in map(int, np.argsort(far)):
        if all(_angle_deg(rough[end] @ np.linalg.inv(rough[other])) > SAME_POSE_DEG for other in apart):
            apart.append(end)
    return [rough[end] for end in dict.fromkeys([0, *apart[:CANDIDATES]])]


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


def _closest_points(a: _Surface, b: _Surface, matrix: Floats, effort: tuple[int, int, float]) -> Floats:
    """Returns the (4, 4) motion of `a` onto `b` that closest points lead to from the motion `matrix`.

    In both directions, each iteration the least-squares motion of points towards the planes of their nearest faces
    (Chen and Medioni 1992).
    """
    count, max_iterations, converged_mm = effort
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
