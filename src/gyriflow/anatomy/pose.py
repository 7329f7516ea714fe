"""Poses of surfaces by their shape: of the hemispheres of a brain, of one that is alone, and of whole brains.

Files that are well posed keep their pose. Left hemispheres are mirrored here, so that all are right ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.alignment import MIRROR, Fit, angle_deg, motion
from ..geometry.poses import CONVENTIONS, Pose, turned
from ..geometry.triangles import Floats, TriangleMesh, transformed
from ..settings.terms import SIDES
from .hindbrain import MIN_TURN_DEG, pose_from_rotation
from .template import (
    DEEPEST,
    Shape,
    brains,
    hemispheres,
    medial_wall,
    register,
    register_from_all_sides,
    shape_of,
)

# the next best pose has to fit worse by this factor: 1.01 in ellipsoids, 1.3 and more in hemispheres of atlases of 21
# to 38 GW, 1.1 in their whole brains; and the best one this well, in sizes
LEAST_CONFIDENCE, WORST_RESIDUAL = 1.07, 0.13
# how many times worse a shape fits mirrored where it shows its side: 1.16 and more in atlases of 21 to 38 GW
LEAST_SIDED = 1.07
# beside the shape, poses near these axes of files are likely
CONVENTION_DEG = 35.0
# the shape agrees with the axes of files: tilt of the plane between the hemispheres, and pitch
SAME_TILT_DEG, SAME_PITCH_DEG = 10.0, 15.0
# files of one brain share their coordinates where their poses differ by less; distances are in sizes
COMMON_DEG, COMMON_OFFSET, COMMON_DISTANCE = 5.0, 0.08, 0.15
# those that name one coordinate system do where they are turned by less than this
DECLARED_TURN_DEG = 30.0
# the medial walls' distance from the mid-sagittal plane where the files do not say it
BESIDE_MM = 0.5
# decimals of what is reported: a rounded rotation moves no place of a brain by a micrometre
DIGITS = 6


@dataclass(frozen=True, eq=False)
class Hemisphere:
    """A right hemisphere, or a mirrored left one, with what its shape says about its pose.

    `rotation` (3, 3) leads to RAS+, where the medial wall faces −x at `wall_mm` from the centre of volume. `residual`
    is the distance from the template relative to the size, `confidence` how many times worse the next best pose fits,
    `sided` how many times worse its mirror image does.
    """

    shape: Shape
    rotation: Floats
    wall_mm: float
    residual: float
    confidence: float
    sided: float

    @property
    def is_clear(self) -> bool:
        return self.confidence >= LEAST_CONFIDENCE and self.residual <= WORST_RESIDUAL


def hemisphere_by_shape(mesh: TriangleMesh) -> Hemisphere:
    """Return the pose of a right hemisphere (or a mirrored left one) that its shape says, however doubtful."""
    shape = shape_of(mesh)
    fit, confidence = register_from_all_sides(shape, hemispheres())
    mirrored, _ = register_from_all_sides(shape.mirrored(), hemispheres())
    normal, offset = medial_wall(shape, -fit.rotation[0])
    turn, _ = Rotation.align_vectors([[-1.0, 0.0, 0.0]], [fit.rotation @ normal])
    sided = mirrored.residual / fit.residual
    return Hemisphere(shape, turn.as_matrix() @ fit.rotation, -offset * shape.size_mm, fit.residual, confidence, sided)


def pose_of_pair(left: TriangleMesh, right: TriangleMesh, *, declared: bool = False) -> Pose:
    """Return the pose of a brain from two closed, outward surfaces, each in any rigid pose.

    Each is registered with the template, and the mirrored left one with the right one. Where both share coordinates
    near RAS or LPS, they keep the file's pose; where they share others, one motion poses both; else each has its own,
    with the medial walls beside x = 0. `declared` is whether the files name one and the same coordinate system.

    Where a shape fits several poses, both are taken as RAS+ with a warning. InputError where it is not near that
    either, and where the two seem to be swapped or of one side.
    """
    shapes = [hemisphere_by_shape(mesh) for mesh in (transformed(left, MIRROR), right)]
    _require_sides(shapes)
    if not all(one.is_clear for one in shapes):
        kept = [_kept_as_ras(one, hemispheres(), f"{side} hemisphere") for one, side in zip(shapes, SIDES, strict=True)]
        return kept[0]
    one, other = shapes
    fit = register(one.shape, [other.shape], other.rotation.T @ one.rotation)
    # half-way between what the right one says of itself, and what the left one says of it
    middle = Rotation.from_matrix([other.rotation, one.rotation @ fit.rotation.T]).mean().as_matrix()
    pair = replace(one, rotation=middle @ fit.rotation), replace(other, rotation=middle)
    motions = _motions(*pair, fit)
    together = _share_coordinates(*motions, *pair, declared)
    if together:
        motions = (_mean_motion(*motions, *pair),) * 2
    frame = _frame(motions[0]) if together else None
    if frame:
        motions = (CONVENTIONS[frame],) * 2
    sides = [moved.round(DIGITS) for moved in motions]
    whole = sides[0] if together else np.eye(4)
    evidence = {
        "coordinates": frame,
        **{
            name: {side: round(getattr(one, name), DIGITS) for side, one in zip(SIDES, shapes, strict=True)}
            for name in ("residual", "confidence", "sided")
        },
        "mirror_residual": round(fit.residual, DIGITS),
    }
    unclear = "left and right are taken from the configuration: the shapes do not show whether the files are swapped"
    # volumes of the brain are in RAS+
    return Pose(
        np.eye(4) if frame else whole,
        {"left": sides[0], "right": sides[1], "whole": whole},
        "file" if frame else "shape",
        together,
        evidence,
        (unclear,) if _sided(shapes) < LEAST_SIDED else (),
    )


def _sided(shapes: list[Hemisphere]) -> float:
    return float(np.exp(np.mean(np.log([one.sided for one in shapes]))))


def _require_sides(shapes: list[Hemisphere]) -> None:
    sided = [one.sided for one in shapes]
    fits = f"{sided[0]:.2f} (left) and {sided[1]:.2f} (right) times as far from the other side's template"
    if min(sided) < 1 / LEAST_SIDED and max(sided) > LEAST_SIDED:
        raise InputError("both hemispheres seem to be of one side", found=fits, expected="more than 1 for both")
    if _sided(shapes) < 1 / LEAST_SIDED:
        raise InputError(
            "the hemispheres seem to be swapped",
            found=fits,
            expected="more than 1",
            remedy="Swap `left` and `right`; or, if they are right, pose the files yourself and set coordinates: ras.",
        )


def _kept_as_ras(one: Hemisphere, targets: Sequence[Shape], what: str) -> Pose:
    """Return the file's pose for a shape that fits others as well; InputError where it fits worse near RAS+.

    Few random poses are so near to it: this is evidence where the shape leaves a choice.
    """
    fit = register(one.shape, targets, np.eye(3))
    nearly = fit.residual < LEAST_CONFIDENCE * one.residual and fit.residual <= WORST_RESIDUAL
    if not nearly or angle_deg(fit.rotation) >= CONVENTION_DEG:
        raise InputError(
            f"the pose of the {what} cannot be determined from its shape",
            found=f"a residual of {one.residual:.3f}, the next best pose {one.confidence:.2f} times worse",
            expected=f"at most {WORST_RESIDUAL}, at least {LEAST_CONFIDENCE} times; or a pose near RAS",
            remedy="Is it the closed pial surface of a cerebrum? If so, pose it and set coordinates: ras or lps.",
        )
    doubt = "the shape fits other poses as well as RAS+, in which the coordinates were taken: set coordinates"
    return Pose(by="default", warnings=(doubt,))


def _motions(left: Hemisphere, right: Hemisphere, fit: Fit) -> tuple[Floats, Floats]:
    # the left centre of volume less the right one, mirrored, once both are posed
    offset = right.rotation @ fit.shift * right.shape.size_mm
    posed = []
    for one, part in ((left, 0.5), (right, -0.5)):
        target = np.array([BESIDE_MM - one.wall_mm, *(part * offset[1:])])
        posed.append(motion(one.rotation, target - one.rotation @ one.shape.centre))
    return MIRROR @ posed[0] @ MIRROR, posed[1]


def _share_coordinates(to_left: Floats, to_right: Floats, left: Hemisphere, right: Hemisphere, declared: bool) -> bool:
    angle = angle_deg(to_right[:3, :3].T @ to_left[:3, :3])
    if declared and angle < DECLARED_TURN_DEG:
        return True
    centre = MIRROR[:3, :3] @ left.shape.centre
    apart = to_right - to_left
    away = np.abs(apart[:3, :3] @ centre + apart[:3, 3]) / right.shape.size_mm
    return bool(angle < COMMON_DEG and away[0] < COMMON_DISTANCE and np.hypot(*away[1:]) < COMMON_OFFSET)


def _mean_motion(to_left: Floats, to_right: Floats, left: Hemisphere, right: Hemisphere) -> Floats:
    centre = 0.5 * (MIRROR[:3, :3] @ left.shape.centre + right.shape.centre)
    rotation = Rotation.from_matrix([to_left[:3, :3], to_right[:3, :3]]).mean().as_matrix()
    there = 0.5 * sum(side[:3, :3] @ centre + side[:3, 3] for side in (to_left, to_right))
    return motion(rotation, there - rotation @ centre)


def _frame(to_ras: Floats) -> str | None:
    for name, axes in CONVENTIONS.items():
        turn = to_ras[:3, :3] @ axes[:3, :3].T
        tilt = np.degrees(np.arccos(np.clip(turn[0, 0], -1.0, 1.0)))
        if tilt < SAME_TILT_DEG and abs(pitch_deg(turn)) < SAME_PITCH_DEG:
            return name
    return None


def pitch_deg(rotation: Floats) -> float:
    """Return the angle in degrees of the rotation about x that is nearest to a (3, 3) rotation."""
    block = rotation[1:, 1:]
    return float(np.degrees(np.arctan2(block[1, 0] - block[0, 1], block[0, 0] + block[1, 1])))


def doubts_of_hemispheres(left: TriangleMesh, right: TriangleMesh, coordinates: str) -> list[str]:
    """Return what the shapes of two hemispheres say against their sides and the coordinates, "ras" or "lps".

    The surfaces are in RAS+ already, if these are right. Files of the wrong side in the wrong one of the two still
    lie side by side, but their mirror images fit better.
    """
    shapes = [hemisphere_by_shape(mesh) for mesh in (transformed(left, MIRROR), right)]
    if _sided(shapes) < 1 / LEAST_SIDED:
        named = coordinates.upper()
        swapped = f"are left and right swapped, and the coordinates not {named}? Check both, or set coordinates: auto"
        return [f"the shapes fit the other sides better: {swapped}"]
    turns = [angle_deg(one.rotation) for one in shapes]
    if all(one.is_clear for one in shapes) and min(turns) > MIN_TURN_DEG:
        return [_against(coordinates, "hemispheres are", float(np.mean(turns)))]
    return []


def pose_of_surface(mesh: TriangleMesh, coordinates: str) -> Pose:
    """Return the pose of a whole brain's surface, in coordinates that the user names or leaves to "auto".

    Named coordinates are kept, with a warning where the shape clearly contradicts them. InputError where the pose
    must come from the shape and is ambiguous.
    """
    shape = shape_of(mesh, deepest=DEEPEST)
    fit, confidence = register_from_all_sides(shape, brains())
    one = Hemisphere(shape, fit.rotation, 0.0, fit.residual, confidence, 1.0)
    return _judged(one, one.rotation, coordinates, "brain", brains())


def pose_of_volume_by_shape(mesh: TriangleMesh, sided: bool) -> Pose:
    """Return the pose of a label volume from the surface of its cerebrum, in the coordinates of the volume.

    The file's is kept where the shape is within 60° of it or says none, with a warning. `sided` is whether labels say
    which side is which.
    """
    unchecked = Pose(warnings=("neither labels nor shape say how the brain lies: its pose is the file's, unchecked",))
    try:
        pose = pose_of_surface(mesh, "auto")
    except InputError:
        return unchecked
    return unchecked if pose.by == "default" else pose_from_rotation(pose.of_file()[:3, :3], "the shape", sided)


def pose_of_hemisphere(mesh: TriangleMesh, side: str, coordinates: str, *, of_volume: bool = False) -> Pose:
    """Return the pose of a clean hemisphere that is alone, in coordinates "ras", "lps" or "auto".

    With "auto", the axes of the file are kept where its shape says that they are RAS or LPS within 35°, and its medial
    wall is then turned upright; else the shape's pose is taken. With `of_volume` it is the surface of a label volume,
    whose mistakes other volumes of the brain are taken to share. InputError where the pose is ambiguous, or the shape
    is that of the other side.
    """
    mirror = MIRROR if side == "left" else np.eye(4)
    one = hemisphere_by_shape(transformed(mesh, mirror))
    rotation = mirror[:3, :3] @ one.rotation @ mirror[:3, :3]
    if coordinates == "auto" and one.is_clear and one.sided < 1 / LEAST_SIDED:
        raise InputError(
            f"the hemisphere seems to be the {'right' if side == 'left' else 'left'} one",
            found=f"{one.sided:.2f} times as far from the other side's template",
            expected="more than 1",
        )
    pose = _judged(one, rotation, coordinates, "hemisphere", hemispheres(), of_volume=of_volume)
    if one.sided < LEAST_SIDED:
        doubt = f"the side, {side}, is taken from the configuration: it cannot be determined from the shape"
        pose = replace(pose, warnings=(doubt, *pose.warnings))
    return replace(pose, evidence={"confidence": one.confidence, "sided": one.sided})


def _judged(
    one: Hemisphere, rotation: Floats, coordinates: str, what: str, targets: Sequence[Shape], of_volume: bool = False
) -> Pose:
    """Return the pose that is named, or else what a brain's or a hemisphere's `rotation` to RAS+ (3, 3) says of it."""
    angles = {name: angle_deg(rotation @ axes[:3, :3].T) for name, axes in CONVENTIONS.items()}
    if coordinates != "auto":
        doubtful = one.is_clear and angles[coordinates] > MIN_TURN_DEG
        doubts = [_against(coordinates, f"{what} is", angles[coordinates])] if doubtful else []
        return turned(CONVENTIONS[coordinates][:3, :3], "configuration", coordinates, *doubts)
    if not one.is_clear:
        return _kept_as_ras(one, targets, what)
    nearest = min(angles, key=lambda name: angles[name])
    if angles[nearest] >= CONVENTION_DEG:
        return turned(rotation, "shape", "ras", f"the {what} was turned by {angles['ras']:.0f}°, as its shape says")
    axes = CONVENTIONS[nearest][:3, :3]
    said = [] if nearest == "ras" else [f"the shape says that the coordinates are {nearest.upper()}"]
    if what == "brain":
        return turned(axes, "shape", nearest, *said)
    # the smallest turn that sets the medial wall upright
    upright, _ = Rotation.align_vectors([[1.0, 0.0, 0.0]], [axes @ rotation.T @ np.array([1.0, 0.0, 0.0])])
    return turned(upright.as_matrix() @ axes, "file", "ras" if of_volume else nearest, *said)


def _against(coordinates: str, what: str, angle: float) -> str:
    check = "check them, or set coordinates: auto"
    return f"the shape says that the {what} turned by {angle:.0f}° against the coordinates {coordinates}: {check}"
