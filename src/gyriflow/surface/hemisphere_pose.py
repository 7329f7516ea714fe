"""Hemispheres posed by their shape: each on the reference, its medial wall upright, and both sides of a brain alike.

Left hemispheres are mirrored, so that all are right ones here.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from gyriflow.errors import InputError
from gyriflow.geometry.triangles import TriangleMesh, transformed, vertex_areas, vertex_normals
from gyriflow.surface.limits import USUAL, Limits
from gyriflow.surface.medial_wall import medial_wall
from gyriflow.surface.outlines import Outline, outline, reference
from gyriflow.surface.registration import Fit, Target, found, matched

Floats = NDArray[np.float64]

MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])
# the next best pose of a hemisphere has to fit worse by this factor, and the best one this well (in its size)
LEAST_CONFIDENCE, WORST_RESIDUAL = 1.1, 0.085
# two sides of one brain are mirror images as well as this times the asymmetry allowed
PAIR_RESIDUAL_PER_ASYMMETRY = 3.5
# a fit of one side on the other is off by about so many degrees per residual, about each axis
ERROR_DEG_PER_RESIDUAL = 50.0
# the Sylvian dent is in front of the middle by so much of the hemisphere's size where it is to be told from the back
SYLVIAN_AHEAD = 0.05


@dataclass(frozen=True, eq=False)
class Hemisphere:
    """A hemisphere, mirrored where it is a left one, with what its shape says about its pose.

    Attributes
    ----------
    outline
        In the coordinates of the file (mirrored).
    rotation : (3, 3) float
        To RAS+: the medial wall faces −x, the pitch is the reference's.
    wall_mm : float
        Where the medial wall is then, along x from the centre of volume.
    wall_error_deg : float
        By how much its normal may be off.
    residual, confidence : float
        Distance to the reference relative to the size, and how many times worse the next best pose is.
    sylvian : float
        How far in front of the middle the dents of the lateral side are, in sizes.
    """

    outline: Outline
    rotation: Floats
    wall_mm: float
    wall_error_deg: float
    residual: float
    confidence: float
    sylvian: float


@dataclass(frozen=True, eq=False)
class Pair:
    """The hemispheres of a brain, of one pitch, and the fit of the left outline on the right one."""

    left: Hemisphere
    right: Hemisphere
    fit: Fit

    @property
    def offset_mm(self) -> Floats:
        """The left centre of volume less the right one, mirrored, once both are posed; (3,) in mm."""
        return np.asarray(self.right.rotation @ self.fit.shift * self.right.outline.size_mm)


def pair_by_shape(left: TriangleMesh, right: TriangleMesh, limits: Limits = USUAL) -> Pair:
    """Returns the poses that the shapes of two closed, outward surfaces say.

    InputError where a hemisphere fits the reference badly or in more than one way, where the two are no mirror images
    of each other, and where they seem to be swapped.
    """
    hemispheres = [_clearly_posed(transformed(left, MIRROR), "left"), _clearly_posed(right, "right")]
    one, other = hemispheres
    fit = matched(Target(one.outline), Target(other.outline), other.rotation.T @ one.rotation)
    worst = PAIR_RESIDUAL_PER_ASYMMETRY * limits.max_asymmetry
    if fit.residual > worst:
        raise InputError(
            "the hemispheres are no mirror images of each other",
            found=f"a mean distance of {fit.residual:.3f} of their size between one and the other's mirror image",
            expected=f"at most {worst:.3f}",
            remedy="Give both hemispheres of one subject and week. Are both files of the same side? If they are so "
            "asymmetric, raise surface.max_asymmetry.",
        )
    ahead = [hemisphere.sylvian for hemisphere in hemispheres]
    if min(ahead) < -SYLVIAN_AHEAD and max(ahead) > SYLVIAN_AHEAD:
        raise InputError(
            "both hemispheres seem to be of one side",
            found=f"the Sylvian fissure {ahead[0]:+.2f} (left) and {ahead[1]:+.2f} (right) of the size off the middle",
            expected="in front of the middle in both, mirrored",
            remedy="Give one left and one right hemisphere.",
        )
    if np.mean(ahead) < -SYLVIAN_AHEAD:
        raise InputError(
            "the hemispheres seem to be swapped",
            found=f"the Sylvian fissure {-np.mean(ahead):.2f} of the size behind the middle",
            expected="in front of the middle",
            remedy="Swap `left` and `right`; or, if they are right, pose the files yourself and set coordinates: ras.",
        )
    one, other = (
        replace(hemisphere, rotation=turn.as_matrix() @ hemisphere.rotation)
        for hemisphere, turn in zip(hemispheres, _reconciled(one, other, fit), strict=True)
    )
    return Pair(one, other, fit)


def _reconciled(one: Hemisphere, other: Hemisphere, fit: Fit) -> tuple[Rotation, Rotation]:
    """Returns by which rotations both hemispheres are to be turned to lie as the fit and their walls say.

    Least squares of three measures: each wall's tilts and the fit, by their errors. Of the pitch the walls say nothing:
    each hemisphere gets one half-way between what the two say.
    """
    apart = Rotation.from_matrix(other.rotation @ fit.rotation @ one.rotation.T).as_rotvec()
    walls = np.array([one.wall_error_deg, other.wall_error_deg]) ** 2
    first, second = walls / (walls.sum() + (ERROR_DEG_PER_RESIDUAL * fit.residual) ** 2)
    shares = np.array([[0.5, first, first], [-0.5, -second, -second]])
    turn, back = Rotation.from_rotvec(apart * shares)
    return turn, back


def about_x(angle_deg: float) -> Floats:
    """Returns the (3, 3) rotation about x, from y to z, by an angle in degrees."""
    return Rotation.from_euler("x", angle_deg, degrees=True).as_matrix()


def pitch_deg(rotation: Floats) -> float:
    """Returns the angle in degrees of the rotation about x that is nearest to a (3, 3) rotation."""
    block = rotation[1:, 1:]
    return float(np.degrees(np.arctan2(block[1, 0] - block[0, 1], block[0, 0] + block[1, 1])))


def _clearly_posed(mesh: TriangleMesh, side: str) -> Hemisphere:
    posed = hemisphere_by_shape(mesh)
    if posed.confidence < LEAST_CONFIDENCE or posed.residual > WORST_RESIDUAL:
        raise InputError(
            f"the pose of the {side} hemisphere cannot be told from its shape",
            found=f"a residual of {posed.residual:.3f}, the next best pose {posed.confidence:.2f} times worse",
            expected=f"at most {WORST_RESIDUAL}, at least {LEAST_CONFIDENCE} times",
            remedy="Is it a cerebral hemisphere's closed pial surface? If so, pose it and set coordinates: ras or lps.",
        )
    return posed


def hemisphere_by_shape(mesh: TriangleMesh) -> Hemisphere:
    """Returns the pose of a right hemisphere (or a mirrored left one) that its shape says, however doubtful."""
    shape = outline(mesh)
    fit, confidence = found(shape, Target(reference()))
    points = np.asarray((mesh.vertices - shape.centre) / shape.size_mm, dtype=np.float64)
    start = np.asarray(-fit.rotation[0], dtype=np.float64)
    areas = vertex_areas(mesh)
    wall = medial_wall(points, vertex_normals(mesh), areas, start)
    turn, _ = Rotation.align_vectors([[-1.0, 0.0, 0.0]], [fit.rotation @ wall.normal])
    rotation = turn.as_matrix() @ fit.rotation
    rotation = about_x(pitch_deg(fit.rotation @ rotation.T)) @ rotation
    # of the surface the sulci may outweigh the Sylvian fissure, of the outline it may be shallow
    both = (points, areas), (shape.points, np.ones(len(shape.points)))
    ahead = float(np.mean([_sylvian(places @ rotation.T, weights) for places, weights in both]))
    return Hemisphere(shape, rotation, -wall.offset * shape.size_mm, wall.error_deg, fit.residual, confidence, ahead)


def _sylvian(points: Floats, areas: Floats) -> float:
    """Returns how far in front of the middle the lateral side of posed points is deep below their convex hull."""
    planes = ConvexHull(points).equations
    depth = np.concatenate(
        [-(part @ planes[:, :3].T + planes[:, 3]).max(axis=1) for part in np.array_split(points, 50)]
    )
    low, high = points.min(axis=0), points.max(axis=0)
    lateral = points[:, 0] > low[0] + 0.3 * (high[0] - low[0])
    weights = areas * lateral * np.maximum(depth - 0.03, 0.0) ** 2
    if not weights.any():
        return 0.0
    return float(np.average(points[:, 1], weights=weights) - 0.5 * (low[1] + high[1]))
