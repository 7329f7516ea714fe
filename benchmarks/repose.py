"""Folders for orientation.py: hemispheres whose true pose is known, moved at random, with the motions back.

FOLDER holds pairs of surfaces as orientation.py takes them, in RAS+ mm or with a `truth.json`. OUT gets them as PLY
files, which say nothing of their coordinates, every other one inside out, and a `truth.json`. With --asymmetry the
right hemispheres are deformed first, smoothly and at random; what of this is a rigid motion is taken off again, so that
the truth remains one.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from orientation import pairs_of_files
from scipy.spatial.transform import Rotation

from gyriflow.geometry.triangles import TriangleMesh, flipped, signed_volume, transformed
from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import read_surface, write_surface

FAR_MM = 50.0
# of deformations: the stretch, and how many waves there are, of how many radians per cube root of the volume
STRETCH, WAVES, WAVE_NUMBER = 0.04, 60, 2.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--together", action="store_true", help="one motion for both hemispheres of a brain")
    parser.add_argument("--asymmetry", type=float, default=0.0, metavar="MM", help="root mean square deformation")
    parser.add_argument("--scale", type=float, default=1.0, help="size of the brains, in their own")
    args = parser.parse_args()
    random = np.random.default_rng(args.seed)
    known = read_json(args.folder / "truth.json") if (args.folder / "truth.json").exists() else {}
    truth = {}
    for files in pairs_of_files(args.folder):
        shared = motion(random)
        for path, side in zip(files, ("left", "right"), strict=True):
            mesh = transformed(read_surface(path), np.array(known[path.name]["to_ras"]) if known else np.eye(4))
            mesh = flipped(mesh) if signed_volume(mesh) < 0 else mesh
            mesh = TriangleMesh(args.scale * mesh.vertices, mesh.faces)
            if args.asymmetry and side == "right":
                mesh = deformed(mesh, args.asymmetry, random)
            moved = shared if args.together else motion(random)
            turned = len(truth) % 2 == 1
            mesh = transformed(mesh, moved)
            name = path.name.split(".surf")[0].removesuffix(path.suffix) + ".ply"
            write_surface(args.out / name, flipped(mesh) if turned else mesh)
            truth[name] = {"to_ras": np.linalg.inv(moved).tolist(), "inside_out": turned}
    write_json(args.out / "truth.json", truth)
    print(json.dumps({"n": len(truth), "folder": str(args.out)}))


def motion(random: np.random.Generator) -> np.ndarray:
    """Returns a random rigid motion, (4, 4): any rotation, and a shift of a few centimetres."""
    result = np.eye(4)
    result[:3, :3] = Rotation.random(random_state=random).as_matrix()
    result[:3, 3] = random.normal(0.0, FAR_MM, 3)
    return result


def deformed(mesh: TriangleMesh, rms_mm: float, random: np.random.Generator) -> TriangleMesh:
    """Returns the surface stretched by up to 4 % along each axis and bent by random waves, without a rigid motion.

    `rms_mm` is the root mean square length of the waves' displacements. The volume is kept.
    """
    points = mesh.vertices
    centre, size = points.mean(axis=0), signed_volume(mesh) ** (1 / 3)
    waves = random.normal(0.0, WAVE_NUMBER / size, (WAVES, 3))
    phases = (points - centre) @ waves.T + random.uniform(0.0, 2 * np.pi, WAVES)
    bends = np.cos(phases) @ random.normal(0.0, 1.0, (WAVES, 3))
    bends -= bends.mean(axis=0)
    bends *= rms_mm / np.sqrt((bends**2).sum(axis=1).mean())
    there = (points - centre) * (1.0 + random.uniform(-STRETCH, STRETCH, 3)) + bends
    there -= there.mean(axis=0)
    there *= size / signed_volume(TriangleMesh(there, mesh.faces)) ** (1 / 3)
    back, _ = Rotation.align_vectors(points - centre, there)
    return TriangleMesh(back.apply(there) + centre, mesh.faces)


if __name__ == "__main__":
    main()
