"""Poses of hemispheres in any rigid pose: from their files where these are well posed, else from their shapes."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.alignment import angle_deg
from ..geometry.triangles import TriangleMesh
from .hemisphere_pose import CONVENTIONS, MIRROR, SYLVIAN_AHEAD, Pair, about_x, pair_by_shape, pitch_deg
from .limits import USUAL, Limits
from .outline_fit import Target, register

Floats = NDArray[np.float64]

# how well the shape has to agree with axes for the file to be in them: tilts (of the wall), and pitch, in degrees;
# the first is per residual of the hemispheres' fit, as the shape of an asymmetric brain says less
EXACT_DEG_PER_RESIDUAL, DECLARED_DEG, SAME_PITCH_DEG = 70.0, 10.0, 15.0
# files of one brain share their coordinates where their poses differ by less; distances are relative to the size
COMMON_DEG_PER_RESIDUAL, COMMON_OFFSET, COMMON_DISTANCE = 180.0, 0.08, 0.15
# hemispheres of one declared coordinate system stay as they are in it, if they are turned by less than this
DECLARED_TURN_DEG = 30.0
# the medial walls' distance from the mid-sagittal plane where the files do not say it
BESIDE_MM = 0.5
# how many smaller and larger brains each brain is registered with
NEIGHBOURS = 4
# the pitch is known to a degree or two
PITCH_STEP_DEG = 0.5
# decimals of what is reported: a rounded rotation moves no place of a brain by a micrometre
DIGITS = 6


@dataclass(frozen=True, eq=False)
class Poses:
    """Rigid motions (4, 4) from the coordinates of the files of a brain to RAS+ mm, and how they were found."""

    left: Floats
    right: Floats
    report: dict[str, Any]


def pairs_by_shape(
    brains: Sequence[tuple[TriangleMesh, TriangleMesh]], limits: Limits = USUAL
) -> list[Pair | InputError]:
    """Returns what `pair_by_shape` says of each brain of a study, or why it is refused.

    Those that are doubtful alone are posed like the others, once the poses of these are known.
    """
    found: list[Pair | InputError] = []
    for others in ((), None):
        known = [pair for pair in found if isinstance(pair, Pair)] if others is None else ()
        for number, (left, right) in enumerate(brains):
            if others is None and (not known or isinstance(found[number], Pair)):
                continue
            try:
                pair: Pair | InputError = pair_by_shape(left, right, limits, known)
            except InputError as error:
                pair = error
            found[number:] = [pair, *found[number + 1 :]]
    return found


def poses(pairs: Sequence[Pair], declared: Sequence[bool]) -> list[Poses]:
    """Returns the poses of the brains of one study, given what `pair_by_shape` says of each.

    Shape gives each hemisphere's pose except for the pitch, in which brains of different age differ: for the pitch they
    are registered with each other. Where hemispheres share coordinates of which one axis is exactly left-right, and
    shape says that these are RAS or LPS, they keep the file's pose, and the other brains follow them; else the
    reference shape's pitch is zero. The mid-sagittal plane is x = 0. For brains where `declared` holds, whose files
    name their coordinate system, the axis need not be exact.
    """
    frames = [_frame(pair, named) for pair, named in zip(pairs, declared, strict=True)]
    pitches, places = _pitches(pairs, frames), _places(pairs, frames)
    return [_make_poses(*brain) for brain in zip(pairs, frames, declared, pitches, places, strict=True)]


def as_poses(report: dict[str, Any]) -> Poses:
    """Returns the poses that a report of them holds; InputError where it is a refusal, for its reason."""
    if "refused" in report:
        raise InputError(report["refused"])
    matrices = report["matrices"]
    return Poses(np.array(matrices["left"]), np.array(matrices["right"]), report)


def report_placement(poses: Poses, turn: Floats, moved: Floats) -> dict[str, Any]:
    """Returns the report with the whole motions: the pose, then left by −`moved` and right by +`moved`, then `turn`."""
    matrices = {}
    for side, motion, sign in (("left", poses.left, -1.0), ("right", poses.right, 1.0)):
        shift = np.eye(4)
        shift[:3, 3] = sign * moved
        matrices[side] = (turn @ shift @ motion).tolist()
    return poses.report | {"matrices": matrices}


def _make_poses(pair: Pair, frame: str | None, declared: bool, pitch: float, place: Floats) -> Poses:
    both = {"left": pair.left, "right": pair.right}
    report: dict[str, Any] = {
        "method": "file" if frame else "shape",
        "coordinates": frame,
        "pitch_deg": pitch,
        "residual": {side: round(hemisphere.residual, DIGITS) for side, hemisphere in both.items()},
        "confidence": {side: round(hemisphere.confidence, DIGITS) for side, hemisphere in both.items()},
        "mirror_residual": round(pair.fit.residual, DIGITS),
        "sylvian_ahead": {side: round(hemisphere.sylvian, DIGITS) for side, hemisphere in both.items()},
        "warnings": [],
    }
    if np.mean(list(report["sylvian_ahead"].values())) < SYLVIAN_AHEAD:
        report["warnings"].append(
            "left and right are taken from the configuration: the shapes do not show whether the files are swapped"
        )
    if frame:
        motion = np.eye(4)
        motion[:3, :3] = CONVENTIONS[frame]
        left = right = motion
    else:
        left, right = _separate(pair, pitch, place)
        if _share_coordinates(pair, declared):
            left = right = _mean_motion(left, right, pair)
    report["together"] = left is right
    # a pose that is the same but for round-off is the same file
    left, right = left.round(DIGITS), right.round(DIGITS)
    report["matrices"] = {"left": left.tolist(), "right": right.tolist()}
    return Poses(left, right, report)


def _separate(pair: Pair, pitch: float, place: Floats) -> tuple[Floats, Floats]:
    """Returns the motions that put the medial walls beside x = 0 and the centres around `place` (y and z)."""
    motions = []
    for hemisphere, sign in ((pair.left, 0.5), (pair.right, -0.5)):
        motion = np.eye(4)
        motion[:3, :3] = about_x(pitch) @ hemisphere.rotation
        target = np.zeros(3)
        target[1:] = place + sign * (about_x(pitch) @ pair.offset_mm)[1:]
        target[0] = BESIDE_MM - hemisphere.wall_mm
        motion[:3, 3] = target - motion[:3, :3] @ hemisphere.outline.centre
        motions.append(motion)
    return MIRROR @ motions[0] @ MIRROR, motions[1]


def _share_coordinates(pair: Pair, declared: bool) -> bool:
    """Returns whether the files have both hemispheres where one rigid motion brings them to a brain.

    Files that name one coordinate system do, unless the shapes are turned against each other beyond doubt.
    """
    left, right = _separate(pair, 0.0, np.zeros(2))
    if declared and angle_deg(right[:3, :3].T @ left[:3, :3]) < DECLARED_TURN_DEG:
        return True
    if angle_deg(right[:3, :3].T @ left[:3, :3]) > COMMON_DEG_PER_RESIDUAL * pair.fit.residual:
        return False
    centre = MIRROR[:3, :3] @ pair.left.outline.centre
    away = np.abs((right - left)[:3, :3] @ centre + (right - left)[:3, 3]) / pair.right.outline.size_mm
    return bool(away[0] < COMMON_DISTANCE and np.linalg.norm(away[1:]) < COMMON_OFFSET)


def _mean_motion(left: Floats, right: Floats, pair: Pair) -> Floats:
    """Returns one motion half-way between two, measured at the brain's centre."""
    centre = 0.5 * (MIRROR[:3, :3] @ pair.left.outline.centre + pair.right.outline.centre)
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_matrix([left[:3, :3], right[:3, :3]]).mean().as_matrix()
    there = 0.5 * sum(side[:3, :3] @ centre + side[:3, 3] for side in (left, right))
    motion[:3, 3] = there - motion[:3, :3] @ centre
    return motion


