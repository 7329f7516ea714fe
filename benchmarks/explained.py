"""Compare a run that follows its own brain's later shapes with the observed surfaces.

    ./run python benchmarks/explained.py FOLDER RUN BRAIN OBSERVED [--weeks 26 28 30]

FOLDER is that of a study that folds the brain BRAIN in the run RUN by its own growth;
OBSERVED is the pattern of the ids of observed brains, such as crl-{week:g}: one for
each week that is compared, and for the one before. For each week and each of the
observed brain, that of the week before, target and run: area (cm²), gyrification index
by hulls, mean distance of the observed surface from this one after rigid alignment
(mm), r of the shape index (scaled to the observed volume), and crossing faces. The last
line is one JSON object.

    ./run python benchmarks/explained.py FOLDER RUN BRAIN OBSERVED --companions \\
        [--uniform RUN] [--smoothing 5 3]

compares the run with five companions instead, which an explanation has to beat. For
each week: r of the shape index and mean distance of the observed surface (mm), after
scaling to the observed volume and rigid alignment, of

- run: the run;
- start: the start brain;
- uniform: a run whose growth does not depend on place, if there is one;
- smooth: the start, moved by the displacement to its target at this week smoothed along
  the surface, without mechanics;
- registration: the start, carried to this week by the registrations alone, without
  mechanics;
- random: folds of no brain. To the smooth displacement (of the first length) random
  folds are added with the root mean square along the normal and the mean squared
  wavenumber of what smoothing has removed. The body follows these shapes from week to
  week of the table, as it follows the targets. It is compared with the observed brain,
  and with the random shape, as the run is with the observed brain.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import petsc4py
from common import print_rows, r_shape_index
from scipy.optimize import brentq

from gyriflow.anatomy.fissure import cut_sides, nearer_left
from gyriflow.compare.shapes import align, prepare_for_comparison, scale_to_volume
from gyriflow.folding.elastic_fit import ElasticFit
from gyriflow.geometry.alignment import rigid_fit
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.diffusion import diffuse, harmonic_continuation, stiffness_matrix
from gyriflow.geometry.matching import faces_that_cross, nearest_on
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_surface,
    linear_pieces,
)
from gyriflow.geometry.triangles import (
    Floats,
    TriangleMesh,
    area_cm2,
    convex_hull,
    signed_volume,
    vertex_areas,
    vertex_normals,
)
from gyriflow.growth.carrying import carry_surface
from gyriflow.growth.series_shapes import CONTINUATION_TOL, fit_body
from gyriflow.io.frames import read_positions, read_weeks
from gyriflow.io.registrations import read_correspondence, read_weekly_shapes
from gyriflow.io.surfaces import read_pose, read_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.metrics.gyrification import gyrification_index, pieces_without_cuts
from gyriflow.settings.terms import SIDES
from gyriflow.study.paths import FOLDING, MESH, PIAL, REGISTERED, TARGETS

FINEST_MM, FINEST_TOL_MM = 0.01, 0.05
"""Least length over which random folds are smoothed, and tolerance of this length."""
TOLERANCE = 1e-5
"""Relative tolerance of `diffuse`."""


@dataclass(frozen=True, eq=False)
class ExplainedBrain:
    """A start brain in the folder of a study: its mesh, the boundary with its nodes
    `used`, and its targets by week.

    `weeks` are the later ones that define the path through the targets.
    """

    folder: Path
    brain: str
    mesh: TetrahedralMesh
    boundary: TriangleMesh
    used: np.ndarray
    targets: dict[float, TriangleMesh]
    weeks: list[float]

    def frames(self, run: str) -> Path:
        """Return the file of a run's frames."""
        return self.folder / FOLDING["frames"].format(run=run, brain=self.brain)

    def surface_of_run(self, run: str, week: float) -> TriangleMesh:
        """Return the surface of a run at a week."""
        return TriangleMesh(
            read_positions(self.frames(run), week)[self.used], self.boundary.faces
        )

    def pial(self, brain: str, part: str = "whole") -> TriangleMesh:
        """Return the pial surface of a brain, or that of a side."""
        return read_surface(self.folder / PIAL[part].format(brain=brain))


