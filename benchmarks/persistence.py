"""Estimate how much of an individual difference lasts, from brains with a later scan,
and compare predictions that keep it with simpler ones.

    ./run python benchmarks/persistence.py PAIRS.csv [--scores]

PAIRS.csv has a row for each later scan of a brain:

- study: folder of a study with the preset `expected` that has made the start's mesh,
  its registration to the atlas and the atlas' path (target `mesh`, or a finished run);
- start, start_week: the start brain;
- near, first: the atlas' brain that the start is registered to, and the first brain of
  the atlas' path, such as crl-22;
- observed, week: a file with the closed pial surface of the later scan in mm;
- kind: `individual` for a followed fetus, `average` for a brain of an atlas.

The observed surface less the atlas of that week, along the normals, is regressed on the
start's difference from the atlas, smooth and finer, with rigid motion and size apart
(errors of the atlas' curve of volume would outweigh the size of a single brain). The
coefficients are what is left of the difference: persistence times reliability. Standard
errors are by patches of 15 mm. Pairs of averages give MATCH_ERROR_MM, that which makes
the smallest squared error of the weighted differences, with each pair left out in turn;
followed fetuses give LASTING, a share with a uniform prior. Without any, it stays ½.

`--scores` adds distance (mm) and r of the shape index of the scaled start, the shape
with all of the smooth difference (`whole`), the atlas' own brain
with its volume (`atlas`) and the surface that is delivered (`delivered`), all before a
body follows the shape.
The last line is one JSON object.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import dolfinx_solver  # noqa: F401
import numpy as np
import pandas as pd
import petsc4py
from common import print_rows, r_shape_index

from gyriflow.compare.comparison import aligned_distances
from gyriflow.compare.placement import number_patches
from gyriflow.compare.shapes import align, prepare_for_comparison, scale_to_volume
from gyriflow.errors import InputError
from gyriflow.folding.elastic_fit import ElasticFit
from gyriflow.geometry.deformations import MatchedSurfaces, between_moved
from gyriflow.geometry.matching import faces_that_cross, match_surface, values_at
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import (
    Floats,
    TriangleMesh,
    vertex_areas,
    vertex_normals,
)
from gyriflow.growth.atlas_path import AtlasPath, resample_by_size
from gyriflow.growth.expected import (
    LASTING_GW,
    Expectation,
    Persistence,
    expected_positions,
    place_in_atlas,
)
from gyriflow.growth.fine_surfaces import (
    MIN_OWN_SHARE,
    ObservedSurface,
    finer_share,
    moved_surface,
    nearest_in_age,
)
from gyriflow.growth.series_shapes import SeriesShapes
from gyriflow.io.registrations import read_correspondence, read_weekly_shapes
from gyriflow.io.surfaces import read_pose, read_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.study.paths import ATLAS_PATH, MESH, PIAL, REGISTERED

PATCH_MM, REACH_MM = 15.0, 4.0
ERRORS_MM = np.arange(0.0, 1.01, 0.01)
SHARES = np.linspace(0.0, 1.0, 101)
FETUSES_SD = 0.2
"""Spread between fetuses of what is left of a difference."""


@dataclass(frozen=True, eq=False)
class Start:
    """A start brain, and the atlas that it is placed in."""

    study: Path
    name: str
    week: float
    first: str
    mesh: TetrahedralMesh
    path: AtlasPath
    carried: Floats
    surface: TriangleMesh

    @cached_property
    def ages(self) -> Any:
        """The atlas' ages by size."""
        return self.path.ages()

    @cached_property
    def grown(self) -> Floats:
        """The mesh as the atlas grows."""
        return resample_by_size(
            self.mesh,
            self.carried,
            self.ages.weeks,
            self.ages,
            self.path.knots(self.ages),
        )

    def predict(self, weeks: list[float], **options: Any) -> Expectation:
        """Return the predicted positions at weeks."""
        return expected_positions(
            self.mesh, self.week, self.grown, self.ages.weeks, weeks, **options
        )

    def boundary(self, positions: Floats) -> TriangleMesh:
        """Return the boundary of the mesh at some positions."""
        surface, used = boundary_surface(self.mesh)
        return TriangleMesh(positions[used], surface.faces)

    def atlas_surface(self, week: float, part: str = "whole") -> TriangleMesh:
        """Return a surface of the atlas' brain of a stated week."""
        name = f"{self.first.rsplit('-', 1)[0]}-{week:g}"
        return read_surface(self.study / PIAL[part].format(brain=name))

    def delivered(self, expected: Expectation, number: int) -> TriangleMesh:
        """Return the surface that is delivered at one of the predicted weeks."""
        week = float(expected.kept["week"][number - 1])
        shape = self.boundary(expected.positions[number])
        if finer_share(expected.kept, self.week, week) > MIN_OWN_SHARE:
            own = self.boundary(self.mesh.vertices).vertices
            return moved_surface(ObservedSurface(self.surface, own), shape)
        stated = self.stated_week(week)
        places = self.boundary(self.carried[self.path.shapes.weeks.index(stated)])
        observed = ObservedSurface(self.atlas_surface(stated), places.vertices)
        return moved_surface(observed, shape)

    def stated_week(self, week: float) -> float:
        """Return the stated week of the atlas' brain with the age by size nearest to a
        week."""
        weeks = self.ages.weeks.tolist()
        return float(weeks[nearest_in_age(self.ages.table(), weeks, week)])


