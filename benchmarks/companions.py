"""Compare a run that follows its own brain's later shapes with four companions, which an explanation has to beat.

    ./run python benchmarks/companions.py FOLDER RUN BRAIN OBSERVED [--uniform RUN] [--weeks 26 30] [--smoothing 5 3]

FOLDER is that of a study in which the brain BRAIN has been folded in the run RUN by its own growth; OBSERVED is the
pattern of the ids of observed brains, such as crl-{week:g}. For each week: r of the shape index and mean distance of
the observed surface (mm), after scaling to the observed volume and rigid alignment, of

- run: the run;
- start: the start brain;
- uniform: a run in which growth does not depend on place, if there is one;
- smooth: the start, moved by the displacement to its target at this week smoothed along the surface, without mechanics;
- random: folds of no brain. To the smooth displacement (of the first length) random folds are added with the root mean
  square along the normal and the mean squared wavenumber of what smoothing has removed. The body follows these shapes
  from week to week of the table, as it follows the targets. It is compared with the observed brain, and with the random
  shape, as the run is with the observed brain.

The last line is one JSON object.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import petsc4py
from scipy.optimize import brentq

from gyriflow.compare.placement import correlation, interpolate_measures
from gyriflow.compare.shapes import align, prepare_for_comparison, scale_to_volume
from gyriflow.folding.elastic_fit import ElasticFit
from gyriflow.geometry.alignment import rigid_fit
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.diffusion import diffuse, harmonic_continuation, stiffness_matrix
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.tetrahedra import boundary_surface, linear_pieces
from gyriflow.geometry.triangles import Floats, TriangleMesh, vertex_areas, vertex_normals
from gyriflow.growth.series_shapes import CONTINUATION_TOL, fit_body
from gyriflow.io.frames import read_positions
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.study.paths import FOLDING, MESH, PIAL, TARGETS

FINEST_MM, FINEST_TOL_MM = 0.01, 0.05
"""Least length over which random folds are smoothed, and tolerance of this length."""
TOLERANCE = 1e-5
"""Relative tolerance of `diffuse`."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("run")
    parser.add_argument("brain")
    parser.add_argument("observed", metavar="OBSERVED", help="for example crl-{week:g}")
    parser.add_argument("--uniform", metavar="RUN", help="run of uniform growth")
    parser.add_argument("--weeks", type=float, nargs="+", help="weeks of the table [default: all with a target]")
    parser.add_argument("--smoothing", type=float, nargs="+", default=[5.0, 3.0], help="SD in mm [default: 5 3]")
    parser.add_argument("--seed", type=int, default=0, help="of the random folds")
    arguments = parser.parse_args()
    folder, brain = arguments.folder, arguments.brain

    mesh = read_tetrahedral_mesh(folder / MESH["mesh"].format(brain=brain))
    start, used = boundary_surface(mesh)
    shapes = read_weekly_shapes(folder / TARGETS.format(brain=brain, origin="self"))
    targets = {float(shapes.weeks[i]): shapes.positions[i][used] for i in shapes.passed[1:]}
    runs = {"run": arguments.run, "uniform": arguments.uniform}
    noise = np.random.default_rng(arguments.seed).standard_normal(len(used))
    # remeshing loads PETSc without initialising it
    petsc4py.init()
    body, pieces = ElasticFit(mesh), linear_pieces(mesh)
    rows: list[dict[str, Any]] = []
    for week in arguments.weeks or list(targets):
        observed = read_surface(folder / PIAL["whole"].format(brain=arguments.observed.format(week=week)))
        target = TriangleMesh(targets[week], start.faces)
        moved = {f"smooth {length:g} mm": move_smoothly(start, target, length) for length in arguments.smoothing}
        smooth = next(iter(moved.values()))
        removed = np.sum((target.vertices - smooth.vertices) * vertex_normals(smooth), axis=1)
        folds = random_folds(smooth, removed, noise, arguments.smoothing[0])
        shape = TriangleMesh(smooth.vertices + folds[:, None] * vertex_normals(smooth), start.faces)
        for name, run in runs.items():
            if run:
                places = read_positions(folder / FOLDING["frames"].format(run=run, brain=brain), week)
                moved[name] = TriangleMesh(places[used], start.faces)
        extend = harmonic_continuation(body.positions_mm, pieces, used, CONTINUATION_TOL)
        places = body.positions_mm + extend(shape.vertices - body.boundary.vertices)
        fit_body(body, places, None, used, open_sulci=False)
        row: dict[str, Any] = {"week": week}
        for name, heights in {"removed": removed, "added": folds}.items():
            row[f"{name}_mm"], row[f"{name}_wavelength_mm"] = size_and_wavelength(smooth, heights)
        against = {"observed": (observed, {"start": start, **moved, "random": body.boundary})}
        against["random"] = shape, {"random": body.boundary}
        for goal, (surface, models) in against.items():
            for name, values in compare(models, surface).items():
                rows.append(row | {"shape": name, "against": goal} | values)
                print(json.dumps(rows[-1]), flush=True)
    print(pd.DataFrame(rows).to_string(index=False, float_format="%.3f"))
    print(json.dumps({"rows": rows}))


