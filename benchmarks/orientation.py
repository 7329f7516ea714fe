"""Measure the errors of hemispheres' poses: surfaces in known wrong poses against the truth, as one line of JSON.

FOLDER contains pairs of surfaces whose names differ only in `left` and `right`, and `truth.json`: for each file the
rigid motion `to_ras` (4, 4) back to RAS+ mm and whether the surface is `inside_out`.

--move OUT writes such a folder instead, with hemispheres moved at random: PLY files, which do not define their
coordinates, every other one inside out, and their `truth.json`. FOLDER needs no `truth.json` if it is in RAS+ mm.
--asymmetry first deforms the right hemispheres smoothly and at random, without a rigid motion, so that the truth stays
the same.
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
from gyriflow.geometry.alignment import motion
from gyriflow.geometry.triangles import (
    Floats,
    TriangleMesh,
    euler_number,
    flipped,
    is_closed,
    signed_volume,
    transformed,
)
from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import read_hemispheres, read_surface, write_surface

Files = tuple[Path, Path]

SIDES = ("left", "right")
WEEKS = np.arange(18.0, 45.5, 0.5)
FAR_MM = 50.0
# deformations: stretch, number of waves, and their radians per cube root of the volume
STRETCH, WAVES, WAVE_NUMBER = 0.04, 60, 2.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--move", type=Path, metavar="OUT", help="write hemispheres moved at random to this folder")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--together", action="store_true", help="one motion for both hemispheres of a brain")
    parser.add_argument(
        "--asymmetry", type=float, default=0.0, metavar="MM", help="root mean square deformation of right hemispheres"
    )
    parser.add_argument("--scale", type=float, default=1.0, help="factor that scales the brains")
    arguments = parser.parse_args()
    folder = arguments.folder
    truth = read_json(folder / "truth.json") if (folder / "truth.json").exists() else {}
    if arguments.move:
        write_json(arguments.move / "truth.json", moved_at_random(arguments, truth))
        return
    logging.disable(logging.WARNING)
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
    """Return the files of each brain in a folder, the left hemisphere's first."""
    pairs = [(left, left.with_name(left.name.replace("left", "right"))) for left in sorted(folder.glob("*left*"))]
    return [(left, right) for left, right in pairs if right.exists()]


def posed(brain: Files) -> PialSurface:
    """Return the coarse pial surface of two files, made as in the workflow."""
    left, right, declared = read_hemispheres(*brain)
    edge = max(1.2, abs(signed_volume(left)) ** (1 / 3) / 25)
    settings = {"week": _week(left), "edge_length_mm": edge, "max_asymmetry": 0.05}
    return from_hemispheres(left, right, coordinates="auto", declared=declared, **settings)


def errors(surfaces: dict[Files, PialSurface], truth: dict) -> dict[str, float]:
    """Return the worst errors in degrees and mm.

    Pitch is the rotation about x, tilt that about the other axes. Values `of_study` are without the mean rotation of
    all brains, since absolute pitch is a convention. Offset and gap are the errors of the right hemisphere's position
    relative to the left: within the sagittal plane, and along x.
    """
    turns, shifts = [], []
    for brain, surface in surfaces.items():
        for path, side in zip(brain, SIDES, strict=True):
            true = np.array(truth[path.name]["to_ras"])
            centre = true[:3, :3] @ read_surface(path).vertices.mean(axis=0) + true[:3, 3]
            error = surface.pose.of_file(side) @ np.linalg.inv(true)
            turns.append(Rotation.from_matrix(error[:3, :3]))
            shifts.append(error[:3, :3] @ centre + error[:3, 3] - centre)
    vectors = np.degrees([turn.as_rotvec() for turn in turns])
    common = Rotation.concatenate(turns).mean()
    relative = np.degrees([(turn * common.inv()).as_rotvec() for turn in turns])
    between = np.diff(np.reshape(shifts, (-1, 2, 3)), axis=1)[:, 0]
    return {
        "worst_pitch_deg": _worst(np.abs(vectors[:, 0])),
        "worst_tilt_deg": _worst(np.linalg.norm(vectors[:, 1:], axis=1)),
        "worst_pitch_of_study_deg": _worst(np.abs(relative[:, 0])),
        "worst_tilt_of_study_deg": _worst(np.linalg.norm(relative[:, 1:], axis=1)),
        "worst_offset_mm": _worst(np.linalg.norm(between[:, 1:], axis=1)),
        "worst_gap_mm": _worst(np.abs(between[:, 0])),
    }