def read_start(row: pd.Series) -> Start:
    """Return the start brain of a row of the table, placed in the atlas."""
    study = Path(row["study"])

    def file_of(pattern: str, **names: str) -> Path:
        return study / pattern.format(**names)

    mesh = read_tetrahedral_mesh(file_of(MESH["mesh"], brain=row["start"]))
    kept = read_weekly_shapes(file_of(ATLAS_PATH, brain=row["first"]))
    shapes = SeriesShapes(kept.weeks.tolist(), kept.positions, list(kept.stops))
    assert kept.tets is not None
    path = AtlasPath(kept.tets, shapes)
    brains = row["start"], row["near"]
    poses = [read_pose(file_of(PIAL["report"], brain=brain)).world for brain in brains]
    link = file_of(REGISTERED, earlier=row["start"], later=row["near"])
    pair = between_moved(read_correspondence(link), *poses)
    if isinstance(pair, MatchedSurfaces):
        raise InputError("the start is matched, not registered", path=link)
    week = float(row["near"].rsplit("-", 1)[1])
    inside = place_in_atlas(mesh, pair, path.mesh(week), ElasticFit, has_slits=True)
    return Start(
        study=study,
        name=row["start"],
        week=float(row["start_week"]),
        first=row["first"],
        mesh=mesh,
        path=path,
        carried=path.carry(inside, week),
        surface=read_surface(file_of(PIAL["whole"], brain=row["start"])),
    )


@dataclass(frozen=True, eq=False)
class Parts:
    """The atlas' boundary at a week, and the vertices' (m, 3) smooth and finer
    individual differences from it in mm, all of them kept."""

    atlas: TriangleMesh
    smooth: Floats
    finer: Floats
    difference_mm: float


def parts_of(start: Start, weeks: list[float]) -> list[Parts]:
    """Return the atlas and the parts of the individual difference at each week."""
    whole = start.predict(weeks, keep_all=True, fading_gw=np.inf).positions
    smooth_only = start.predict(weeks, keep_all=True, fading_gw=1e-6).positions
    expected = start.predict(weeks)
    found = []
    for number, kept in enumerate(expected.kept.to_dict("records"), 1):
        finer = whole[number] - smooth_only[number]
        # the atlas and a share of the smooth difference
        some = expected.positions[number] - kept["finer_share"] * finer
        smooth = (smooth_only[number] - some) / (1 - kept["smooth_share"])
        part = Parts(
            atlas=start.boundary(smooth_only[number] - smooth),
            smooth=start.boundary(smooth).vertices,
            finer=start.boundary(finer).vertices,
            difference_mm=kept["difference_mm"],
        )
        found.append(part)
    return found


def difference_left(parts: Parts, observed: TriangleMesh) -> dict[str, Any]:
    """Return what an observed brain has left of the start's smooth and finer individual
    difference, with standard errors."""
    atlas = parts.atlas
    normals = vertex_normals(atlas)
    areas = vertex_areas(atlas)
    target = align(observed, atlas)
    match = match_surface(atlas, target)
    offsets = values_at(match, target.vertices) - atlas.vertices
    found = (offsets * normals).sum(axis=1)
    weights = areas * (match.agrees & (match.distance_mm < REACH_MM))
    centred = atlas.vertices - np.average(atlas.vertices, axis=0, weights=areas)
    columns = [(part * normals).sum(axis=1) for part in (parts.smooth, parts.finer)]
    columns.append((centred * normals).sum(axis=1))
    design = np.column_stack([*columns, np.cross(centred, normals), normals])
    normal = np.linalg.inv(design.T @ (weights[:, None] * design))
    coefficients = normal @ (design.T @ (weights * found))
    residual = weights * (found - design @ coefficients)
    patches = number_patches(atlas.vertices, areas, PATCH_MM)
    scores = np.zeros((patches.max() + 1, design.shape[1]))
    np.add.at(scores, patches, design * residual[:, None])
    errors = np.sqrt(np.diag(normal @ (scores.T @ scores) @ normal))
    row = {"difference_mm": parts.difference_mm}
    for number, name in enumerate(("smooth", "finer")):
        row[name] = coefficients[number]
        row[f"{name}_error"] = errors[number]
    return row