def move_smoothly(start: TriangleMesh, target: TriangleMesh, length_mm: float) -> TriangleMesh:
    """Move a surface, in the pose of a target with the same vertices, by the smoothed displacement to it."""
    pose = rigid_fit(start.vertices, target.vertices, vertex_areas(start))
    places = transform_points(start.vertices, pose)
    smooth = places + diffuse(start.vertices, start.faces, target.vertices - places, length_mm, TOLERANCE)
    return TriangleMesh(smooth, start.faces)


def random_folds(surface: TriangleMesh, removed: Floats, noise: Floats, length_mm: float) -> Floats:
    """Return (n,) random heights in mm with the size and mean squared wavenumber of the heights that were removed.

    White noise is smoothed over a length that gives this wavenumber, and what smoothing over `length_mm` leaves of it
    is removed. `noise` (n,) are standard normal deviates.
    """
    size_mm, wavelength_mm = size_and_wavelength(surface, removed)
    white = noise / np.sqrt(vertex_areas(surface))

    def folds(finest_mm: float) -> Floats:
        fine = diffuse(surface.vertices, surface.faces, white, finest_mm, TOLERANCE)
        return fine - diffuse(surface.vertices, surface.faces, fine, length_mm, TOLERANCE)

    def excess(finest_mm: float) -> float:
        return size_and_wavelength(surface, folds(finest_mm))[1] - wavelength_mm

    heights = folds(brentq(excess, FINEST_MM, 4 * length_mm, xtol=FINEST_TOL_MM))
    return heights * size_mm / size_and_wavelength(surface, heights)[0]


def size_and_wavelength(surface: TriangleMesh, heights: Floats) -> tuple[float, float]:
    """Return the root mean square of (n,) heights, and 2π over the root of their mean squared wavenumber, in mm."""
    square = float(vertex_areas(surface) @ heights**2)
    slope = float(heights @ (stiffness_matrix(surface.vertices, surface.faces) @ heights))
    return float(np.sqrt(square / vertex_areas(surface).sum())), float(2 * np.pi * np.sqrt(square / slope))


def compare(models: dict[str, TriangleMesh], goal: TriangleMesh) -> dict[str, dict[str, float]]:
    """Compare surfaces with another one, scaled to its volume and aligned."""
    folds, areas = prepare_for_comparison(goal, goal), vertex_areas(goal)
    found = {}
    for name, model in models.items():
        surface = scale_to_volume(model, goal)
        values, _ = interpolate_measures(prepare_for_comparison(surface, goal), folds)
        distance, _, _ = nearest_on(goal.vertices, align(surface, goal))
        r = correlation(folds.shape_index, values["shape_index"], folds.areas)
        found[name] = {"r_shape_index": r, "distance_mm": float(np.average(distance, weights=areas))}
    return found


if __name__ == "__main__":
    main()
