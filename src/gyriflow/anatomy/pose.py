"""Estimate the pose of a surface from its shape, and of a label volume from hindbrain
and labelled sides, or its shape.

Left hemispheres are mirrored here and treated as right ones.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import nibabel as nib
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.alignment import CUBE_ROTATIONS, MIRROR, RigidFit, angle_deg, motion
from ..geometry.deformations import transform_points
from ..geometry.poses import CONVENTIONS, Pose, turned
from ..geometry.triangles import Floats, TriangleMesh, transformed, unit
from ..settings.schemes import LabelScheme
from ..settings.terms import SIDES
from . import template
from .plausible import EXCHANGED_OR_MIRRORED
from .template import PointCloud

# a pose is clear if the next best one fits worse by this factor (1.01 in ellipsoids,
# 1.3 and more in hemispheres of atlases of 21 to 38 GW, 1.1 in their whole brains), and
# its own residual is at most this, in sizes
MIN_CONFIDENCE, MAX_RESIDUAL = 1.07, 0.13
# the side is clear if the mirrored shape fits worse by this factor: 1.16 and more in
# atlases of 21 to 38 GW
MIN_SIDE_RATIO = 1.07
# poses within this angle of the axes of files (RAS, LPS) are likely a priori
CONVENTION_DEG = 35.0
# tolerances for agreement of the shape with the axes of the file: tilt of the
# mid-plane, and pitch
TILT_TOL_DEG, PITCH_TOL_DEG = 10.0, 15.0
# two files share their coordinates if their poses differ by less; distances are in
# sizes
COMMON_DEG, COMMON_OFFSET, COMMON_DISTANCE = 5.0, 0.08, 0.15
# the same for files that name one coordinate system
DECLARED_TURN_DEG = 30.0
# distance of the medial walls from the mid-sagittal plane if it does not follow from
# the files
WALL_DISTANCE_MM = 0.5
# decimals of reported values: rounding a rotation moves no point of a brain by a
# micrometre
DIGITS = 6
# from the cerebrum's centre to those of cerebellum and brainstem, RAS+: means over
# weeks 21 to 34 of the example atlas
EXPECTED = {
    "cerebellum": np.array([0.0, -0.58, -0.81]),
    "brainstem": np.array([0.0, -0.30, -0.95]),
}
# minimum of these distances, in cube roots of the cerebrum's volume; 0.37 or more in
# weeks 21 to 36
MIN_HINDBRAIN_DISTANCE = 0.25
# labelled sides weigh as much as the hindbrain
TO_RIGHT = np.array([1.0, 0.0, 0.0])
# smaller rotations are left as in the file: atlases and scans differ by as much
MIN_TURN_DEG = 60.0
# rotations between this and MIN_TURN_DEG are left with a warning
DOUBTFUL_TURN_DEG = 15.0
PITCH_KEPT = "its mid-plane is set upright, its pitch is kept; check the file's axes"
# without known sides a rotated brain cannot be distinguished from a mirrored one
MIRROR_WARNING = (
    "if an axis is reversed instead, or two are exchanged, left and right are wrong"
    " now: check them"
)
# two directions closer than this (radians) do not determine the rotation about them
MIN_SPREAD = 0.06
# a rotation this close to quarter turns is taken for quarter turns, as caused by wrong
# axis codes
QUARTERS_DEG = 15.0


@dataclass(frozen=True, eq=False)
class PosedShape:
    """A right hemisphere, a mirrored left one, or a brain, by its `kind`, with the pose
    estimated from its shape.

    `rotation` (3, 3) leads to RAS+, where the medial wall faces −x and is at x =
    `wall_mm`, which is negative, from the centre of volume. `residual` is in sizes;
    `confidence` is that of the next best pose over it, `side_ratio` that of the
    mirrored shape, which `mirrored_rotation` leads to RAS+.
    """

    kind: Literal["hemisphere", "brain"]
    shape: PointCloud
    rotation: Floats
    wall_mm: float
    residual: float
    confidence: float
    side_ratio: float
    mirrored_rotation: Floats


def _is_clear(shape: PosedShape) -> bool:
    return shape.confidence >= MIN_CONFIDENCE and shape.residual <= MAX_RESIDUAL


def _hemisphere_by_shape(mesh: TriangleMesh) -> PosedShape:
    """Estimate the pose of a right hemisphere (or a mirrored left one) from its shape,
    even if it is not clear."""
    shape = template.shape_of(mesh)
    templates = template.template_shapes("hemisphere")
    fit, confidence = template.register_from_all_sides(shape, templates)
    mirrored, _ = template.register_from_all_sides(shape.mirrored(), templates)
    # −x of RAS+ in the coordinates of the shape
    to_medial = -fit.rotation[0]
    normal, offset = template.medial_wall(shape, to_medial)
    # the smallest turn that makes the wall face −x exactly
    turn, _ = Rotation.align_vectors(
        [[-1.0, 0.0, 0.0]],
        [fit.rotation @ normal],
    )
    side_ratio = mirrored.residual / fit.residual
    rotation = turn.as_matrix() @ fit.rotation
    wall_mm = -offset * shape.size_mm
    return PosedShape(
        "hemisphere",
        shape,
        rotation,
        wall_mm,
        fit.residual,
        confidence,
        side_ratio,
        mirrored.rotation,
    )


def pose_of_pair(
    left: TriangleMesh,
    right: TriangleMesh,
    *,
    declared: bool = False,
) -> Pose:
    """Return the pose of a brain from two closed, outward hemispheres, each in any
    rigid pose.

    Common coordinates close to RAS or LPS are kept; other common ones get one rigid
    motion, else each gets its own, with the medial walls next to x = 0. `declared` is
    whether both files name one coordinate system. If a shape fits several poses, both
    are taken as RAS+ with a warning. InputError if that does not fit, or the two seem
    swapped or of one side.
    """
    shapes = _shapes_of_pair(left, right)
    _require_sides(shapes)
    if not all(map(_is_clear, shapes)):
        poses = [
            _pose_as_ras(shape, f"{side} {shape.kind}")
            for shape, side in zip(shapes, SIDES, strict=True)
        ]
        return poses[0]
    mirrored_left, own_right = shapes
    fit = template.register_shape(
        mirrored_left.shape,
        [own_right.shape],
        own_right.rotation.T @ mirrored_left.rotation,
    )
    # mean of the right one's own estimate and of that from the left one
    from_left = mirrored_left.rotation @ fit.rotation.T
    both = Rotation.from_matrix([own_right.rotation, from_left])
    middle = both.mean().as_matrix()
    pair = (
        replace(mirrored_left, rotation=middle @ fit.rotation),
        replace(own_right, rotation=middle),
    )
    motions = _motions(*pair, fit)
    together = _share_coordinates(*motions, *pair, declared)
    if together:
        motions = (_mean_motion(*motions, *pair),) * 2
    frame = _frame(motions[0]) if together else None
    if frame:
        motions = (CONVENTIONS[frame],) * 2
    sides = [moved.round(DIGITS) for moved in motions]
    whole = sides[0] if together else np.eye(4)
    evidence: dict[str, Any] = {"coordinates": frame}
    for name in ("residual", "confidence", "side_ratio"):
        evidence[name] = {
            side: round(getattr(shape, name), DIGITS)
            for side, shape in zip(SIDES, shapes, strict=True)
        }
    evidence["mirror_residual"] = round(fit.residual, DIGITS)
    doubts = []
    if not together:
        angle, shift = _difference(*motions, mirrored_left)
        doubts.append(
            "the medial walls do not face each other in the files' coordinates:"
            f" {np.linalg.norm(shift):.1f} mm and {angle:.0f}° off:"
            " each was posed by its own shape. Are both files in one space?"
        )
    if together and not frame and (axes := _axes_of_file(motions[0][:3, :3])):
        doubts.append(
            f"the files have the axes {axes} according to the shape; {MIRROR_WARNING}"
        )
    if _mean_side_ratio(shapes) < MIN_SIDE_RATIO:
        doubts.append(
            "left and right are those of the configuration: the shapes do not show if"
            " the files are swapped"
        )
    # volumes of the brain are in RAS+
    return Pose(
        np.eye(4) if frame else whole,
        {
            "left": sides[0],
            "right": sides[1],
            "whole": whole,
        },
        "file" if frame else "shape",
        together,
        evidence,
        tuple(doubts),
    )


def _shapes_of_pair(left: TriangleMesh, right: TriangleMesh) -> list[PosedShape]:
    return [_hemisphere_by_shape(mesh) for mesh in (transformed(left, MIRROR), right)]


def _mean_side_ratio(shapes: list[PosedShape]) -> float:
    return float(np.exp(np.mean(np.log([shape.side_ratio for shape in shapes]))))


def _distances_from_templates(shapes: list[PosedShape]) -> str:
    left, right = (shape.side_ratio for shape in shapes)
    return (
        f"{left:.2f} (left) and {right:.2f} (right) times the distance from the other"
        " side's template"
    )


def _require_sides(shapes: list[PosedShape]) -> None:
    ratios = [shape.side_ratio for shape in shapes]
    found = _distances_from_templates(shapes)
    if min(ratios) < 1 / MIN_SIDE_RATIO and max(ratios) > MIN_SIDE_RATIO:
        raise InputError(
            "both hemispheres seem to be of one side",
            found=found,
            expected="more than 1 for both",
            remedy="Give one file of each hemisphere, both in the same coordinates.",
        )
    if _mean_side_ratio(shapes) < 1 / MIN_SIDE_RATIO:
        raise _wrong_sides(shapes, found)


def _wrong_sides(shapes: list[PosedShape], found: str) -> InputError:
    """Return the error of hemispheres that each have the shape of the other side:
    exchanged, or mirrored.

    A mirrored hemisphere has the shape of the other one, so both explain any such pair.
    Only the axes of the files speak for one of them: exchanged files are most likely in
    RAS or LPS, as other files are.
    """
    mirrored_left, own_right = shapes
    mirror = MIRROR[:3, :3]
    # from the coordinates of the files to RAS+, if these are exchanged
    rotations = [
        mirrored_left.mirrored_rotation,
        mirror @ own_right.mirrored_rotation @ mirror,
    ]
    exchanged = {_axes_of_file(rotation) for rotation in rotations}
    mirrored = {_axes_of_file(mirror @ rotation) for rotation in rotations}
    axes = exchanged.pop() if len(exchanged) == 1 else ""
    mirrored_axes = mirrored.pop() if len(mirrored) == 1 else ""
    if axes and axes.lower() not in CONVENTIONS:
        return InputError(
            "the coordinates of the hemispheres seem to be mirrored, unless the files"
            " are exchanged in unusual axes",
            found=f"the axes {mirrored_axes} if mirrored, {axes} if exchanged; {found}",
            expected="the axes RAS or LPS, and more than 1",
            remedy=(
                "Export the surfaces in RAS or LPS, which shows which it is. Do not"
                " swap `left` and `right` before: the left one of mirrored hemispheres"
                " would be measured as the right one."
            ),
        )
    if axes:
        found += f"; the axes {axes} if they are exchanged, {mirrored_axes} if mirrored"
    known = (
        "If both the sides and the axes are known to be right, set coordinates: ras or"
        " lps."
    )
    return InputError(
        "the hemispheres are exchanged, or their coordinates mirrored; their shapes do"
        " not show which",
        found=found,
        expected="more than 1",
        remedy=f"{EXCHANGED_OR_MIRRORED}. {known}",
    )


def _axes_of_file(to_ras: Floats) -> str:
    """Return the directions of a file's axes, such as RAS or LPI, or "" if they are
    oblique.

    `to_ras` is the (3, 3) rotation, or rotation and reflection, from the coordinates of
    the file to RAS+.
    """
    cosines = np.abs(to_ras).max(axis=0)
    if cosines.min() < np.cos(np.radians(CONVENTION_DEG)):
        return ""
    return "".join(nib.aff2axcodes(motion(to_ras)))


def _pose_as_ras(shape: PosedShape, name: str) -> Pose:
    """Return the file's pose for a shape that fits several; InputError if it fits
    clearly worse near RAS+."""
    fit = template.register_shape(
        shape.shape, template.template_shapes(shape.kind), np.eye(3)
    )
    fits_ras = (
        fit.residual < MIN_CONFIDENCE * shape.residual and fit.residual <= MAX_RESIDUAL
    )
    if not fits_ras or angle_deg(fit.rotation) >= CONVENTION_DEG:
        next_best = f"the next best pose has {shape.confidence:.2f} times as much"
        raise InputError(
            f"the pose of the {name} cannot be determined from its shape",
            found=f"a residual of {shape.residual:.3f}; {next_best}",
            expected=(
                f"at most {MAX_RESIDUAL}, and at least {MIN_CONFIDENCE} times; or a"
                " pose near RAS"
            ),
            remedy=(
                "Is it the closed pial surface of a cerebrum? If so, pose it and set"
                " coordinates: ras or lps."
            ),
        )
    doubt = (
        "the coordinates are taken as RAS+, but the shape fits other poses as well: set"
        " coordinates"
    )
    return Pose(by="default", warnings=(doubt,))


def _motions(
    left: PosedShape,
    right: PosedShape,
    fit: RigidFit,
) -> tuple[Floats, Floats]:
    # offset between the centres of volume of both posed hemispheres, the left one
    # mirrored
    offset = right.rotation @ fit.shift * right.shape.size_mm
    posed = []
    for side, share in ((left, 0.5), (right, -0.5)):
        target = np.array([WALL_DISTANCE_MM - side.wall_mm, *(share * offset[1:])])
        posed.append(
            motion(
                side.rotation,
                target - side.rotation @ side.shape.centre,
            )
        )
    return MIRROR @ posed[0] @ MIRROR, posed[1]


def _difference(
    to_left: Floats,
    to_right: Floats,
    left: PosedShape,
) -> tuple[float, Floats]:
    """Return the angle between two motions, and their shift (3,) in mm at the left
    hemisphere's centre."""
    turn = to_right[:3, :3].T @ to_left[:3, :3]
    mirrored_centre = transform_points(left.shape.centre, MIRROR)
    shift = transform_points(mirrored_centre, to_right - to_left)
    return angle_deg(turn), shift


