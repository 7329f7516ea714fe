"""Pose of a label volume, estimated from its cerebellum, brainstem and labelled sides."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.alignment import CUBE_ROTATIONS, angle_deg
from ..geometry.poses import CONVENTIONS, Pose, turned
from ..geometry.triangles import Floats, unit
from ..settings.schemes import LabelScheme

# from the cerebrum's centre to those of cerebellum and brainstem, RAS+: means over weeks 21 to 34 of the example atlas
EXPECTED = {"cerebellum": np.array([0.0, -0.58, -0.81]), "brainstem": np.array([0.0, -0.30, -0.95])}
# minimum of these distances, in cube roots of the cerebrum's volume; 0.37 or more in weeks 21 to 36
MIN_HINDBRAIN_DISTANCE = 0.25
# labelled sides weigh as much as the hindbrain
TO_RIGHT = np.array([1.0, 0.0, 0.0])
# smaller rotations are left as in the file: atlases and scans differ by as much
MIN_TURN_DEG = 60.0
# rotations between this and MIN_TURN_DEG are left with a warning
DOUBTFUL_TURN_DEG = 15.0
PITCH_KEPT = "its mid-plane is set upright, its pitch is kept; check the file's axes"
# without labelled sides a rotated brain cannot be distinguished from a mirrored one
MIRROR_WARNING = (
    "if an axis of its array is reversed instead, or two are exchanged, left and right are wrong now: check them"
)
# two directions closer than this (radians) do not determine the rotation about them
MIN_SPREAD = 0.06
# a rotation this close to quarter turns is taken for quarter turns, as caused by wrong axis codes
QUARTERS_DEG = 15.0


def pose_of_labels(labels: NDArray[np.integer], affine: Floats, scheme: LabelScheme) -> Pose | None:
    """Estimate the pose from cerebellum, brainstem and labelled sides; return None if too few of them are labelled.

    InputError if labels of left and right are mirrored, so that no rotation can correct them.
    """
    names = "cerebrum", "cerebellum", "brainstem", "left", "right"
    places = {name: np.argwhere(np.isin(labels, getattr(scheme, name))) for name in names}
    centres = {name: affine[:3, :3] @ voxels.mean(axis=0) for name, voxels in places.items() if len(voxels)}
    hindbrain = {name: centres[name] - centres["cerebrum"] for name in EXPECTED if name in centres}
    size = np.cbrt(np.isin(labels, scheme.cerebrum).sum() * abs(np.linalg.det(affine[:3, :3])))
    for name, offset in hindbrain.items():
        if (share := np.linalg.norm(offset) / size) < MIN_HINDBRAIN_DISTANCE:
            raise InputError(
                f"with the scheme {scheme.name!r} the {name} lies inside the cerebrum",
                found=f"distance of the centres: {share:.2f} times the cerebrum's size (cube root of its volume)",
                expected=f"{MIN_HINDBRAIN_DISTANCE} or more",
            )
    sides = unit(centres["right"] - centres["left"]) if {"left", "right"} <= set(centres) else None
    rotation = _rotation_from_hindbrain(hindbrain)
    if sides is not None and hindbrain:
        rotation = _rotation_from_sides(hindbrain, sides, rotation)
    if rotation is None:
        return None
    by = " and ".join([*hindbrain, *(["the labelled sides"] if sides is not None else [])])
    return pose_from_rotation(rotation, by, sides is not None)


def pose_from_rotation(rotation: Floats, evidence: str, has_sides: bool) -> Pose:
    """Return the pose of a volume that an estimated (3, 3) rotation about its origin would bring to RAS+.

    Rotations of 60° and more are applied, as quarter turns if these are close. Smaller ones only give a warning, from
    15° on. `evidence` names what the estimate rests on; `has_sides` is whether left and right are labelled.
    """
    quarters = _nearest_quarters(rotation)
    if angle_deg(rotation @ quarters.T) < QUARTERS_DEG:
        rotation = quarters
    angle = angle_deg(rotation)
    if angle >= MIN_TURN_DEG:
        warning = f"the brain was rotated by {angle:.0f}° according to {evidence}: its affine has other axes"
        warning = warning if has_sides else f"{warning}; {MIRROR_WARNING}"
        return turned(rotation, evidence.removeprefix("the "), "ras", warning)
    doubt = f"according to {evidence} the brain is rotated by about {angle:.0f}°: {PITCH_KEPT}"
    return Pose(warnings=(doubt,) if angle > DOUBTFUL_TURN_DEG else ())


def _rotation_from_hindbrain(hindbrain: dict[str, Floats]) -> Floats | None:
    if len(hindbrain) < 2:
        return None
    theirs, ours = (
        (np.cross(*pair), unit(pair[0] + pair[1]))
        for pair in ([unit(v) for v in hindbrain.values()], [*EXPECTED.values()])
    )
    # the cross product points to the right. If both lie in the same direction, the rotation about it is unknown
    if np.linalg.norm(theirs[0]) < MIN_SPREAD:
        return None
    return _rotation_onto([(unit(theirs[0]), unit(ours[0])), (theirs[1], ours[1])])


def _rotation_from_sides(hindbrain: dict[str, Floats], sides: Floats, rotation: Floats | None) -> Floats:
    """Estimate the (3, 3) rotation to RAS+ from labelled sides and hindbrain; InputError if they are mirrored."""
    below = [(unit(offset), EXPECTED[name]) for name, offset in hindbrain.items()]
    turn, mirrored = (_rotation_onto([(to_right, TO_RIGHT), *below]) for to_right in (sides, -sides))
    if _is_mirrored(turn, mirrored) if rotation is None else (rotation @ sides)[0] < 0:
        raise InputError(
            "labels of the left hemisphere lie on the right",
            found=f"the sides are the wrong way round with {' and '.join(hindbrain)} below and behind",
            expected="left at the smaller x (RAS+)",
            remedy="The volume's affine mirrors the brain, or the scheme's sides are swapped.",
        )
    return turn


def _rotation_onto(pairs: list[tuple[Floats, Floats]]) -> Floats:
    ours, theirs = zip(*pairs, strict=True)
    return np.asarray(Rotation.align_vectors(theirs, ours)[0].as_matrix())


def _is_mirrored(turn: Floats, mirrored: Floats) -> bool:
    """Return whether exchanged sides explain a volume better than a rotation.

    Mirrored sides and one more direction fit an oblique half turn, and exchanged an upright brain; wrong axis codes
    give quarter turns, most often from LPS.
    """
    if angle_deg(turn) < MIN_TURN_DEG:
        return False
    off_lps, off_quarters = (angle_deg(turn @ axes.T) for axes in (CONVENTIONS["lps"][:3, :3], _nearest_quarters(turn)))
    return angle_deg(mirrored) < min(MIN_TURN_DEG, off_lps, max(DOUBTFUL_TURN_DEG, off_quarters))


def _nearest_quarters(rotation: Floats) -> Floats:
    return np.asarray(min(CUBE_ROTATIONS, key=lambda turn: angle_deg(rotation @ turn.T)).round())