def read_brain(folder: Path, brain: str) -> ExplainedBrain:
    """Return a start brain that was folded by its own growth."""
    mesh = read_tetrahedral_mesh(folder / MESH["mesh"].format(brain=brain))
    boundary, used = boundary_surface(mesh)
    shapes = read_weekly_shapes(folder / TARGETS.format(brain=brain, origin="self"))
    places = dict(zip(map(float, shapes.weeks), shapes.positions, strict=True))
    targets = {
        week: TriangleMesh(points[used], boundary.faces)
        for week, points in places.items()
    }
    passed = shapes.weeks[~np.isin(shapes.weeks, shapes.between)]
    weeks = [float(week) for week in passed[1:]]
    return ExplainedBrain(folder, brain, mesh, boundary, used, targets, weeks)


def explained_rows(
    start: ExplainedBrain, run: str, pattern: str, weeks: list[float]
) -> list[dict[str, Any]]:
    """Return rows of the observed brain, that of the week before, target and run."""
    left = nearer_left(
        start.boundary, *(start.pial(start.brain, side) for side in SIDES)
    )
    rows: list[dict[str, Any]] = []
    for before, week in pairwise(read_weeks(start.frames(run))):
        if weeks and week not in weeks:
            continue
        sides = {}
        for name, at in {"observed": week, "week_before": before}.items():
            surface, *halves = (
                start.pial(pattern.format(week=at), part) for part in ("whole", *SIDES)
            )
            sides[name] = surface, halves
        for name, surface in {
            "target": start.targets[week],
            "run": start.surface_of_run(run, week),
        }.items():
            sides[name] = surface, list(cut_sides(surface, left))
        observed, _ = sides["observed"]
        folds = prepare_for_comparison(observed, observed)
        for name, (surface, halves) in sides.items():
            hulls = [pieces_without_cuts(convex_hull(half), half) for half in halves]
            row = {"week": week, "shape": name, "area_cm2": area_cm2(surface)}
            row |= {"gyrification_index": gyrification_index(halves, hulls)}
            row |= {"distance_mm": distance_mm(surface, observed), "r_shape_index": 1.0}
            if surface is not observed:
                row["r_shape_index"] = r_shape_index(surface, observed, folds)
            rows.append(row | {"crossing_faces": len(faces_that_cross(surface))})
    return rows


def companion_rows(
    start: ExplainedBrain, arguments: argparse.Namespace
) -> Iterator[dict[str, Any]]:
    """Yield rows of the run and its companions."""
    boundary = start.boundary
    noise = np.random.default_rng(arguments.seed).standard_normal(len(start.used))
    # remeshing loads PETSc without initialising it
    petsc4py.init()
    body, pieces = ElasticFit(start.mesh), linear_pieces(start.mesh)
    carried = carry_alone(start, arguments.observed)
    for week in arguments.weeks or start.weeks:
        observed = start.pial(arguments.observed.format(week=week))
        target = start.targets[week]
        models = {
            f"smooth {length:g} mm": move_smoothly(boundary, target, length)
            for length in arguments.smoothing
        }
        smooth = next(iter(models.values()))
        removed = np.sum(
            (target.vertices - smooth.vertices) * vertex_normals(smooth), axis=1
        )
        folds = random_folds(smooth, removed, noise, arguments.smoothing[0])
        shape = TriangleMesh(
            smooth.vertices + folds[:, None] * vertex_normals(smooth), boundary.faces
        )
        runs = {"run": arguments.run, "uniform": arguments.uniform}
        models |= {
            name: start.surface_of_run(run, week) for name, run in runs.items() if run
        }
        extend = harmonic_continuation(
            body.positions_mm, pieces, start.used, CONTINUATION_TOL
        )
        places = body.positions_mm + extend(shape.vertices - body.boundary.vertices)
        fit_body(body, places, None, start.used)
        row: dict[str, Any] = {"week": week}
        for name, heights in {"removed": removed, "added": folds}.items():
            row[f"{name}_mm"], row[f"{name}_wavelength_mm"] = size_and_wavelength(
                smooth, heights
            )
        models = {
            "start": boundary,
            **models,
            "registration": carried[week],
            "random": body.boundary,
        }
        for against, goal in {"observed": observed, "random": shape}.items():
            prepared = prepare_for_comparison(goal, goal)
            for name in models if against == "observed" else ["random"]:
                surface = scale_to_volume(models[name], signed_volume(goal))
                values = {"r_shape_index": r_shape_index(surface, goal, prepared)}
                values |= {"distance_mm": distance_mm(surface, goal)}
                yield row | {"shape": name, "against": against} | values