def models_of(
    start: Start, weeks: list[float], stated_weeks: list[float]
) -> Iterator[dict[str, TriangleMesh]]:
    """Yield for each week the surfaces that are compared, with the atlas' brain of the
    stated week."""
    whole = start.predict(weeks, keep_all=True)
    kept = start.predict(weeks)
    first = start.boundary(start.mesh.vertices)
    for number, stated_week in enumerate(stated_weeks, 1):
        shape = start.boundary(whole.positions[number])
        atlas = start.atlas_surface(stated_week)
        yield {
            "scaled": scale_to_volume(first, shape),
            "whole": shape,
            "atlas": scale_to_volume(atlas, shape),
            "delivered": start.delivered(kept, number),
        }


def scores_of(
    surface: TriangleMesh, observed: TriangleMesh, folds: Any
) -> dict[str, Any]:
    """Return the distance in mm, r of the shape index and crossing faces."""
    return {
        "distance_mm": aligned_distances(surface, observed)["distance_mm"],
        "r_shape_index": r_shape_index(surface, observed, folds),
        "crossing_faces": len(faces_that_cross(surface)),
    }


def match_error(rows: pd.DataFrame) -> float:
    """Return the MATCH_ERROR_MM with the smallest squared error of the weighted smooth
    differences of pairs."""
    losses = []
    for error_mm in ERRORS_MM:
        loss = 0.0
        for row in rows.to_dict("records"):
            difference_mm = row["difference_mm"]
            kept = Persistence(difference_mm, match_error_mm=error_mm)
            weight = kept.weight(row["weeks_ahead"])
            miss = difference_mm * (weight - row["smooth"])
            loss += miss**2 / (1 + row["smooth_error"] ** 2)
        losses.append(loss)
    return float(ERRORS_MM[np.argmin(losses)])


def lasting_share(rows: pd.DataFrame, error_mm: float) -> tuple[float, float]:
    """Return mean and standard deviation of the share of differences that lasts, from
    followed fetuses, with a uniform prior."""
    logs = np.zeros(len(SHARES))
    for row in rows.to_dict("records"):
        # fetuses differ by more than the error of a regression
        variance = row["smooth_error"] ** 2 + FETUSES_SD**2
        for number, share in enumerate(SHARES):
            kept = Persistence(row["difference_mm"], share, error_mm)
            miss = kept.weight(row["weeks_ahead"]) - row["smooth"]
            logs[number] -= 0.5 * miss**2 / variance
    weights = np.exp(logs - logs.max())
    mean = float(np.average(SHARES, weights=weights))
    spread = float(np.sqrt(np.average((SHARES - mean) ** 2, weights=weights)))
    return mean, spread


def estimates(table: pd.DataFrame) -> dict[str, Any]:
    """Return the match error with its range when each start brain is left out, and the
    share that lasts."""
    averages = table[table["kind"] == "average"]
    followed = table[table["kind"] == "individual"]
    found: dict[str, Any] = {"lasting_gw": LASTING_GW}
    error_mm = match_error(averages) if len(averages) else np.nan
    left_out = []
    for pair in averages.index:
        left_out.append(match_error(averages.drop(index=pair)))
    found["match_error_mm"] = round(error_mm, 2)
    if left_out:
        found["match_error_left_out"] = [min(left_out), max(left_out)]
        for name in ("smooth", "finer"):
            values = averages[name]
            found[f"mean_{name}"] = round(float(values.mean()), 2)
            found[f"sd_{name}"] = round(float(values.std()), 2)
    known = error_mm if np.isfinite(error_mm) else 0.0
    mean, spread = lasting_share(followed, known)
    return found | {"lasting": round(mean, 2), "lasting_sd": round(spread, 2)}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pairs", type=Path)
    parser.add_argument("--scores", action="store_true", help="compare surfaces")
    arguments = parser.parse_args()
    # remeshing loads PETSc without initialising it
    petsc4py.init()
    pairs = pd.read_csv(arguments.pairs)
    rows: list[dict[str, Any]] = []
    left = []
    for _, group in pairs.groupby(["study", "start"], sort=False):
        start = read_start(group.iloc[0])
        scans = group.to_dict("records")
        weeks = [float(scan["week"]) for scan in scans]
        for scan, parts in zip(scans, parts_of(start, weeks), strict=True):
            labels = {name: scan[name] for name in ("start", "week", "kind")}
            labels["weeks_ahead"] = scan["week"] - start.week
            observed = read_surface(scan["observed"])
            left.append(labels | difference_left(parts, observed))
            print(left[-1], flush=True)
        models = models_of(start, weeks, weeks) if arguments.scores else iter(())
        for scan, surfaces in zip(scans, models, strict=False):
            observed = read_surface(scan["observed"])
            folds = prepare_for_comparison(observed, observed)
            for model, surface in surfaces.items():
                labels = {"start": scan["start"], "week": scan["week"], "model": model}
                rows.append(labels | scores_of(surface, observed, folds))
                print(rows[-1], flush=True)
    found = estimates(pd.DataFrame(left)) if left else {}
    print(pd.DataFrame(left).to_string(index=False, float_format="%.3f"))
    print_rows(rows, left=left, **found)


if __name__ == "__main__":
    main()
