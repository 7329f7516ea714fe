"""Placement of folds on real brains: no folding, the week before, and the start carried along a registration.

    ./run python benchmarks/registration.py ATLAS_FOLDER --out deformations
    ./run python benchmarks/placement.py ATLAS_FOLDER deformations

The start brain's surface, carried week to week by the deformations, is compared as a simulation would be: it bounds
what growth that was measured in this way can place. A spin test of it and the shapes of the folds stand beside it. A
row per population and week is printed; the last line is one JSON object.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
from registration import POPULATIONS, SCHEME

from gyriflow.geometry.matching import match_points, values_at
from gyriflow.geometry.triangles import TriangleMesh, area, signed_volume, transformed, vertex_normals
from gyriflow.io.registrations import read_deformation
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.io.volumes import read_label_volume
from gyriflow.metrics.curvature import curvature
from gyriflow.registration.carrying import carry_over_weeks
from gyriflow.surface.from_labels import from_labels
from gyriflow.validation.nulls import spin_test
from gyriflow.validation.shapes import Shape, ready
from gyriflow.validation.tables import Comparison, ordered, validation_row

SPINS = 99


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("atlas", type=Path)
    parser.add_argument("deformations", type=Path, help="of benchmarks/registration.py; surfaces are kept there too")
    parser.add_argument("--last", type=int, default=30, help="last week")
    return parser.parse_args()


def pial(arguments: argparse.Namespace, population: str, week: int) -> TriangleMesh:
    """Returns the pial surface of a brain in the pose of its label volume, kept for the next time."""
    kept = arguments.deformations / f"{population}-{week}.surf.gii"
    if not kept.exists():
        volume = read_label_volume(arguments.atlas / f"{POPULATIONS[population][week]}_labels.nii.gz")
        surface = from_labels(volume.labels, volume.affine, SCHEME, week=week)
        write_surface(kept, transformed(surface.whole, np.linalg.inv(np.array(surface.report["pose"]))))
    return read_surface(kept)


def shape(mesh: TriangleMesh) -> Shape:
    bend = curvature(mesh, radius_mm=3.0)
    return Shape(mesh, bend.mean, bend.shape_index)


def main() -> None:
    arguments, rows, summary = parse(), [], {}
    for population, stems in POPULATIONS.items():
        weeks = [week for week in stems if week <= arguments.last]
        surfaces = {week: pial(arguments, population, week) for week in weeks}
        files = [arguments.deformations / f"{population}-{week}-{week + 1}.h5" for week in weeks[:-1]]
        start = surfaces[weeks[0]]
        positions = carry_over_weeks(start.vertices, [read_deformation(file)[0] for file in files])
        own = []
        for number, week in enumerate(weeks[1:], start=1):
            began = time.perf_counter()
            real_brain, carried = surfaces[week], TriangleMesh(positions[number], start.faces)
            real = shape(ready(real_brain, real_brain))
            shapes = {
                name: shape(ready(mesh, real_brain))
                for name, mesh in {"run": carried, "start": start, "adjacent": surfaces[week - 1]}.items()
            }
            row = validation_row(
                Comparison(f"{population}-carried", "explained", weeks[0], week),
                simulated=carried,
                real_brain=real_brain,
                curve=(area(real_brain), signed_volume(real_brain)),
                real=real,
                **shapes,
            )
            match = match_points(real.mesh.vertices, vertex_normals(real.mesh), shapes["run"].mesh)
            spin = spin_test(
                real.mesh.vertices,
                real.areas,
                real.shape_index,
                values_at(match, shapes["run"].shape_index),
                count=SPINS,
                seed=0,
                right=real.mesh.vertices[:, 0] > 0,
            )
            row |= {"spin_q95": spin["null_q95"], "spin_p": spin["p"], "seconds": time.perf_counter() - began}
            own.append(row)
        rows += own
        last = own[-1]
        kept = ["week", "area_error", "volume_error", "curvature_rms_ratio", "spin_q95", "spin_p", "seconds"]
        for measure in ("shape_index", "mean_curvature"):
            kept += [f"{kind}_{measure}" for kind in ("r", "r_start", "r_adjacent", "gain_low", "gain_high", "skill")]
        summary[population] = {name: last[name] for name in kept}
    table = ordered(rows)
    shown = ["run", "week", "area_error", "volume_error", "r_shape_index", "r_start_shape_index"]
    shown += ["r_adjacent_shape_index", "gain_low_shape_index", "gain_high_shape_index", "skill_shape_index"]
    shown += ["r_mean_curvature", "r_start_mean_curvature", "r_adjacent_mean_curvature", "skill_mean_curvature"]
    print(table[[*shown, "matched_share", "spin_q95", "spin_p", "seconds"]].to_string(index=False, float_format="%.3f"))
    folds = ["relative_area", "curvature_rms_per_mm", "pits_per_trough", "sulci", "sulcal_length_over_width"]
    print(
        table[["run", "week", *(f"{who}{name}" for name in folds for who in ("", "real_"))]].to_string(
            index=False, float_format="%.3f"
        )
    )
    print(json.dumps(summary))


if __name__ == "__main__":
    main()