def _frame(pair: Pair, declared: bool) -> str | None:
    """Returns "ras" or "lps" where both files are in these coordinates, to the accuracy of the shape, else None."""
    if not _share_coordinates(pair, declared):
        return None
    for name, axes in CONVENTIONS.items():
        turns = [hemisphere.rotation @ axes.T for hemisphere in (pair.left, pair.right)]
        # mirrored files have the same axes up to signs, which cancel
        tilts = [np.degrees(np.arccos(np.clip(turn[0, 0], -1.0, 1.0))) for turn in turns]
        most = max(DECLARED_DEG if declared else 0.0, EXACT_DEG_PER_RESIDUAL * pair.fit.residual)
        if np.mean(tilts) < most and max(abs(pitch_deg(turn)) for turn in turns) < SAME_PITCH_DEG:
            return name
    return None


def _pitches(pairs: Sequence[Pair], frames: list[str | None]) -> list[float]:
    """Returns the pitch of each brain in degrees, beyond its shape's.

    Brains next to each other in size are registered, and least squares make of this one pitch for each. Where files
    say the pitch of some brains, the difference is interpolated over the logarithm of size: brains change as they grow.
    It is rounded, so that a brain hardly ever moves where another one of the study is changed or added.
    """
    if not pairs:
        return []
    sizes = np.log([_size(pair) for pair in pairs])
    rank = np.argsort(np.argsort(sizes))
    rows, values = [], []
    unit_rows = np.eye(len(pairs))
    for i, j in combinations(range(len(pairs)), 2):
        if abs(rank[i] - rank[j]) <= NEIGHBOURS:
            turn, weight = _register_pair(pairs[i], pairs[j])
            rows.append(weight * (unit_rows[i] - unit_rows[j]))
            values.append(weight * turn)
    for row, pair in zip(unit_rows, pairs, strict=True):
        rows.append(row / np.mean([pair.left.residual, pair.right.residual]) ** 2)
        values.append(0.0)
    solution = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0]
    known = [
        (size, _pitch_in_file(pair, frame) - found)
        for size, pair, frame, found in zip(sizes, pairs, frames, solution, strict=True)
        if frame
    ]
    if known:
        at, differences = np.array(sorted(known)).T
        solution = solution + np.interp(sizes, at, differences)
    return [PITCH_STEP_DEG * round(float(value) / PITCH_STEP_DEG) for value in solution]


