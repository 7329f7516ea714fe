"""Find how large an individual difference must be for a prediction to be better than
the atlas' brain of that week, with synthetic individuals.

    ./run python benchmarks/individuals.py PAIRS.csv \\
        [--individuals KIND-SIZE-SEED ...] [--weeks 26 30] [--match-error 0.3]

PAIRS.csv is the table of benchmarks/persistence.py. Each of its start brains gives a
mesh, placed in an atlas, and the path of this atlas. An individual is the atlas,
deformed by a random smooth map: `shape` has waves of 40 to 60 mm and `sulci` of 15 to
25 mm, and the size is the root mean square displacement (mm) at the start. The map
follows the centre of the brain and its lengths along three axes over the weeks, so the
individual difference is `kept`; or it is `fading` as e^(-weeks/8), and another one of
the same size replaces it. The deformed mesh is the start brain; the deformed surfaces
of the atlas at `--weeks` are its later scans, which are predicted at their ages by
size. The match to the atlas has an error: a random map with waves of 15 to 25 mm and a
root mean square of `--match-error` mm.

Models are those of benchmarks/persistence.py without the scaled start: the atlas' own
brain, the predicted shape with all of the smooth difference (`whole`) and the surface
that is delivered. Of `delivered` there are also the differences of area, volume,
folding (gyrification index) and mean sulcal depth, as fractions of the later brain's,
which are the errors of its metrics; tables show their largest and their root mean
square. The last line is one JSON object with `rows`.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import dolfinx_solver  # noqa: F401
import numpy as np
import pandas as pd
import petsc4py
from common import print_rows, relative_difference
from persistence import Start, models_of, read_start, scores_of

from gyriflow.anatomy.fissure import cut_sides, nearer_left
from gyriflow.compare.accuracy import FOLDING, QUANTITIES
from gyriflow.compare.shapes import prepare_for_comparison
from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.geometry.triangles import Floats, Mask, TriangleMesh, rms_length
from gyriflow.metrics.measure import folding_metrics, measure_folds, size_metrics
from gyriflow.settings.terms import CURVATURE_RADIUS_MM, SIDES

WAVES_MM = {"shape": (40.0, 60.0), "sulci": (15.0, 25.0)}
N_WAVES, FLOW_STEPS = 40, 8
FADING_GW = {"kept": np.inf, "fading": 8.0}
REPLACED = 1000
"""Added to the seed of a map: that of the map which replaces it."""
MATCH_SEED = 77
MODELS = ("whole", "atlas", "delivered")
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
    directions = random.normal(size=(3, N_WAVES))
    directions /= np.linalg.norm(directions, axis=0)
    lengths = random.uniform(*WAVES_MM[kind], N_WAVES)
    phases = random.uniform(0, 2 * np.pi, N_WAVES)
    heights = random.normal(size=(N_WAVES, 3))
    waves = np.cos(points @ (2 * np.pi * directions / lengths) + phases)
    return np.asarray(waves @ heights)


@dataclass(frozen=True, eq=False)
class Individual:
    """A random map KIND-SIZE-SEED of the atlas that a start brain is placed in."""

    name: str
    atlas: Start

    @cached_property
    def week(self) -> float:
        """The stated week of the atlas' brain next to the start brain."""
        weeks = np.asarray(self.atlas.path.shapes.weeks)
        nearest = np.argmin(np.abs(weeks - self.atlas.week))
        return float(weeks[nearest])

    def body(self, week: float) -> Floats:
        """Return the start's mesh (n, 3) in mm in the atlas of a stated week."""
        return self.atlas.carried[self.atlas.path.shapes.weeks.index(week)]

    def moved(self, points: Floats, week: float, share: float) -> Floats:
        """Return (n, 3) points in mm of the atlas at a stated week in the individual,
        which still has a share of its difference at the start."""
        kind, size_mm, seed = self.name.split("-")
        first, shape = self.body(self.week), self.body(week)
        centred = first[::20] - first.mean(axis=0)
        replacing = np.sqrt(1 - share**2)
        steps = []
        for part, number in ((share, int(seed)), (replacing, int(seed) + REPLACED)):
            unit_mm = rms_length(velocity(kind, number, centred))
            steps.append((part * float(size_mm) / unit_mm / FLOW_STEPS, number))
        ratio = shape.std(axis=0) / first.std(axis=0)
        centre = shape.mean(axis=0)
        moved = (points - centre) / ratio
        # a flow is one-to-one at any size
        for _ in range(FLOW_STEPS):
            step = np.zeros_like(moved)
            for factor, number in steps:
                step += factor * velocity(kind, number, moved)
            moved = moved + step
        return moved * ratio + centre

    def surfaces(self, week: float, share: float = 1.0) -> list[TriangleMesh]:
        """Return the surfaces of the individual at a stated week: whole, left,
        right."""
        surfaces = []
        for surface in surfaces_of(self.atlas, week):
            places = self.moved(surface.vertices, week, share)
            surfaces.append(TriangleMesh(places, surface.faces))
        return surfaces

    def start(self, match_error_mm: float) -> Start:
        """Return the individual as a start brain, placed in the atlas with an error."""
        body = self.body(self.week)
        error = velocity("sulci", MATCH_SEED, body - body.mean(axis=0))
        matched = body + match_error_mm / rms_length(error) * error
        deformed = self.moved(body, self.week, share=1.0)
        return replace(
            self.atlas,
            name=self.name,
            week=self.week,
            mesh=TetrahedralMesh(deformed, self.atlas.mesh.tets),
            carried=self.atlas.path.carry(matched, self.week),
            surface=self.surfaces(self.week)[0],
        )