def counts(surfaces: dict[Files, PialSurface], truth: dict) -> dict[str, int]:
    """Count the files correctly recognised as inside out or not, and the brains that are two closed pieces."""
    correct, closed = 0, 0
    for brain, surface in surfaces.items():
        closed += [is_closed(piece) and euler_number(piece) == 2 for piece in pieces(surface.whole)] == [True, True]
        for side, path in zip(SIDES, brain, strict=True):
            turned = surface.report[f"repair_{side}"]["pieces_turned_outward"] > 0
            correct += signed_volume(getattr(surface, side)) > 0 and turned == truth[path.name]["inside_out"]
    return {"inside_out_correct": correct, "merged_closed": closed}


def _week(left: TriangleMesh) -> float:
    """Return the week whose expected brain volume is closest."""
    volume = 2e-3 * abs(signed_volume(left))
    return float(min(WEEKS, key=lambda week: abs(np.log(expected_volume_ml(week) / volume))))


def _worst(values: Floats) -> float:
    return round(float(np.max(values)), 3)


def moved_at_random(arguments: argparse.Namespace, poses: dict) -> dict[str, dict]:
    """Write moved hemispheres of a folder and return their truth; `poses` is the folder's own truth, or empty."""
    random, truth = np.random.default_rng(arguments.seed), {}
    for files in pairs_of_files(arguments.folder):
        shared = any_motion(random)
        for path, side in zip(files, SIDES, strict=True):
            mesh = transformed(read_surface(path), np.array(poses[path.name]["to_ras"]) if poses else np.eye(4))
            mesh = flipped(mesh) if signed_volume(mesh) < 0 else mesh
            mesh = TriangleMesh(arguments.scale * mesh.vertices, mesh.faces)
            if arguments.asymmetry and side == "right":
                mesh = deformed(mesh, arguments.asymmetry, random)
            moved = shared if arguments.together else any_motion(random)
            turned = len(truth) % 2 == 1
            mesh = transformed(mesh, moved)
            name = path.name.split(".surf")[0].removesuffix(path.suffix) + ".ply"
            write_surface(arguments.move / name, flipped(mesh) if turned else mesh)
            truth[name] = {"to_ras": np.linalg.inv(moved).tolist(), "inside_out": turned}
    return truth


def any_motion(random: np.random.Generator) -> np.ndarray:
    """Return a random (4, 4) rigid motion: any rotation and a shift of a few centimetres."""
    return motion(Rotation.random(random_state=random).as_matrix(), random.normal(0.0, FAR_MM, 3))


def deformed(mesh: TriangleMesh, rms_mm: float, random: np.random.Generator) -> TriangleMesh:
    """Return the surface stretched by up to 4 % along each axis and bent by random waves, without a rigid motion.

    `rms_mm` is the root mean square length of the waves' displacements. The volume is kept.
    """
    points = mesh.vertices
    centre, size = points.mean(axis=0), signed_volume(mesh) ** (1 / 3)
    waves = random.normal(0.0, WAVE_NUMBER / size, (WAVES, 3))
    phases = (points - centre) @ waves.T + random.uniform(0.0, 2 * np.pi, WAVES)
    bends = np.cos(phases) @ random.normal(0.0, 1.0, (WAVES, 3))
    bends -= bends.mean(axis=0)
    bends *= rms_mm / np.sqrt((bends**2).sum(axis=1).mean())
    bent = (points - centre) * (1.0 + random.uniform(-STRETCH, STRETCH, 3)) + bends
    bent -= bent.mean(axis=0)
    bent *= size / signed_volume(TriangleMesh(bent, mesh.faces)) ** (1 / 3)
    back, _ = Rotation.align_vectors(points - centre, bent)
    return TriangleMesh(back.apply(bent) + centre, mesh.faces)


if __name__ == "__main__":
    main()