def _pitch_in_file(pair: Pair, frame: str) -> float:
    return float(
        np.mean([pitch_deg(CONVENTIONS[frame] @ hemisphere.rotation.T) for hemisphere in (pair.left, pair.right)])
    )


def _register_pair(one: Pair, other: Pair) -> tuple[float, float]:
    """Returns the pitch of one brain beyond the other's with which they lie alike, and the result's weight."""
    turns, residuals = [], []
    for a, b in ((one.left, other.left), (one.right, other.right)):
        fit = register(a.outline, Target(b.outline), b.rotation.T @ a.rotation)
        turns.append(pitch_deg(b.rotation @ fit.rotation @ a.rotation.T))
        residuals.append(fit.residual)
    return float(np.mean(turns)), float(np.mean(residuals)) ** -2


def _places(pairs: Sequence[Pair], frames: list[str | None]) -> list[Floats]:
    """Returns where the centres of the brains come to lie in the sagittal plane; (2,) in mm.

    In proportion to size as far from the origin as in the brains that are posed by their files; else at the origin.
    """
    known = [
        [_size(pair), *(_centre(pair, frame) / _size(pair))] for pair, frame in zip(pairs, frames, strict=True) if frame
    ]
    if not known:
        return [np.zeros(2) for _ in pairs]
    sizes, *centres = np.array(sorted(known)).T
    return [_size(pair) * np.array([np.interp(_size(pair), sizes, values) for values in centres]) for pair in pairs]


def _centre(pair: Pair, frame: str) -> Floats:
    """Returns y and z of a brain's centre in RAS+, of files in these axes."""
    centres = [CONVENTIONS[frame] @ hemisphere.outline.centre for hemisphere in (pair.left, pair.right)]
    return np.asarray(np.mean(centres, axis=0)[1:])


def _size(pair: Pair) -> float:
    return float(np.mean([hemisphere.outline.size_mm for hemisphere in (pair.left, pair.right)]))
