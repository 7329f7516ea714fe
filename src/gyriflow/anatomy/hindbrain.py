"""The pose of a label volume, judged by its cerebellum, its brainstem and its labelled sides."""

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
# how far they are at least, in cube roots of its volume: 0.37 and more in weeks 21 to 36
LEAST_OUTSIDE = 0.25
# left and right of the labels weigh as much as the hindbrain does
TO_RIGHT = np.array([1.0, 0.0, 0.0])
# brains turned by less stand as their files say: this is how far atlases and scans differ
LEAST_TURN_DEG = 60.0
# brains turned by more, up to that, are kept with a warning: atlases and scans rarely differ as much
DOUBTFUL_TURN_DEG = 15.0
PITCH_KEPT = "its mid-plane is set upright, its pitch is kept; check the file's axes"
# warned of volumes without labelled sides, which tell a turned brain from a mirrored one
OR_MIRRORED = "if its array has an axis reversed or two exchanged instead, left and right are exchanged now: check them"
# two directions nearer to each other than this (in radians) say nothing of the turn about them
LEAST_SPREAD = 0.06
# a brain that is turned is turned by quarters, as wrong axis codes do, where these are as near as this
QUARTERS_DEG = 15.0


def pose_of_labels(labels: NDArray[np.integer], affine: Floats, scheme: LabelScheme) -> Pose | None:
    """Return the pose from cerebellum, brainstem and labelled sides; None where too few of them are labelled.

    It is the file's where the two differ by less than 60°, with a warning from 15° on. InputError where the labels of
    left and right are mirrored: no rotation brings them to their sides.
    """
    centres = {
        name: affine[:3, :3] @ np.argwhere(np.isin(labels, numbers)).mean(axis=0)
        for name, numbers in (
            ("cerebrum", scheme.cerebrum),
            ("cerebellum", scheme.cerebellum),
            ("brainstem", scheme.brainstem),
            ("left", scheme.left),
            ("right", scheme.right),
        )
        if np.isin(labels, numbers).any()
    }
    hindbrain = {name: centres[name] - centres["cerebrum"] for name in EXPECTED if name in centres}
    size = np.cbrt(np.isin(labels, scheme.cerebrum).sum() * abs(np.linalg.det(affine[:3, :3])))
    for name, way in hindbrain.items():
        if (share := np.linalg.norm(way) / size) < LEAST_OUTSIDE:
            raise InputError(
                f"what the scheme {scheme.name!r} calls the {name} lies inside what it calls the cerebrum",
                found=f"its centre {share:.2f} of the cerebrum's size (the cube root of its volume) from the middle",
                expected=f"{LEAST_OUTSIDE} or more",
            )
    sides = unit(centres["right"] - centres["left"]) if {"left", "right"} <= set(centres) else None
    rotation = _turn_of_hindbrain(hindbrain)
    if sides is not None and hindbrain:
        rotation = _turn_of_sides(hindbrain, sides, rotation)
    if rotation is None:
        return None
    by = " and ".join([*hindbrain, *(["the labelled sides"] if sides is not None else [])])
    return judged_turn(rotation, by, sides is not None)


def judged_turn(rotation: Floats, witness: str, sided: bool) -> Pose:
    """Return the pose of a volume that seems to need a (3, 3) rotation about its origin to lie in RAS+.

    Turns of 60° and more are made, by quarters where these are near; smaller ones are only warned of from 15° on.
    `witness` says so in warnings and in the pose; `sided` is whether labels say which side is which.
    """
    quarters = _nearest_quarters(rotation)
    if angle_deg(rotation @ quarters.T) < QUARTERS_DEG:
        rotation = quarters
    angle = angle_deg(rotation)
    say = "says" if witness.startswith("the shape") else "say"
    if angle >= LEAST_TURN_DEG:
        what = witness.replace("the shape", "its shape")
        warning = f"the brain was turned by {angle:.0f}°, as {what} {say}: its affine has other axes"
        return turned(rotation, witness.removeprefix("the "), "ras", warning if sided else f"{warning}; {OR_MIRRORED}")
    doubt = f"{witness} {say} that the brain is turned by about {angle:.0f}°: {PITCH_KEPT}"
    return Pose(warnings=(doubt,) if angle > DOUBTFUL_TURN_DEG else ())


def _turn_of_hindbrain(hindbrain: dict[str, Floats]) -> Floats | None:
    if len(hindbrain) < 2:
        return None
    theirs, ours = (
        (np.cross(*pair), unit(pair[0] + pair[1]))
        for pair in ([unit(v) for v in hindbrain.values()], [*EXPECTED.values()])
    )
    # the brainstem is in front of the cerebellum, so that the cross product points to the right; where both lie in
    # one direction, they say nothing of the turn about it
    if np.linalg.norm(theirs[0]) < LEAST_SPREAD:
        return None
    return _turn_onto([(unit(theirs[0]), unit(ours[0])), (theirs[1], ours[1])])


def _turn_of_sides(hindbrain: dict[str, Floats], sides: Floats, rotation: Floats | None) -> Floats:
    """Return the rotation (3, 3) to RAS+ that labelled sides and the hindbrain show together.

    InputError where they fit mirrored only: against the `rotation` that the hindbrain shows, or by themselves.
    """
    below = [(unit(way), EXPECTED[name]) for name, way in hindbrain.items()]
    turn, mirrored = (_turn_onto([(one, TO_RIGHT), *below]) for one in (sides, -sides))
    if _is_mirrored(turn, mirrored) if rotation is None else (rotation @ sides)[0] < 0:
        raise InputError(
            "labels of the left hemisphere lie on the right",
            found=f"the sides are the wrong way round with {' and '.join(hindbrain)} below and behind",
            expected="left at the smaller x (RAS+)",
            remedy="The volume's affine mirrors the brain, or the scheme's sides are swapped.",
        )
    return turn


def _turn_onto(pairs: list[tuple[Floats, Floats]]) -> Floats:
    ours, theirs = zip(*pairs, strict=True)
    return np.asarray(Rotation.align_vectors(theirs, ours)[0].as_matrix())


def _is_mirrored(turn: Floats, mirrored: Floats) -> bool:
    """Return whether exchanged sides explain a volume better than a turn does.

    Sides and one more direction fit some rotation, `turn`, even where they are mirrored: a half turn about an oblique
    axis. With the sides exchanged they fit `mirrored`, which is then as small as the brain's tilt. Wrong axis codes
    turn by quarters instead, most often from LPS; else sides of a brain that is upright are taken to be exchanged.
    """
    if angle_deg(turn) < LEAST_TURN_DEG:
        return False
    off_lps, off_quarters = (angle_deg(turn @ axes.T) for axes in (CONVENTIONS["lps"][:3, :3], _nearest_quarters(turn)))
    return angle_deg(mirrored) < min(LEAST_TURN_DEG, off_lps, max(DOUBTFUL_TURN_DEG, off_quarters))


def _nearest_quarters(rotation: Floats) -> Floats:
    return np.asarray(min(CUBE_ROTATIONS, key=lambda turn: angle_deg(rotation @ turn.T)).round())
