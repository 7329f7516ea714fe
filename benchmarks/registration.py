"""Registration of an atlas week to week: overlap, folding, time.

    ./run python benchmarks/registration.py ATLAS_FOLDER --out deformations

ATLAS_FOLDER holds `week21_labels.nii.gz`, `week21_t2w.nii.gz` and so on; the weeks after `week25_operated` are of
operated fetuses, and the two populations are not registered with each other. The deformations are kept in `--out` and
used again; a row per pair is printed. The last line is one JSON object.
"""

import argparse
import json
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from gyriflow.errors import InputError
from gyriflow.geometry.alignment import without_rigid_motion
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.tetrahedra import TetrahedralMesh, connected_parts, grid, volumes_between
from gyriflow.growth.carrying import carry_over_weeks
from gyriflow.growth.channels import Channels, channels
from gyriflow.growth.diffeomorphic import register
from gyriflow.growth.registration_quality import judge, require_good
from gyriflow.io.registrations import read_deformation, write_deformation
from gyriflow.io.schemes import SCHEMES
from gyriflow.io.volumes import read_label_volume, read_values

POPULATIONS = {
    "unoperated": {week: f"week{week}" for week in range(21, 26)},
    "operated": {25: "week25_operated"} | {week: f"week{week}" for week in range(26, 35)},
}
SCHEME = SCHEMES["spina-bifida-atlas"]
TETS_MM = 1.6


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("atlas", type=Path)
    parser.add_argument("--out", type=Path, required=True, help="folder of the deformations")
    parser.add_argument("--populations", nargs="+", choices=POPULATIONS, default=list(POPULATIONS))
    parser.add_argument("--last", type=float, default=34, help="last week")
    parser.add_argument("--labels-only", action="store_true", help="leave the T2 volumes out")
    parser.add_argument("--threads", type=int, default=1)
    return parser.parse_args()


def read(folder: Path, stem: str, labels_only: bool) -> Channels:
    volume = read_label_volume(folder / f"{stem}_labels.nii.gz")
    image = None if labels_only else read_values(folder / f"{stem}_t2w.nii.gz", "auto", "grey values")
    return channels(volume.labels, volume.affine, cerebrum=SCHEME.cerebrum, cortex=SCHEME.cortex, image=image)


def solid(brain: Channels) -> TetrahedralMesh:
    """Returns a tetrahedral mesh of the cubes of a grid inside the largest part of a cerebrum."""
    ends = [brain.affine[axis, 3] + np.array([0, n - 1]) * brain.voxel_mm for axis, n in enumerate(brain.tissue.shape)]
    cubes = grid([np.arange(low, high, TETS_MM) for low, high in ends])
    centres = cubes.vertices[cubes.tets].mean(axis=1)
    index = np.rint(transform_points(centres, np.linalg.inv(brain.affine))).astype(int)
    tets = cubes.tets[brain.tissue[tuple(index.T)] > 0]
    used, numbers = np.unique(tets, return_inverse=True)
    mesh = TetrahedralMesh(cubes.vertices[used], numbers.reshape(-1, 4))
    part = connected_parts(mesh)[mesh.tets[:, 0]]
    used, numbers = np.unique(mesh.tets[part == np.bincount(part).argmax()], return_inverse=True)
    return TetrahedralMesh(mesh.vertices[used], numbers.reshape(-1, 4))


def main() -> None:
    arguments = parse()
    pairs, summary = [], {}
    for population in arguments.populations:
        weeks = [week for week in POPULATIONS[population] if week <= arguments.last]
        brains = {week: read(arguments.atlas, POPULATIONS[population][week], arguments.labels_only) for week in weeks}
        deformations = []
        for first, second in pairwise(weeks):
            path = arguments.out / f"{population}-{first}-{second}.h5"
            if not path.exists():
                found = register(brains[first], brains[second], threads=arguments.threads)
                quality = judge(brains[first], brains[second], found.deformation)
                times = {"seconds": found.seconds, "cpu_seconds": found.cpu_seconds}
                report = {**times, "channels": list(found.channels), **asdict(quality)}
                try:
                    require_good(quality, pair=f"{first}-{second}")
                    report["refused"] = ""
                except InputError as error:
                    report["refused"] = str(error)
                write_deformation(path, found.deformation, report)
            deformation, report = read_deformation(path)
            deformations.append(deformation)
            pairs.append({"population": population, "from": first, "to": second, **report})
            print(json.dumps(pairs[-1]), flush=True)
        mesh = solid(brains[weeks[0]])
        positions = carry_over_weeks(mesh.vertices, deformations)
        volumes = np.stack([volumes_between(position, mesh.tets) for position in positions])
        sizes = vertex_sizes(mesh.vertices, mesh.tets)
        pairs_of = (positions[i : i + 2] for i in range(len(deformations)))
        moves = [np.linalg.norm(without_rigid_motion(*pair, sizes), axis=1).mean() for pair in pairs_of]
        true = [np.count_nonzero(brain.tissue & 1) * brain.voxel_mm**3 for brain in brains.values()]
        summary[population] = {
            "pairs": len(deformations),
            "refused": sum(bool(row["refused"]) for row in pairs if row["population"] == population),
            "tets": len(mesh.tets),
            "inverted_at_end": int(np.count_nonzero(volumes[-1] <= 0)),
            "volume_growth_kept": float(volumes[-1].sum() / volumes[0].sum() / (true[-1] / true[0])),
            "mean_displacement_mm_per_week": (moves / np.diff(weeks)).round(3).tolist(),
        }
    table = pd.DataFrame(pairs)
    shown = ["population", "from", "to", "dice_cerebrum", "dice_cortex", "least_determinant", "folded_share"]
    shown += ["log_growth_sd", "rim_mm", "inside_mm", "seconds", "cpu_seconds"]
    print(table[shown].to_string(index=False, float_format="%.3f"))
    for population, found in summary.items():
        rows = table[table["population"] == population]
        found |= {
            "least_dice_cerebrum": rows["dice_cerebrum"].min(),
            "dice_cortex": [rows["dice_cortex"].min(), rows["dice_cortex"].max()],
            "least_determinant": rows["least_determinant"].min(),
            "most_seconds": rows["seconds"].max(),
            "most_cpu_seconds": rows["cpu_seconds"].max(),
        }
    print(json.dumps(summary))


if __name__ == "__main__":
    main()
