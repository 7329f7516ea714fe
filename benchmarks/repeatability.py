"""Measure one brain again and again, turned and resampled on another grid of voxels:
the noise of each number.

    ./run python benchmarks/repeatability.py [--labels FILE --scheme NAME --week W] \\
        [--record norms/repeatability.yaml]

The labels, by default of the shipped brain of 29 GW, are resampled at the nearest
voxel, turned and shifted, and measured as any brain. Printed are the coefficient of
variation and the standard deviation of each metric (of sides: their mean), the
distances between two such surfaces and spectra, and how many numbers are missing.
`--record` writes what tables of changes and distances read. The last line is one JSON
object.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import ndimage
from scipy.spatial.transform import Rotation

from gyriflow.anatomy.pial import from_labels
from gyriflow.anatomy.thickness import thickness_from_labels
from gyriflow.compare.calibration import brain_scores, spectral_scores
from gyriflow.compare.comparison import aligned_distances, observed_brain
from gyriflow.geometry.alignment import motion
from gyriflow.geometry.poses import pose_from
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.volumes import read_label_volume
from gyriflow.io.yaml_files import SCHEMES, write_yaml
from gyriflow.metrics.measure import BrainMetrics, measure_brain
from gyriflow.metrics.spangy import spectral_distances
from gyriflow.settings.terms import CURVATURE_RADIUS_MM, SCORES, SPECTRAL_SCORES
from gyriflow.shipped import SHIPPED

SURFACE_SCORES = [name for name in SCORES if name not in SPECTRAL_SCORES]
BRAIN = (
    SHIPPED
    / "atlases"
    / "spina-bifida"
    / "fetal_SB_atlas_GA29_operated"
    / "parcellation.nii.gz"
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--labels", type=Path, default=BRAIN)
    parser.add_argument("--scheme", default="spina-bifida-atlas")
    parser.add_argument("--week", type=float, default=29.0)
    parser.add_argument(
        "--last",
        choices=["B4", "B5", "B6"],
        default="B5",
        help="last band of the spectra",
    )
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--record", type=Path, help="YAML file to write")
    arguments = parser.parse_args()
    with ProcessPoolExecutor(arguments.processes, get_context("spawn")) as pool:
        measured = list(
            pool.map(partial(measure_turned, arguments), range(arguments.times))
        )
        compared = list(pool.map(compare_pair, pairwise(measured)))
    table = pd.concat([found.table for _, found in measured], ignore_index=True)
    spectra = [
        found.spectra.assign(subject=str(i), run="observed", week=0.0)
        for i, (_, found) in enumerate(measured)
    ]
    spectral = (
        spectral_distances(pd.concat(spectra, ignore_index=True))
        .groupby("metric")["value"]
        .mean()
        .dropna()
    )
    distances, scores = (
        pd.DataFrame(rows).mean().dropna() for rows in zip(*compared, strict=True)
    )
    record = {
        "source": "benchmarks/repeatability.py",
        "brain": arguments.labels.parent.name,
        "repeats": arguments.times,
        "metrics": variation(table),
        "distances": {
            name: rounded(value)
            for name, value in (*distances.items(), *spectral.items())
        },
        "scores": {name: rounded(value) for name, value in scores.items()},
    }
    # bands beyond those that are analysed are missing in all repeats
    missing = (
        table.groupby(["hemisphere", "metric"])["value"]
        .count()
        .between(1, arguments.times - 1)
        .sum()
    )
    print(
        "| metric | coefficient of variation | standard deviation |\n"
        "| --- | ---: | ---: |"
    )
    for name, row in record["metrics"].items():
        print(f"| `{name}` | {100 * row['cv']:.2f} % | {row['sd']:.3g} |")
    print("\n| distance or score | between two repeats |\n| --- | ---: |")
    for name, value in (record["distances"] | record["scores"]).items():
        print(f"| `{name}` | {value:.3g} |")
    if arguments.record:
        write_yaml(arguments.record, record)
    print(json.dumps(record | {"numbers_missing_in_some_repeats": int(missing)}))


def measure_turned(
    arguments: argparse.Namespace, number: int
) -> tuple[TriangleMesh, BrainMetrics]:
    """Return the surface and the metrics of the brain, turned for the nth time."""
    volume = read_label_volume(arguments.labels, cropped=True)
    scheme = SCHEMES[arguments.scheme]
    labels, affine = turned(volume.labels, volume.affine, number)
    surface = from_labels(labels, affine, scheme, week=arguments.week)
    pose, fissure = pose_from(surface.report["pose"]), surface.report["fissure_x_mm"]
    thickness = thickness_from_labels(surface.cortex, surface.whole, pose, fissure)
    found = measure_brain(
        surface.whole,
        surface.left,
        surface.right,
        thickness_mm=thickness.measured_mm,
        label_volumes_ml=surface.report.get("label_volumes_mL", {}),
        spangy_modes=arguments.last,
    )
    print(f"measured {number + 1}", flush=True)
    return surface.whole, found


def compare_pair(pair: tuple) -> tuple[dict[str, float], dict[str, float]]:
    """Return the distances between two surfaces of the brain, and the scores of one
    against the other."""
    (first, found), (second, other) = pair
    distances = aligned_distances(first, second)
    observed = observed_brain("", second, CURVATURE_RADIUS_MM)
    scores = brain_scores(
        first, observed, SURFACE_SCORES, radius_mm=CURVATURE_RADIUS_MM
    )
    scores |= spectral_scores(found.spectra, other.spectra)
    return {
        f"surface_{name}": distances[f"{name}_mm"]
        for name in ("distance", "distance95")
    }, scores


def turned(
    labels: np.ndarray, affine: np.ndarray, number: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return a label volume turned at random by up to 30° and shifted by a part of a
    voxel, with cubic voxels."""
    random = np.random.default_rng(number)
    turn = Rotation.from_rotvec(
        np.radians(random.uniform(10, 30)) * unit(random.standard_normal(3))
    ).as_matrix()
    voxel = np.linalg.norm(affine[:3, 0])
    middle = affine[:3, :3] @ (np.array(labels.shape) / 2) + affine[:3, 3]
    size = int(
        np.ceil(np.linalg.norm(np.abs(affine[:3, :3]) @ np.array(labels.shape)) / voxel)
    )
    grid = motion(turn, middle + voxel * random.uniform(-0.5, 0.5, 3)) @ np.diag(
        [voxel, voxel, voxel, 1.0]
    )
    grid = grid @ motion(shift=np.full(3, -size / 2))
    return (
        ndimage.affine_transform(
            labels, np.linalg.inv(affine) @ grid, output_shape=(size,) * 3, order=0
        ),
        grid,
    )


def unit(vector: np.ndarray) -> np.ndarray:
    """Return a vector of length 1."""
    return vector / np.linalg.norm(vector)


def variation(table: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Return the variation of each metric over repeats: of the whole brain, or the mean
    of both sides.

    Metrics that are the same in all repeats, such as the radius of the curvature fit,
    are left out.
    """
    spread = (
        table.groupby(["metric", "hemisphere"], sort=False)["value"]
        .agg(["mean", "std"])
        .dropna()
    )
    spread = spread[spread["std"] > 1e-9 * spread["mean"].abs()]
    spread["cv"] = spread["std"] / spread["mean"].abs()
    rows = {}
    for name, group in spread.groupby("metric", sort=False):
        rows_of = group.droplevel("metric")
        row = rows_of.loc["whole"] if "whole" in rows_of.index else rows_of.mean()
        rows[name] = {"cv": rounded(row["cv"]), "sd": rounded(row["std"])}
    return rows


def rounded(value: float) -> float:
    """Return a number with three digits."""
    return float(f"{value:.3g}")


if __name__ == "__main__":
    main()
