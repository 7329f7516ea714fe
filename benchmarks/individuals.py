"""Find how large an individual difference must be for a prediction to be better than
the atlas' brain of that week.

    ./run python benchmarks/individuals.py FOLDER --accept-licence \\
        --atlas crl CRL --atlas chinese CHINESE

CRL and CHINESE are the folders of atlases' files. The individuals are synthetic: an
atlas' labels, deformed by random smooth maps. At the start, `shape` has waves of 40 to
60 mm and `sulci` of 15 to 25 mm; their size is the root mean square displacement (mm)
in the start brain's cerebrum. Maps follow the brain's centre and its lengths along
three axes over the weeks, so the individual difference is `kept`; or it is `fading` as
e^(−weeks/8), and another one of the same size replaces it.

The start brains are predicted with the growth of their atlas, without the synthetic
later brains, and rigidly aligned with these. Models are the `atlas`' own brain of the
week scaled to the predicted volume, the predicted shape before a body follows it, with
the weight of `growth.expected.Persistence` (`predicted`), with all of the smooth
difference (`whole`) and with all of it (`all`), and the atlas' surface moved to the
predicted shape (`delivered`), which is what a study measures. The map of an individual
depends on its kind and seed only.

The last line is one JSON object: `rows` with `grown_by`, `persistence`, `individual`,
`horizon` (GW), `model`, `distance_mm`, `r_shape_index`; of `delivered` also the
differences of area, volume, folding (gyrification index) and mean sulcal depth, as
fractions of the later brain's, which are the errors of its metrics. A table shows the
largest and the root mean square of these.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from common import print_rows, r_shape_index, run_workflow
from scipy.ndimage import map_coordinates

from gyriflow.anatomy.fissure import cut_sides, nearer_left
from gyriflow.compare.accuracy import FOLDING, QUANTITIES, log_value
from gyriflow.compare.comparison import aligned_distances
from gyriflow.compare.shapes import prepare_for_comparison, scale_to_volume
from gyriflow.geometry.deformations import between_moved, transform_points
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import Floats, TriangleMesh
from gyriflow.growth.expected import expected_positions
from gyriflow.growth.fine_surfaces import ObservedSurface, moved_surface
from gyriflow.growth.series_shapes import follow_series
from gyriflow.io.registrations import read_correspondence
from gyriflow.io.surfaces import read_pose, read_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.volumes import LabelVolume, read_label_volume, write_label_volume
from gyriflow.io.yaml_files import SCHEMES, read_keys
from gyriflow.metrics.measure import folding_metrics, measure_folds, size_metrics
from gyriflow.settings.terms import CURVATURE_RADIUS_MM, SIDES
from gyriflow.shipped import ATLASES
from gyriflow.study.paths import MESH, PIAL, REGISTERED

WAVES_MM = {"shape": (40.0, 60.0), "sulci": (15.0, 25.0)}
MODES, FLOW_STEPS, COARSE, PAD = 40, 8, 2, 14
KEPT_GW = {"kept": np.inf, "fading": 8.0}
MESH_SETTINGS = {
    "order": 1,
    "mesher": "tetgen",
    "surface_edge_mm": 1.3,
    "core_edge_mm": 3,
}
# a coarse mesh of a detailed surface has flat elements
MESH_SETTINGS |= {"max_surface_distance_mm": 0.5}
INDIVIDUALS = [
    "shape-1-1",
    "sulci-1-2",
    "shape-2-2",
    "sulci-2-1",
    "shape-4-1",
    "shape-4-2",
]


def velocity(kind: str, seed: int, points: Floats) -> Floats:
    """Return a random smooth field at (n, 3) points in mm, (n, 3)."""
    random = np.random.default_rng([seed, list(WAVES_MM).index(kind)])
    waves = random.normal(size=(3, MODES))
    waves *= (
        2
        * np.pi
        / random.uniform(*WAVES_MM[kind], MODES)
        / np.linalg.norm(waves, axis=0)
    )
    return np.asarray(
        np.cos(points @ waves + random.uniform(0, 2 * np.pi, MODES))
        @ random.normal(size=(MODES, 3))
    )


def cerebrum_of(volume: LabelVolume, scheme: str) -> tuple[Floats, Floats, Floats]:
    """Return the cerebrum's centre, its standard deviations along the axes, and its (n,
    3) centred voxels, in mm."""
    points = transform_points(
        np.argwhere(np.isin(volume.labels, SCHEMES[scheme].cerebrum)), volume.affine
    )
    return points.mean(axis=0), points.std(axis=0), points - points.mean(axis=0)


def deformed(
    volume: LabelVolume, start: LabelVolume, scheme: str, name: str, share: float
) -> LabelVolume:
    """Return the labels of an individual KIND-SIZE-SEED with a share of its individual
    difference at the start."""
    kind, size, seed = name.split("-")
    (centre, lengths, _) = cerebrum_of(volume, scheme)
    (_, start_lengths, cerebrum) = cerebrum_of(start, scheme)
    parts = []
    for part, number in ((share, int(seed)), (np.sqrt(1 - share**2), int(seed) + 1000)):
        rms = np.sqrt((velocity(kind, number, cerebrum[::20]) ** 2).sum(axis=1).mean())
        parts.append((part * float(size) / rms / FLOW_STEPS, number))
    labels, affine = np.pad(volume.labels, PAD), volume.affine.copy()
    affine[:3, 3] -= affine[:3, :3].sum(axis=1) * PAD
    grid = np.stack(
        np.meshgrid(
            *(np.arange(0, n + COARSE, COARSE) for n in labels.shape), indexing="ij"
        )
    )
    points = began = (
        (transform_points(grid.reshape(3, -1).T, affine) - centre)
        * start_lengths
        / lengths
    )
    # a flow is one-to-one at any size
    for _ in range(FLOW_STEPS):
        points = points + sum(
            factor * velocity(kind, number, points)
            for factor, number in parts
            if factor
        )
    moved = (points - began) * lengths / start_lengths @ np.linalg.inv(affine[:3, :3]).T
    index = np.indices(labels.shape, dtype=np.float64)
    index += [
        map_coordinates(axis.reshape(grid.shape[1:]), index / COARSE, order=1)
        for axis in moved.T
    ]
    largest, result = np.zeros(labels.shape, np.float32), np.zeros_like(labels)
    for label in np.unique(labels):
        weight = map_coordinates((labels == label).astype(np.float32), index, order=1)
        result[weight > largest], largest = label, np.maximum(largest, weight)
    return LabelVolume(result, affine)


def targets_of(
    folder: Path, brain: str, atlas: dict[float, str]
) -> dict[float, dict[str, TriangleMesh]]:
    """Return the predicted surfaces of a start brain along the brains of an atlas, by
    week and model."""
    chain = [brain, *atlas.values()]
    mesh = read_tetrahedral_mesh(folder / MESH["mesh"].format(brain=brain))
    poses = [
        read_pose(folder / PIAL["report"].format(brain=name)).world for name in chain
    ]
    registered = [
        folder / REGISTERED.format(earlier=earlier, later=later)
        for earlier, later in pairwise(chain)
    ]
    pairs = [
        between_moved(read_correspondence(file), *pair)
        for file, pair in zip(registered, pairwise(poses), strict=True)
    ]
    surfaces = [
        read_surface(folder / PIAL["whole"].format(brain=name)) for name in chain[1:]
    ]
    weeks, start = sorted(atlas), min(atlas)
    carried = follow_series(
        mesh, [start, *weeks], pairs, surfaces, has_slits=True
    ).positions[1:]
    options: dict[str, dict[str, Any]] = {
        "predicted": {},
        "whole": {"keep_all": True},
        "all": {"keep_all": True, "smoothing_mm": 0.0},
    }
    boundary, used = boundary_surface(mesh)
    result: dict[float, dict[str, TriangleMesh]] = {week: {} for week in weeks[1:]}
    for model, option in options.items():
        found = expected_positions(mesh, start, carried, weeks, weeks[1:], **option)
        for week, positions in zip(weeks[1:], found.positions[1:], strict=True):
            result[week][model] = TriangleMesh(positions[used], boundary.faces)
    for number, week in enumerate(weeks[1:], 1):
        observed = ObservedSurface(surfaces[number], carried[number][used])
        shape = result[week]["predicted"]
        result[week]["delivered"] = moved_surface(observed, shape)
    return result


def metrics_of(
    whole: TriangleMesh, left: TriangleMesh, right: TriangleMesh
) -> dict[str, float]:
    """Return the metrics of a brain's size and folding."""
    sides = (left, right)
    folds = [measure_folds(side, CURVATURE_RADIUS_MM) for side in sides]
    return size_metrics(whole, sides) | folding_metrics(folds)