def _share_coordinates(
    to_left: Floats,
    to_right: Floats,
    left: PosedShape,
    right: PosedShape,
    declared: bool,
) -> bool:
    angle, shift_mm = _difference(to_left, to_right, left)
    if declared and angle < DECLARED_TURN_DEG:
        return True
    shift = np.abs(shift_mm) / right.shape.size_mm
    return bool(
        angle < COMMON_DEG
        and shift[0] < COMMON_DISTANCE
        and np.hypot(*shift[1:]) < COMMON_OFFSET
    )


def _mean_motion(
    to_left: Floats,
    to_right: Floats,
    left: PosedShape,
    right: PosedShape,
) -> Floats:
    centre = 0.5 * (MIRROR[:3, :3] @ left.shape.centre + right.shape.centre)
    rotation = (
        Rotation.from_matrix([to_left[:3, :3], to_right[:3, :3]]).mean().as_matrix()
    )
    moved = 0.5 * sum(
        side[:3, :3] @ centre + side[:3, 3] for side in (to_left, to_right)
    )
    return motion(rotation, moved - rotation @ centre)


def _frame(to_ras: Floats) -> str | None:
    for name, axes in CONVENTIONS.items():
        turn = to_ras[:3, :3] @ axes[:3, :3].T
        tilt = np.degrees(np.arccos(np.clip(turn[0, 0], -1.0, 1.0)))
        if tilt < TILT_TOL_DEG and abs(_pitch_deg(turn)) < PITCH_TOL_DEG:
            return name
    return None


