"""How well hemispheres are posed: surfaces in known wrong poses against the truth, as one line of JSON.

FOLDER holds pairs of surfaces whose names differ by `left` and `right` only, and `truth.json`: for each file the rigid
motion `to_ras` (4, 4) back to RAS+ mm and whether it is `inside_out`. `repose.py` makes more such folders.
"""

import argparse
import json
import logging
import time
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from gyriflow.anatomy.pial import PialSurface, from_hemispheres
from gyriflow.anatomy.plausible import expected_volume_ml
from gyriflow.anatomy.repair import pieces
from gyriflow.errors import GyriflowError
from gyriflow.geometry.triangles import Floats, TriangleMesh, euler_number, is_closed, signed_volume
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import read_hemispheres, read_surface

Files = tuple[Path, Path]

SIDES = ("left", "right")
WEEKS = np.arange(18.0, 45.5, 0.5)
MAX_ASYMMETRY = 0.05


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    logging.disable(logging.WARNING)
    folder = parser.parse_args().folder
    truth = read_json(folder / "truth.json")
    began = time.perf_counter()
    surfaces, refused = {}, []
    for brain in pairs_of_files(folder):
        try:
            surfaces[brain] = posed(brain)
        except GyriflowError as error:
            refused.append(f"{brain[0].name}: {error}")
    seconds = time.perf_counter() - began
    result = {"n": 2 * len(surfaces)} | errors(surfaces, truth) | counts(surfaces, truth)
    print(json.dumps(result | {"seconds": round(seconds, 1), "refused": refused}))


def pairs_of_files(folder: Path) -> list[Files]:
    """Returns the files of each brain in a folder, the left hemisphere's first."""
    pairs = [(left, left.with_name(left.name.replace("left", "right"))) for left in sorted(folder.glob("*left*"))]
    return [(left, right) for left, right in pairs if right.exists()]


def posed(brain: Files) -> PialSurface:
    """Returns the pial surface of two files, coarse, as the workflow makes it."""
    left, right, declared = read_hemispheres(*brain)
    edge = max(1.2, abs(signed_volume(left)) ** (1 / 3) / 25)
    settings = {"week": _week(left), "edge_length_mm": edge, "max_asymmetry": MAX_ASYMMETRY}
    return from_hemispheres(left, right, coordinates="auto", declared=declared, **settings)


def errors(surfaces: dict[Files, PialSurface], truth: dict) -> dict[str, float]:
    """Returns the worst errors in degrees and mm.

    Pitch, about x, and tilt, about the other axes, are the parts of the angles. Those `of_study` are what is left once
    one rotation, the same for all, has been taken off: absolute pitch is a convention. Offset and gap are the places of
    left and right relative to each other: within the sagittal plane, and along x.
    """
    turns, away = [], []
    for brain, surface in surfaces.items():
        for path, side in zip(brain, SIDES, strict=True):
            true = np.array(truth[path.name]["to_ras"])
            centre = true[:3, :3] @ read_surface(path).vertices.mean(axis=0) + true[:3, 3]
            left = surface.pose.of_file(side) @ np.linalg.inv(true)
            turns.append(Rotation.from_matrix(left[:3, :3]))
            away.append(left[:3, :3] @ centre + left[:3, 3] - centre)
    vectors = np.degrees([turn.as_rotvec() for turn in turns])
    common = Rotation.concatenate(turns).mean()
    of_study = np.degrees([(turn * common.inv()).as_rotvec() for turn in turns])
    apart = np.diff(np.reshape(away, (-1, 2, 3)), axis=1)[:, 0]
    return {
        "worst_pitch_deg": _worst(np.abs(vectors[:, 0])),
        "worst_tilt_deg": _worst(np.linalg.norm(vectors[:, 1:], axis=1)),
        "worst_pitch_of_study_deg": _worst(np.abs(of_study[:, 0])),
        "worst_tilt_of_study_deg": _worst(np.linalg.norm(of_study[:, 1:], axis=1)),
        "worst_offset_mm": _worst(np.linalg.norm(apart[:, 1:], axis=1)),
        "worst_gap_mm": _worst(np.abs(apart[:, 0])),
    }


def counts(surfaces: dict[Files, PialSurface], truth: dict) -> dict[str, int]:
    """Returns how many files were recognised as inside out or not, and how many brains are two closed pieces."""
    right, closed = 0, 0
    for brain, surface in surfaces.items():
        closed += [is_closed(piece) and euler_number(piece) == 2 for piece in pieces(surface.whole)] == [True, True]
        for side, path in zip(SIDES, brain, strict=True):
            turned = surface.report[f"repair_{side}"]["pieces_turned_outward"] > 0
            right += signed_volume(getattr(surface, side)) > 0 and turned == truth[path.name]["inside_out"]
    return {"inside_out_right": right, "merged_closed": closed}


def _week(left: TriangleMesh) -> float:
    """Returns the week whose brains are nearest in size."""
    volume = 2e-3 * abs(signed_volume(left))
    return float(min(WEEKS, key=lambda week: abs(np.log(expected_volume_ml(week) / volume))))


def _worst(values: Floats) -> float:
    return round(float(np.max(values)), 3)


if __name__ == "__main__":
    main()
