"""How well hemispheres are posed: surfaces in known wrong poses against the truth, as one line of JSON.

FOLDER holds pairs of surfaces whose names differ by `left` and `right` only, and `truth.json`: for each file the rigid
motion `to_ras` (4, 4) back to RAS+ mm and whether it is `inside_out`. `repose.py` makes more such folders.
"""

import argparse
import json
import logging
import re
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gyriflow.anatomy.pial import from_hemispheres
from gyriflow.anatomy.plausible import expected_volume_ml
from gyriflow.anatomy.pose import Pair, pairs_by_shape, poses
from gyriflow.anatomy.repair import pieces, sound_pieces
from gyriflow.errors import GyriflowError, InputError
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import TriangleMesh, euler_number, is_closed, signed_volume
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import read_hemispheres, read_surface

Floats = NDArray[np.float64]
Files = tuple[Path, Path]

SIDES = ("left", "right")
MAX_HOLE_MM = 3.0
WEEKS = np.arange(18.0, 45.5, 0.5)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    logging.disable(logging.WARNING)
    folder = parser.parse_args().folder
    truth = read_json(folder / "truth.json")
    began = time.perf_counter()
    found, refused = posed(pairs_of_files(folder))
    seconds = time.perf_counter() - began
    result = {"n": 2 * len(found)} | errors(found, truth)
    counts, failed = surfaces(found, truth)
    result, refused = result | counts, refused + failed
    print(json.dumps(result | {"seconds": round(seconds, 1), "refused": refused}))


def pairs_of_files(folder: Path) -> list[Files]:
    """Returns the files of each brain in a folder, the left hemisphere's first."""
    found = []
    for left in sorted(folder.iterdir()):
        right = left.with_name(re.sub(r"left", "right", left.name))
        if left.name != right.name and right.exists():
            found.append((left, right))
    return found


def posed(files: list[Files]) -> tuple[dict[Files, Pose], list[str]]:
    """Returns the poses of the brains, and what was refused."""
    brains: dict[Files, tuple[TriangleMesh, TriangleMesh]] = {}
    named: dict[Files, bool] = {}
    refused = []
    for brain in files:
        try:
            *read, named[brain] = read_hemispheres(*brain)
            left, right = (sound_pieces(side, MAX_HOLE_MM, one=True).mesh for side in read)
            brains[brain] = left, right
        except GyriflowError as error:
            refused.append(f"{brain[0].name}: {error}")
    # as the workflow does: a brain that is doubtful alone is posed like the others of the study
    found = dict(zip(brains, pairs_by_shape(list(brains.values())), strict=True))
    refused += [f"{brain[0].name}: {pair}" for brain, pair in found.items() if isinstance(pair, InputError)]
    pairs = {brain: pair for brain, pair in found.items() if isinstance(pair, Pair)}
    if not pairs:
        raise InputError("no pair of hemispheres could be posed", found="; ".join(refused) or "no pair of files")
    posed_as = poses(list(pairs.values()), [named[brain] for brain in pairs])
    return dict(zip(pairs, posed_as, strict=True)), refused


def errors(found: dict[Files, Pose], truth: dict) -> dict[str, float]:
    """Returns the worst errors once one rotation, the same for all, has been taken off.

    Pitch, about x, and tilt, about the other axes, are the parts of the angles. Offset and gap are the places of left
    and right relative to each other: within the sagittal plane, and along x.
    `worst_place_mm` is the place of a brain in the sagittal plane relative to the mean of all.
    """
    motions, centres = [], []
    for brain, pose in found.items():
        for path, motion in zip(brain, (pose.files[side] for side in SIDES), strict=True):
            true = np.array(truth[path.name]["to_ras"])
            motions.append(motion @ np.linalg.inv(true))
            centres.append(true[:3, :3] @ read_surface(path).vertices.mean(axis=0) + true[:3, 3])
    common = _common([motion[:3, :3] for motion in motions])
    off = [Rotation.from_matrix(motion[:3, :3]) * common.inv() for motion in motions]
    away = np.array([
        common.inv().apply(motion[:3, :3] @ centre + motion[:3, 3]) - centre
        for motion, centre in zip(motions, centres, strict=True)
    ])  # fmt: skip
    vectors = np.degrees([turn.as_rotvec() for turn in off])
    apart, places = away[1::2] - away[::2], 0.5 * (away[::2] + away[1::2])
    return {
        "worst_angle_deg": _worst(np.degrees([turn.magnitude() for turn in off])),
        "worst_pitch_deg": _worst(np.abs(vectors[:, 0])),
        "worst_tilt_deg": _worst(np.linalg.norm(vectors[:, 1:], axis=1)),
        "common_angle_deg": _worst(np.degrees([common.magnitude()])),
        "worst_offset_mm": _worst(np.linalg.norm(apart[:, 1:], axis=1)),
        "worst_gap_mm": _worst(np.abs(apart[:, 0])),
        "worst_place_mm": _worst(np.linalg.norm((places - places.mean(axis=0))[:, 1:], axis=1)),
    }


def surfaces(found: dict[Files, Pose], truth: dict) -> tuple[dict[str, int], list[str]]:
    """Returns how many files were recognised as inside out or not, how many brains closed, and what failed."""
    right, closed, failed = 0, 0, []
    for brain, pose in found.items():
        left, other = map(read_surface, brain)
        size = (abs(signed_volume(left))) ** (1 / 3)
        edge = max(1.2, size / 25)
        try:
            surface = from_hemispheres(left, other, pose, week=_week(left), coordinates="auto", edge_length_mm=edge)
        except GyriflowError as error:
            failed.append(f"{brain[0].name}: {error}")
            continue
        sound = [is_closed(piece) and euler_number(piece) == 2 for piece in pieces(surface.whole)]
        closed += sound == [True, True]
        for side, path in zip(SIDES, brain, strict=True):
            turned = surface.report[f"repair_{side}"]["pieces_turned_outward"] > 0
            outward = signed_volume(getattr(surface, side)) > 0
            right += outward and turned == truth[path.name]["inside_out"]
    return {"inside_out_right": right, "merged_closed": closed}, failed


def _common(rotations: list[Floats]) -> Rotation:
    """Returns the rotation from which the furthest of others is nearest, by weights moved to the furthest ones."""
    every, weights = Rotation.from_matrix(rotations), np.ones(len(rotations))
    best, least = every.mean(), np.inf
    for _ in range(300):
        mean = every.mean(weights=weights)
        angles = (every * mean.inv()).magnitude()
        if angles.max() < least:
            best, least = mean, angles.max()
        weights = weights * (1e-9 + angles / max(angles.max(), 1e-9)) ** 0.5 + 1e-6
        weights /= weights.sum()
    return best


def _week(left: TriangleMesh) -> float:
    """Returns the week whose brains are nearest in size."""
    volume = 2e-3 * abs(signed_volume(left))
    return float(min(WEEKS, key=lambda week: abs(np.log(expected_volume_ml(week) / volume))))


def _worst(values: Floats) -> float:
    return round(float(np.max(values)), 3)


if __name__ == "__main__":
    main()