def _pitch_deg(rotation: Floats) -> float:
    """Return the angle in degrees of the rotation about x that is closest to a (3, 3)
    rotation."""
    block = rotation[1:, 1:]
    return float(
        np.degrees(
            np.arctan2(
                block[1, 0] - block[0, 1],
                block[0, 0] + block[1, 1],
            )
        )
    )


def require_coordinates(
    left: TriangleMesh,
    right: TriangleMesh,
    coordinates: str,
) -> list[str]:
    """Return warnings if the shapes of two hemispheres in RAS+ contradict their sides
    or the `coordinates` that the configuration names, "ras" or "lps".

    InputError if each clearly is the other side's in other coordinates: the files are
    exchanged, or the coordinates mirrored, and not the named ones in either case.
    """
    shapes = _shapes_of_pair(left, right)
    if _mean_side_ratio(shapes) < 1 / MIN_SIDE_RATIO:
        causes = (
            "left and right are exchanged and the coordinates are not"
            f" {coordinates.upper()}, or these are mirrored"
        )
        if _are_exchanged_in_other_axes(left, right, shapes):
            raise InputError(
                f"the hemispheres contradict their sides: {causes}",
                found=_distances_from_templates(shapes),
                expected="more than 1 for both",
                remedy=(
                    "Set coordinates: auto, which shows the axes in both cases, and do"
                    " not swap `left` and `right` before."
                ),
            )
        return [
            f"the shapes fit the other sides better: {causes}: set coordinates: auto,"
            " and do not swap before"
        ]
    turns = [angle_deg(shape.rotation) for shape in shapes]
    if all(map(_is_clear, shapes)) and min(turns) > MIN_TURN_DEG:
        return [
            _contradiction(
                coordinates,
                "hemispheres are",
                float(np.mean(turns)),
            )
        ]
    return []


