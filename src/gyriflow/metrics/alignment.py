"""Rigid alignment of two triangle surfaces, with a measure of how sure its pose is."""

from dataclasses import dataclass, replace

import igl
import numpy as np

from ..geometry.alignment import CUBE_ROTATIONS, Fit, angle_deg, fits_from_all_sides, margin, step_towards_planes
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
        return angle_deg(self.matrix[:3, :3])


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

    def roughly(turn: Floats) -> Fit:
        shift = surfaces[1].centroid - turn @ surfaces[0].centroid
        return _closest_points(*surfaces, Fit(turn, shift, np.inf), ROUGH)

    def better(fit: Fit) -> Fit:
        closer = _closest_points(*surfaces, fit, FAIR)
        # of less than they are aligned to, distances say nothing
        return replace(closer, residual=max(_mean_distance(*surfaces, closer, FULL[0]), CONVERGED_MM))

    poses = fits_from_all_sides(CUBE_ROTATIONS, roughly, better, CANDIDATES, SAME_POSE_DEG)
    best = min(poses, key=lambda pose: pose.residual)
    chosen = best if best.residual < CLEARLY_BETTER * poses[0].residual else poses[0]
    fit = _closest_points(*surfaces, chosen, FULL)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = fit.rotation, fit.shift
    return Alignment(matrix, margin(poses, chosen, SAME_POSE_DEG))


def _surface(mesh: TriangleMesh) -> _Surface:
    tree = igl.AABB()
    tree.init(mesh.vertices, mesh.faces)
    return _Surface(mesh, tree, face_normals(mesh), centroid(mesh))


def _closest_points(a: _Surface, b: _Surface, fit: Fit, effort: tuple[int, int, float]) -> Fit:
    """Returns the motion of `a` onto `b` that closest points lead to from a motion.

    In both directions, each iteration a step towards the planes of the nearest faces. The residual is that of the
    effort's points.
    """
    count, max_iterations, converged_mm = effort
    of_a, of_b = a.spread(count), b.spread(count)
    rotation, shift = fit.rotation, fit.shift
    for _ in range(max_iterations):
        moved = of_a @ rotation.T + shift
        _, on_b, normals_b = b.nearest(moved)
        # points of b are taken back to where a is given
        _, on_a, normals_a = a.nearest((of_b - shift) @ rotation)
        points = np.concatenate([moved, on_a @ rotation.T + shift])
        targets = np.concatenate([on_b, of_b])
        normals = np.concatenate([normals_b, normals_a @ rotation.T])
        ahead = np.einsum("ij,ij->i", targets - points, normals)
        turn, move = step_towards_planes(points, normals, ahead)
        rotation, shift = turn @ rotation, turn @ shift + move
        if np.linalg.norm(moved @ turn.T + move - moved, axis=1).max() < converged_mm:
            break
    found = Fit(rotation, shift, np.inf)
    return replace(found, residual=_mean_distance(a, b, found, count))


def _mean_distance(a: _Surface, b: _Surface, fit: Fit, count: int) -> float:
    """Returns the mean over both directions of the distance in mm of points of one surface to the other."""
    there, _, _ = b.nearest(a.spread(count) @ fit.rotation.T + fit.shift)
    back, _, _ = a.nearest((b.spread(count) - fit.shift) @ fit.rotation)
    return float(0.5 * (there.mean() + back.mean()))