def surfaces_of(start: Start, week: float) -> list[TriangleMesh]:
    """Return the surfaces of the atlas' brain of a stated week: whole, left, right."""
    return [start.atlas_surface(week, part) for part in ("whole", *SIDES)]


def metrics_of(surfaces: list[TriangleMesh]) -> dict[str, float]:
    """Return the metrics of size and folding of a brain: whole, left, right."""
    whole, *sides = surfaces
    folds = [measure_folds(side, CURVATURE_RADIUS_MM) for side in sides]
    return size_metrics(whole, sides) | folding_metrics(folds)


def differences(
    found: dict[str, float], observed: dict[str, float]
) -> dict[str, float]:
    """Return the differences of metrics from the observed brain's, as fractions."""
    result = {}
    for metric in QUANTITIES:
        name = "folding" if metric == FOLDING else metric
        difference = relative_difference(metric, found[metric], observed[metric])
        result[f"{name}_difference"] = difference
    return result


def rows_of(
    individual: Individual, weeks: list[float], match_error_mm: float
) -> Iterator[dict[str, Any]]:
    """Yield the scores of an individual, whose difference is kept or fading."""
    ages = individual.atlas.ages.table().set_index("stated_week")["age_by_size"]
    start = replace(individual.start(match_error_mm), week=float(ages[individual.week]))
    predicted = [float(ages[week]) for week in weeks]
    models = models_of(start, predicted, weeks)
    for week, age, surfaces in zip(weeks, predicted, models, strict=True):
        labels: dict[str, Any] = {"grown_by": start.first, "week": week}
        labels |= {"individual": individual.name, "horizon": age - start.week}
        delivered = surfaces["delivered"]
        sides = cut_sides(delivered, left_faces_of(individual, start, delivered, week))
        found = metrics_of([delivered, *sides])
        for persistence, time in FADING_GW.items():
            share = float(np.exp((start.week - age) / time))
            observed = individual.surfaces(week, share)
            folds = prepare_for_comparison(observed[0], observed[0])
            errors = differences(found, metrics_of(observed))
            for model in MODELS:
                row = labels | {"persistence": persistence, "model": model}
                row |= scores_of(surfaces[model], observed[0], folds)
                yield row | errors if model == "delivered" else row


def left_faces_of(
    individual: Individual, start: Start, delivered: TriangleMesh, week: float
) -> Mask:
    """Return the (m,) mask of the left faces of the surface that is delivered at a
    stated week: the atlas' or the start's own one, moved, or the mesh's, where these
    would cross themselves."""
    atlas = surfaces_of(start, week)
    own = individual.surfaces(individual.week)
    boundary = start.boundary(start.mesh.vertices)
    for whole, left, right in (atlas, own, [boundary, *own[1:]]):
        if np.array_equal(whole.faces, delivered.faces):
            return nearer_left(whole, left, right)
    raise ValueError("the delivered surface has the faces of no known one")


def print_table(title: str, table: pd.DataFrame) -> None:
    """Print a table below its title."""
    print(title)
    print(table.to_string(float_format="%.3f"))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pairs", type=Path)
    parser.add_argument(
        "--individuals", nargs="+", metavar="KIND-SIZE-SEED", default=INDIVIDUALS
    )
    parser.add_argument("--weeks", type=float, nargs="+", default=[26.0, 30.0])
    parser.add_argument("--match-error", type=float, default=0.3, metavar="MM")
    arguments = parser.parse_args()
    # remeshing loads PETSc without initialising it
    petsc4py.init()
    rows = []
    pairs = pd.read_csv(arguments.pairs).drop_duplicates(["study", "start"])
    for _, pair in pairs.iterrows():
        start = read_start(pair)
        for name in arguments.individuals:
            individual = Individual(name, start)
            for row in rows_of(individual, arguments.weeks, arguments.match_error):
                print(row, flush=True)
                rows.append(row)
    table = pd.DataFrame(rows)
    size = table["individual"].str.split("-").str[1].rename("size_mm")
    scores = table[["distance_mm", "r_shape_index"]]
    by_model = [size, table["persistence"], table["week"], table["model"]]
    print_table("mean", scores.groupby(by_model).mean())
    delivered = table["model"] == "delivered"
    errors = table[delivered].filter(like="_difference").abs()
    by_week = [table["persistence"][delivered], table["week"][delivered]]
    print_table("largest", errors.groupby(by_week).max())
    mean_squares = (errors**2).groupby(by_week).mean()
    print_table("root mean square", mean_squares**0.5)
    print_rows(rows)


if __name__ == "__main__":
    main()