def _are_exchanged_in_other_axes(
    left: TriangleMesh,
    right: TriangleMesh,
    shapes: list[PosedShape],
) -> bool:
    """Return whether both shapes clearly are the other side's, far from RAS.

    Both have to be: an odd brain, whose coordinates are right, is not to be refused.
    """
    if max(shape.side_ratio for shape in shapes) >= 1 / MIN_SIDE_RATIO:
        return False
    exchanged = _shapes_of_pair(right, left)
    turns = [angle_deg(shape.rotation) for shape in exchanged]
    return all(map(_is_clear, exchanged)) and min(turns) > MIN_TURN_DEG


def pose_of_surface(mesh: TriangleMesh, coordinates: str) -> Pose:
    """Return the pose of a brain's surface in coordinates "ras", "lps" or "auto";
    InputError if this is unclear."""
    shape = template.shape_of(mesh, max_depth=template.MAX_DEPTH)
    fit, confidence = template.register_from_all_sides(
        shape, template.template_shapes("brain")
    )
    brain = PosedShape(
        "brain", shape, fit.rotation, 0.0, fit.residual, confidence, 1.0, fit.rotation
    )
    return _choose_pose(brain, brain.rotation, coordinates)


def pose_of_volume_by_shape(mesh: TriangleMesh, has_sides: bool) -> Pose:
    """Return the pose of a label volume from the surface of its cerebrum, in the
    volume's coordinates.

    The file's is kept, with a warning, if it is within 60° or unclear. `has_sides` is
    whether the sides are labelled.
    """
    unchecked = Pose(
        warnings=(
            "neither labels nor shape determine the pose: it is the file's, unchecked",
        )
    )
    try:
        pose = pose_of_surface(mesh, "auto")
    except InputError:
        return unchecked
    return (
        unchecked
        if pose.by == "default"
        else _pose_from_rotation(
            pose.of_file()[:3, :3],
            "the shape",
            has_sides,
        )
    )