def differences(
    found: dict[str, float], observed: dict[str, float]
) -> dict[str, float]:
    """Return the differences of metrics from the observed brain's, as fractions; that
    of the gyrification index is of the folding."""
    result = {}
    for metric in QUANTITIES:
        name = "folding" if metric == FOLDING else metric
        error = log_value(metric, found[metric]) - log_value(metric, observed[metric])
        result[f"{name}_difference"] = float(np.expm1(error))
    return result


def surfaces_of(
    folder: Path, brain: str
) -> tuple[TriangleMesh, TriangleMesh, TriangleMesh]:
    """Return the whole surface of a brain and those of its left and right side."""
    whole, left, right = (
        read_surface(folder / PIAL[part].format(brain=brain))
        for part in ("whole", *SIDES)
    )
    return whole, left, right


def scores_of(
    folder: Path, name: str, atlas: str, weeks: Sequence[int]
) -> list[dict[str, Any]]:
    """Return the distances and correlations of all models of an individual, with both
    persistences, and the differences of the delivered surface's metrics."""
    start, rows = weeks[0], []
    brain = f"{name}-kept-{start}"
    targets = targets_of(
        folder,
        brain,
        {float(week): f"{atlas}-{week}" for week in range(start, weeks[-1] + 1)},
    )
    delivered_metrics = {}
    for week in weeks[1:]:
        delivered = targets[week]["delivered"]
        whole, left, right = surfaces_of(folder, f"{atlas}-{week}")
        if delivered is targets[week]["predicted"]:
            # the mesh's own surface, where an observed one would cross itself
            _, left, right = surfaces_of(folder, brain)
            mesh = read_tetrahedral_mesh(folder / MESH["mesh"].format(brain=brain))
            whole, _ = boundary_surface(mesh)
        sides = cut_sides(delivered, nearer_left(whole, left, right))
        delivered_metrics[week] = metrics_of(delivered, *sides)
    for persistence, week in product(KEPT_GW, weeks[1:]):
        parts = surfaces_of(folder, f"{name}-{persistence}-{week}")
        observed, observed_metrics = parts[0], metrics_of(*parts)
        atlas_brain, _, _ = surfaces_of(folder, f"{atlas}-{week}")
        models = targets[week] | {
            "atlas": scale_to_volume(atlas_brain, targets[week]["predicted"])
        }
        folds = prepare_for_comparison(observed, observed)
        for model, surface in models.items():
            row = {
                "grown_by": atlas,
                "persistence": persistence,
                "individual": name,
                "horizon": week - start,
            }
            row |= {
                "model": model,
                "distance_mm": aligned_distances(surface, observed)["distance_mm"],
            }
            row["r_shape_index"] = r_shape_index(surface, observed, folds)
            if model == "delivered":
                row |= differences(delivered_metrics[week], observed_metrics)
            rows.append(row)
    return rows