def carry_alone(start: ExplainedBrain, pattern: str) -> dict[float, TriangleMesh]:
    """Return the start brain's surface carried to each later brain by the registrations
    alone."""
    pose = read_pose(start.folder / PIAL["report"].format(brain=start.brain))
    # registrations refer to the worlds of the files
    places = transform_points(start.boundary.vertices, pose.inverse)
    surfaces = {}
    earlier = start.brain
    for week in start.weeks:
        later = pattern.format(week=week)
        path = start.folder / REGISTERED.format(earlier=earlier, later=later)
        # the path of the targets may stop at weeks without a brain
        if not path.exists():
            continue
        places = carry_surface(
            TriangleMesh(places, start.boundary.faces), [read_correspondence(path)]
        )
        surfaces[week] = TriangleMesh(
            transform_points(places, pose.world), start.boundary.faces
        )
        earlier = later
    return surfaces


def distance_mm(surface: TriangleMesh, observed: TriangleMesh) -> float:
    """Return the mean distance of an observed surface from another one that is aligned
    with it."""
    distance, _, _ = nearest_on(observed.vertices, align(surface, observed))
    return float(np.average(distance, weights=vertex_areas(observed)))


def move_smoothly(
    start: TriangleMesh, target: TriangleMesh, length_mm: float
) -> TriangleMesh:
    """Move a surface, in the pose of a target with the same vertices, by the smoothed
    displacement to it."""
    pose = rigid_fit(start.vertices, target.vertices, vertex_areas(start))
    places = transform_points(start.vertices, pose)
    smooth = places + diffuse(
        start.vertices, start.faces, target.vertices - places, length_mm, TOLERANCE
    )
    return TriangleMesh(smooth, start.faces)


def random_folds(
    surface: TriangleMesh, removed: Floats, noise: Floats, length_mm: float
) -> Floats:
    """Return (n,) random heights in mm with the size and mean squared wavenumber of the
    heights that were removed.

    White noise is smoothed over a length that gives this wavenumber, and what smoothing
    over `length_mm` leaves of it is removed. `noise` (n,) are standard normal deviates.
    """
    size_mm, wavelength_mm = size_and_wavelength(surface, removed)
    white = noise / np.sqrt(vertex_areas(surface))

    def folds(finest_mm: float) -> Floats:
        fine = diffuse(surface.vertices, surface.faces, white, finest_mm, TOLERANCE)
        return fine - diffuse(
            surface.vertices, surface.faces, fine, length_mm, TOLERANCE
        )

    def excess(finest_mm: float) -> float:
        return size_and_wavelength(surface, folds(finest_mm))[1] - wavelength_mm

    heights = folds(brentq(excess, FINEST_MM, 4 * length_mm, xtol=FINEST_TOL_MM))
    return heights * size_mm / size_and_wavelength(surface, heights)[0]


def size_and_wavelength(surface: TriangleMesh, heights: Floats) -> tuple[float, float]:
    """Return the root mean square of (n,) heights, and 2π over the root of their mean
    squared wavenumber, in mm."""
    square = float(vertex_areas(surface) @ heights**2)
    slope = float(
        heights @ (stiffness_matrix(surface.vertices, surface.faces) @ heights)
    )
    return float(np.sqrt(square / vertex_areas(surface).sum())), float(
        2 * np.pi * np.sqrt(square / slope)
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("run")
    parser.add_argument("brain")
    parser.add_argument("observed", metavar="OBSERVED", help="for example crl-{week:g}")
    parser.add_argument(
        "--weeks",
        type=float,
        nargs="+",
        default=[],
        help="weeks of the table [default: all]",
    )
    parser.add_argument(
        "--companions",
        action="store_true",
        help="compare with simpler shapes and random folds",
    )
    parser.add_argument("--uniform", metavar="RUN", help="run of uniform growth")
    parser.add_argument(
        "--smoothing",
        type=float,
        nargs="+",
        default=[5.0, 3.0],
        help="SD in mm [default: 5 3]",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the random folds")
    arguments = parser.parse_args()
    start = read_brain(arguments.folder, arguments.brain)
    if arguments.companions:
        rows = []
        for row in companion_rows(start, arguments):
            rows.append(row)
            print(json.dumps(row), flush=True)
    else:
        rows = explained_rows(start, arguments.run, arguments.observed, arguments.weeks)
    print_rows(rows)


if __name__ == "__main__":
    main()