def pose_of_hemisphere(
    mesh: TriangleMesh,
    side: str,
    coordinates: str,
    *,
    of_volume: bool = False,
) -> Pose:
    """Return the pose of a single, clean hemisphere in coordinates "ras", "lps" or
    "auto".

    With "auto", axes of the file that fit RAS or LPS within 35° are kept and the medial
    wall is set upright, else the pose is that of the shape. `of_volume`: the surface is
    that of a label volume, whose axes other volumes have, too. InputError if the pose
    is ambiguous or the shape is the other hemisphere's.
    """
    mirror = MIRROR if side == "left" else np.eye(4)
    hemisphere = _hemisphere_by_shape(transformed(mesh, mirror))
    rotation = mirror[:3, :3] @ hemisphere.rotation @ mirror[:3, :3]
    side_ratio, other = hemisphere.side_ratio, "right" if side == "left" else "left"
    if (
        coordinates == "auto"
        and _is_clear(hemisphere)
        and side_ratio < 1 / MIN_SIDE_RATIO
    ):
        raise InputError(
            f"the hemisphere seems to be the {other} one, or mirrored; its shape does"
            " not show which",
            found=f"{side_ratio:.2f} times the distance from the other side's template",
            expected="more than 1",
            remedy=(
                f"Find out which. If it is the {other} one, set side: {other}. If an"
                " axis is reversed, or two are exchanged, export it in its true"
                " orientation (RAS or LPS) and keep the side."
            ),
        )
    pose = _choose_pose(hemisphere, rotation, coordinates, of_volume=of_volume)
    if side_ratio < 1 / MIN_SIDE_RATIO:
        doubt = (
            f"the shape fits the {other} side better than the {side} one: is the side"
            " wrong, or an axis reversed?"
        )
        pose = replace(pose, warnings=(doubt, *pose.warnings))
    elif side_ratio < MIN_SIDE_RATIO:
        doubt = (
            f"the side, {side}, is that of the configuration: it cannot be determined"
            " from the shape"
        )
        pose = replace(pose, warnings=(doubt, *pose.warnings))
    return replace(
        pose, evidence={"confidence": hemisphere.confidence, "side_ratio": side_ratio}
    )