def run_study(
    folder: Path, atlas: str, files: Path, arguments: argparse.Namespace
) -> None:
    """Deform an atlas' labels into individuals, and run the workflow for the files that
    are compared."""
    weeks = sorted(arguments.weeks)
    series = read_keys(ATLASES / atlas / "atlas.yaml")["series"]["normative"]
    start = weeks[0]
    scheme = series["scheme"]
    growing = list(range(weeks[0], weeks[-1] + 1))
    folder.mkdir(parents=True, exist_ok=True)
    paths = {
        week: files / series["files"]["labels"].format(week=week) for week in weeks
    }
    volumes = {
        week: read_label_volume(path, cropped=True) for week, path in paths.items()
    }
    brains = []
    for name, persistence, week in product(arguments.individuals, KEPT_GW, weeks):
        if persistence == "kept" or week > start:
            path = folder / f"{name}-{persistence}-{week}.nii.gz"
            share = float(np.exp((start - week) / KEPT_GW[persistence]))
            if not path.exists():
                write_label_volume(
                    path, deformed(volumes[week], volumes[start], scheme, name, share)
                )
            brain = {
                "id": path.name[:-7],
                "week": week,
                "subject": f"{name}-{persistence}",
                "population": "synthetic",
            }
            brains.append(brain | {"labels": str(path), "scheme": scheme})
    starts = [f"{name}-kept-{start}" for name in arguments.individuals]
    accepted, chain = arguments.accept_licence, [f"{atlas}-{week}" for week in growing]
    config = {
        "atlas": {
            "name": atlas,
            "folder": str(files),
            "weeks": growing,
            "accept_licence": accepted,
        },
        "brains": brains,
        "growth": {"brains": {"atlas": chain}},
        "start": starts,
        "mesh": MESH_SETTINGS,
        "folding": {
            "preset": "expected",
            "end_week": weeks[-1],
            "output_every_gw": 4,
            "ranks": 1,
        },
        "runs": {"expected": {}},
    }
    made = [
        PIAL["whole"].format(brain=brain)
        for brain in [*chain, *(brain["id"] for brain in brains)]
    ]
    made += [MESH["mesh"].format(brain=brain) for brain in starts]
    pairs = [*((brain, chain[0]) for brain in starts), *pairwise(chain)]
    made += [
        REGISTERED.format(earlier=earlier, later=later) for earlier, later in pairs
    ]
    run_workflow(folder, config, arguments.cores, *made)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--atlas",
        nargs=2,
        action="append",
        required=True,
        metavar=("NAME", "FILES"),
        help="atlas with a normative series",
    )
    parser.add_argument(
        "--accept-licence",
        action="store_true",
        help="accept the licences of the atlases",
    )
    parser.add_argument(
        "--individuals", nargs="+", metavar="KIND-SIZE-SEED", default=INDIVIDUALS
    )
    parser.add_argument(
        "--weeks",
        type=int,
        nargs="+",
        default=[22, 26, 30],
        help="week of the start brains, and later weeks",
    )
    parser.add_argument("--cores", type=int, default=2)
    arguments = parser.parse_args()
    weeks, rows = sorted(arguments.weeks), []
    for atlas, files in arguments.atlas:
        folder = arguments.folder.resolve() / atlas
        run_study(folder, atlas, Path(files).resolve(), arguments)
        score = partial(scores_of, folder, atlas=atlas, weeks=weeks)
        with ProcessPoolExecutor(arguments.cores) as pool:
            rows += [
                row for found in pool.map(score, arguments.individuals) for row in found
            ]
    table = pd.DataFrame(rows)
    means = table.groupby(["persistence", "horizon", "model"])
    columns = ["distance_mm", "r_shape_index"]
    print(means[columns].mean().to_string(float_format="%.3f"))
    delivered = table[table["model"] == "delivered"]
    errors = delivered.filter(like="_difference").abs()
    by_horizon = errors.groupby([delivered["persistence"], delivered["horizon"]])
    squares = (errors**2).groupby([delivered["persistence"], delivered["horizon"]])
    print("largest")
    print(by_horizon.max().to_string(float_format="%.3f"))
    print("root mean square")
    print(np.sqrt(squares.mean()).to_string(float_format="%.3f"))
    print_rows(rows)


if __name__ == "__main__":
    main()
