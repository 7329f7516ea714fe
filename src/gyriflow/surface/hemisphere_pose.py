"""Hemispheres posed by their shape: each on the reference, its medial wall upright, and both sides of a brain alike.

Left hemispheres are mirrored, so that all are right ones here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.alignment import Fit, angle_deg
from ..geometry.triangles import TriangleMesh, transformed, vertex_areas, vertex_normals
from .limits import USUAL, Limits
from .medial_wall import medial_wall
from .outline_fit import Target, register, register_deformed, register_from_all_sides
from .outlines import Outline, outline, reference

Floats = NDArray[np.float64]

MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])
# the next best pose of a hemisphere has to fit worse by this factor, and the best one this well (in its size)
LEAST_CONFIDENCE, WORST_RESIDUAL = 1.1, 0.085
# two sides of one brain are mirror images as well as this times the asymmetry allowed
PAIR_RESIDUAL_PER_ASYMMETRY = 3.5
# a fit of one side on the other is off by about this many degrees per residual, about each axis
ERROR_DEG_PER_RESIDUAL = 50.0
# beside the shape, poses near these axes of files are likely
CONVENTIONS = {"ras": np.eye(3), "lps": np.diag([-1.0, -1.0, 1.0])}
CONVENTION_DEG = 35.0
# two hemispheres side by side have their centres this far apart, in sizes
APART = 0.4
# how many other brains of the study are consulted for the pose of a doubtful one
OTHERS = 2
SIDES = ("left", "right")
# how far, in sizes of the hemisphere, the Sylvian dent must be in front of the middle for front and back to be clear
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


def pair_by_shape(left: TriangleMesh, right: TriangleMesh, limits: Limits = USUAL, others: Sequence[Pair] = ()) -> Pair:
    """Returns the poses that the shapes of two closed, outward surfaces say, with further evidence where in doubt.

    Where the shape of a hemisphere fits the reference nearly as well in another pose, that is chosen which is near RAS
    or LPS in both files and has the left hemisphere on the left; else the one in which it fits the most alike of
    `others` clearly best, hemispheres of the same study. InputError where a hemisphere fits badly or still in more than
    one way, where the two are no mirror images of each other, and where they seem to be swapped.
    """
    right_sided = [transformed(left, MIRROR), right]
    hemispheres = [hemisphere_by_shape(mesh) for mesh in right_sided]
    if not all(_is_clear(hemisphere) for hemisphere in hemispheres):
        hemispheres = (
            _near_a_convention(right_sided, hemispheres)
            or _like_others(right_sided, hemispheres, others)
            or [_require_clear(hemisphere, side) for hemisphere, side in zip(hemispheres, SIDES, strict=True)]
        )
    one, other = hemispheres
    fit = register_deformed(Target(one.outline), Target(other.outline), other.rotation.T @ one.rotation)
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
        for hemisphere, turn in zip(hemispheres, _reconcile(one, other, fit), strict=True)
    )
    return Pair(one, other, fit)


def _reconcile(one: Hemisphere, other: Hemisphere, fit: Fit) -> tuple[Rotation, Rotation]:
    """Returns the rotations of both hemispheres that agree best with the fit and their medial walls.

    Least squares of three measures: each wall's tilts and the fit, by their errors. The walls say nothing about the
    pitch: each hemisphere gets the one half-way between the two.
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


def _is_clear(hemisphere: Hemisphere) -> bool:
    return hemisphere.confidence >= LEAST_CONFIDENCE and hemisphere.residual <= WORST_RESIDUAL


def _require_clear(hemisphere: Hemisphere, side: str) -> Hemisphere:
    if _is_clear(hemisphere):
        return hemisphere
    raise InputError(
        f"the pose of the {side} hemisphere cannot be determined from its shape",
        found=f"a residual of {hemisphere.residual:.3f}, the next best pose {hemisphere.confidence:.2f} times worse",
        expected=f"at most {WORST_RESIDUAL}, at least {LEAST_CONFIDENCE} times; or a pose near RAS or LPS",
        remedy="Is it a cerebral hemisphere's closed pial surface? If so, pose it and set coordinates: ras or lps.",
    )


def _near_a_convention(meshes: list[TriangleMesh], hemispheres: list[Hemisphere]) -> list[Hemisphere]:
    """Returns both hemispheres posed from RAS or from LPS axes; empty where the two do not agree with one of these.

    They agree where each fits the reference nearly as well as in its best pose, at no more than 35° from these axes,
    and the left one is on the left. Few random poses are so near: this is evidence where the shape leaves a choice.
    """
    for axes in CONVENTIONS.values():
        posed = []
        for mesh, best in zip(meshes, hemispheres, strict=True):
            fit = register(best.outline, Target(reference()), axes)
            nearly = fit.residual < LEAST_CONFIDENCE * best.residual and fit.residual <= WORST_RESIDUAL
            if nearly and angle_deg(fit.rotation @ axes.T) < CONVENTION_DEG:
                posed.append(_describe(mesh, best.outline, fit, best.confidence))
        # the left one is mirrored, so that both are to be right of the middle
        across = [(axes @ hemisphere.outline.centre)[0] for hemisphere in posed]
        if len(posed) == 2 and sum(across) > APART * posed[0].outline.size_mm:
            return posed
    return []


def _like_others(meshes: list[TriangleMesh], hemispheres: list[Hemisphere], others: Sequence[Pair]) -> list[Hemisphere]:
    """Returns hemispheres posed like those of another brain, the most alike in size; empty where that is doubtful."""
    posed: list[Hemisphere] = []
    for mesh, best, side in zip(meshes, hemispheres, SIDES, strict=True):
        if _is_clear(best):
            posed.append(best)
            continue
        known = [getattr(pair, side) for pair in others]
        known.sort(key=lambda hemisphere: abs(np.log(hemisphere.outline.size_mm / best.outline.size_mm)))
        for other in known[:OTHERS]:
            fit, confidence = register_from_all_sides(best.outline, Target(other.outline))
            if confidence >= LEAST_CONFIDENCE and fit.residual <= WORST_RESIDUAL:
                turned = Fit(other.rotation @ fit.rotation, fit.shift, fit.residual)
                posed.append(_describe(mesh, best.outline, turned, confidence))
                break
    return posed if len(posed) == 2 else []


def hemisphere_by_shape(mesh: TriangleMesh) -> Hemisphere:
    """Returns the pose of a right hemisphere (or a mirrored left one) that its shape says, however doubtful."""
    shape = outline(mesh)
    return _describe(mesh, shape, *register_from_all_sides(shape, Target(reference())))


def _describe(mesh: TriangleMesh, shape: Outline, fit: Fit, confidence: float) -> Hemisphere:
    """Returns a hemisphere whose fit on the reference is known, its medial wall upright."""
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