def _choose_pose(
    shape: PosedShape,
    rotation: Floats,
    coordinates: str,
    *,
    of_volume: bool = False,
) -> Pose:
    """Return the pose in named coordinates, or that of the shape; `rotation` (3, 3)
    leads to RAS+."""
    angles = {
        name: angle_deg(rotation @ axes[:3, :3].T) for name, axes in CONVENTIONS.items()
    }
    if coordinates != "auto":
        is_doubtful = _is_clear(shape) and angles[coordinates] > MIN_TURN_DEG
        doubts = (
            [
                _contradiction(
                    coordinates,
                    f"{shape.kind} is",
                    angles[coordinates],
                )
            ]
            if is_doubtful
            else []
        )
        return turned(
            CONVENTIONS[coordinates][:3, :3], "configuration", coordinates, *doubts
        )
    if not _is_clear(shape):
        return _pose_as_ras(shape, shape.kind)
    nearest = min(angles, key=lambda name: angles[name])
    if angles[nearest] >= CONVENTION_DEG:
        moved = (
            f"the {shape.kind} was rotated by {angles['ras']:.0f}° according to its"
            " shape"
        )
        return turned(
            rotation,
            "shape",
            "ras",
            f"{moved}; {MIRROR_WARNING}",
        )
    axes = CONVENTIONS[nearest][:3, :3]
    notes = (
        []
        if nearest == "ras"
        else [f"the coordinates are {nearest.upper()} according to the shape"]
    )
    if shape.kind == "brain":
        # a single hemisphere shows by its shape whether it is mirrored
        return turned(
            axes, "shape", nearest, *(f"{note}; {MIRROR_WARNING}" for note in notes)
        )
    # the smallest rotation that sets the medial wall upright
    upright, _ = Rotation.align_vectors(
        [[1.0, 0.0, 0.0]], [axes @ rotation.T @ np.array([1.0, 0.0, 0.0])]
    )
    return turned(
        upright.as_matrix() @ axes, "file", "ras" if of_volume else nearest, *notes
    )


def _contradiction(
    coordinates: str,
    what: str,
    angle: float,
) -> str:
    check = "check them, and whether an axis is reversed; or set coordinates: auto"
    return (
        f"according to the shape the {what} rotated by {angle:.0f}° from the"
        f" coordinates {coordinates}: {check}"
    )


def pose_of_labels(
    labels: NDArray[np.integer],
    affine: Floats,
    scheme: LabelScheme,
) -> Pose | None:
    """Estimate the pose from cerebellum, brainstem and labelled sides; return None if
    too few of them are labelled.

    InputError if labels of left and right are mirrored, so that no rotation can correct
    them.
    """
    names = "cerebrum", "cerebellum", "brainstem", "left", "right"
    places = {
        name: np.argwhere(np.isin(labels, getattr(scheme, name))) for name in names
    }
    centres = {
        name: affine[:3, :3] @ voxels.mean(axis=0)
        for name, voxels in places.items()
        if len(voxels)
    }
    hindbrain = {
        name: centres[name] - centres["cerebrum"]
        for name in EXPECTED
        if name in centres
    }
    size = np.cbrt(
        np.isin(labels, scheme.cerebrum).sum() * abs(np.linalg.det(affine[:3, :3]))
    )
    for name, offset in hindbrain.items():
        if (share := np.linalg.norm(offset) / size) < MIN_HINDBRAIN_DISTANCE:
            raise InputError(
                f"with the scheme {scheme.name!r} the {name} lies inside the cerebrum",
                found=(
                    f"distance of the centres: {share:.2f} times the cerebrum's size"
                    " (cube root of its volume)"
                ),
                expected=f"{MIN_HINDBRAIN_DISTANCE} or more",
            )
    sides = (
        unit(centres["right"] - centres["left"])
        if {"left", "right"} <= set(centres)
        else None
    )
    rotation = _rotation_from_hindbrain(hindbrain)
    if sides is not None and hindbrain:
        rotation = _rotation_from_sides(hindbrain, sides, rotation)
    if rotation is None:
        return None
    by = " and ".join(
        [*hindbrain, *(["the labelled sides"] if sides is not None else [])]
    )
    return _pose_from_rotation(rotation, by, sides is not None)


def _pose_from_rotation(
    rotation: Floats,
    evidence: str,
    has_sides: bool,
) -> Pose:
    """Return the pose of a volume that an estimated (3, 3) rotation about its origin
    would bring to RAS+.

    Rotations of 60° and more are applied, as quarter turns if these are close. Smaller
    ones only give a warning, from 15° on. `evidence` names what the estimate rests on;
    `has_sides` is whether left and right are labelled.
    """
    quarters = _nearest_quarters(rotation)
    if angle_deg(rotation @ quarters.T) < QUARTERS_DEG:
        rotation = quarters
    angle = angle_deg(rotation)
    if angle >= MIN_TURN_DEG:
        warning = (
            f"the brain was rotated by {angle:.0f}° according to {evidence}: its affine"
            " has other axes"
        )
        warning = warning if has_sides else f"{warning}; {MIRROR_WARNING}"
        return turned(rotation, evidence.removeprefix("the "), "ras", warning)
    doubt = (
        f"according to {evidence} the brain is rotated by about {angle:.0f}°:"
        f" {PITCH_KEPT}"
    )
    return Pose(warnings=(doubt,) if angle > DOUBTFUL_TURN_DEG else ())


def _rotation_from_hindbrain(hindbrain: dict[str, Floats]) -> Floats | None:
    """Return the (3, 3) rotation of the offsets of cerebellum and brainstem onto
    `EXPECTED`, whose order they have; None if they do not determine it."""
    if len(hindbrain) < 2:
        return None
    found = [unit(offset) for offset in hindbrain.values()]
    expected = list(EXPECTED.values())
    # both lie in the mid-sagittal plane, so the cross product points to the right
    to_right = np.cross(found[0], found[1])
    # the rotation about a common direction is unknown
    if np.linalg.norm(to_right) < MIN_SPREAD:
        return None
    below = unit(found[0] + found[1])
    expected_below = unit(expected[0] + expected[1])
    expected_right = unit(
        np.cross(
            expected[0],
            expected[1],
        )
    )
    return _rotation_onto([(unit(to_right), expected_right), (below, expected_below)])


def _rotation_from_sides(
    hindbrain: dict[str, Floats],
    sides: Floats,
    rotation: Floats | None,
) -> Floats:
    """Estimate the (3, 3) rotation to RAS+ from labelled sides and hindbrain;
    InputError if they are mirrored."""
    below = [(unit(offset), EXPECTED[name]) for name, offset in hindbrain.items()]
    turn, mirrored = (
        _rotation_onto([(to_right, TO_RIGHT), *below]) for to_right in (sides, -sides)
    )
    if _is_mirrored(turn, mirrored) if rotation is None else (rotation @ sides)[0] < 0:
        raise InputError(
            "labels of the left hemisphere lie on the right",
            found=(
                f"the sides are the wrong way round with {' and '.join(hindbrain)}"
                " below and behind"
            ),
            expected="left at the smaller x (RAS+)",
            remedy=(
                "The volume's affine mirrors the brain, or the scheme's sides are"
                " swapped."
            ),
        )
    return turn


def _rotation_onto(pairs: list[tuple[Floats, Floats]]) -> Floats:
    """Return the (3, 3) rotation that brings directions nearest to expected ones, given
    in pairs."""
    found, expected = zip(*pairs, strict=True)
    rotation, _ = Rotation.align_vectors(expected, found)
    return np.asarray(rotation.as_matrix())


def _is_mirrored(turn: Floats, mirrored: Floats) -> bool:
    """Return whether exchanged sides explain a volume better than a rotation.

    Mirrored sides and one more direction fit an oblique half turn, and exchanged an
    upright brain; wrong axis codes give quarter turns, most often from LPS.
    """
    if angle_deg(turn) < MIN_TURN_DEG:
        return False
    off_lps, off_quarters = (
        angle_deg(turn @ axes.T)
        for axes in (CONVENTIONS["lps"][:3, :3], _nearest_quarters(turn))
    )
    return angle_deg(mirrored) < min(
        MIN_TURN_DEG, off_lps, max(DOUBTFUL_TURN_DEG, off_quarters)
    )


def _nearest_quarters(rotation: Floats) -> Floats:
    return np.asarray(
        min(
            CUBE_ROTATIONS,
            key=lambda turn: angle_deg(rotation @ turn.T),
        ).round()
    )
