"""Measure the fit of a brain's mesh to the later brains of its series, week by week:
time, misfit, and elements.

    ./run python benchmarks/series_fit.py FOLDER crl-{week:g} --weeks 23 24 25 \\
        --mesh path
    ./run python benchmarks/series_fit.py FOLDER crl-{week:g} --weeks 23 24 25 \\
        --states STATES
    ./run python benchmarks/series_fit.py FOLDER crl-{week:g} --weeks 23 24 25 \\
        --earlier STATES --begin 25

FOLDER is that of a study with the surfaces and registrations of the brains, and with
the mesh of the first: that of its simulations, or that of an atlas' path. The weeks
begin with that of the mesh. With `--states` the shapes up to each week are kept in a
folder; with `--earlier` and `--begin` those of the weeks before are taken from such a
folder, and only the rest is fitted. The last line is one JSON object: for each week
processor time, mean distance of the boundary from the observed surface and the quantile
at 95 % (mm), stops, smallest volume of an element and of a quadratic one's linear
pieces relative to the first week's, inverted elements and crossing faces.
"""

import argparse
import json
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import petsc4py
from common import print_rows

from gyriflow.folding.elastic_fit import ElasticFit
from gyriflow.geometry.deformations import Correspondence, between_moved
from gyriflow.geometry.matching import faces_that_cross
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_surface,
    has_volume,
    linear_pieces,
    volumes_between,
)
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.growth.series_shapes import SeriesShapes, follow_series, misfit_mm
from gyriflow.io.registrations import read_correspondence
from gyriflow.io.surfaces import read_pose, read_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.unfinished import UnfinishedSeries
from gyriflow.study.paths import MESH, PATH_MESH, PIAL, REGISTERED

MESHES = {"start": MESH["mesh"], "path": PATH_MESH["mesh"]}


class Measurement:
    """Rows of the weeks as they are made, and the state after each in a folder if there
    is one."""

    def __init__(
        self,
        mesh: TetrahedralMesh,
        surfaces: dict[float, TriangleMesh],
        folder: Path | None,
    ) -> None:
        self._mesh, self._surfaces, self._folder = mesh, surfaces, folder
        self._pieces = linear_pieces(mesh)
        self.rows: list[dict[str, Any]] = []
        self.begin_week()

    def begin_week(self) -> None:
        self._began = time.process_time()

    def end_week(self, shapes: SeriesShapes) -> None:
        """Add the row of the last of the shapes, and keep the state."""
        seconds = time.process_time() - self._began
        week, places, mesh = shapes.weeks[-1], shapes.positions[-1], self._mesh
        before = max(at for at in shapes.weeks[:-1] if at not in shapes.stops)
        boundary, used = boundary_surface(mesh)
        surface = TriangleMesh(places[used], boundary.faces)
        mean, far = misfit_mm(surface, self._surfaces[week])
        row = {"week": week, "cpu_s": seconds, "mean_mm": mean, "p95_mm": far}
        row["stops"] = sum(at > before for at in shapes.stops)
        ratios = volumes_between(places, self._pieces) / volumes_between(
            mesh.vertices, self._pieces
        )
        row |= {"least_ratio": ratios.min(), "below_0.1": (ratios < 0.1).sum()}
        row["inverted"] = int((~has_volume(places, mesh.tets)).sum())
        row["crossing"] = len(faces_that_cross(surface))
        self.rows.append({name: float(value) for name, value in row.items()})
        print(json.dumps(self.rows[-1]), flush=True)
        if self._folder:
            unfinished(self._folder, week).write(
                shapes.weeks, shapes.positions, shapes.stops
            )
        self.begin_week()


def unfinished(folder: Path, week: float) -> UnfinishedSeries:
    """Return the state of a week."""
    return UnfinishedSeries(folder / f"{week:g}")


def read_pair(folder: Path, earlier: str, later: str) -> Correspondence:
    """Return the registration of two brains that are given as labels, in the poses of
    their surfaces."""
    poses = [
        read_pose(folder / PIAL["report"].format(brain=brain)).world
        for brain in (earlier, later)
    ]
    return between_moved(
        read_correspondence(folder / REGISTERED.format(earlier=earlier, later=later)),
        *poses,
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("brains", metavar="BRAINS", help="for example crl-{week:g}")
    parser.add_argument("--weeks", type=float, nargs="+", required=True)
    parser.add_argument("--mesh", choices=MESHES, default="start")
    parser.add_argument(
        "--states", type=Path, help="folder for the state after each week"
    )
    parser.add_argument(
        "--earlier", type=Path, help="folder with the states of an earlier call"
    )
    parser.add_argument("--begin", type=float, help="first week that is fitted")
    arguments = parser.parse_args()
    names = [arguments.brains.format(week=week) for week in arguments.weeks]
    mesh = read_tetrahedral_mesh(
        arguments.folder / MESHES[arguments.mesh].format(brain=names[0])
    )
    surfaces = [
        read_surface(arguments.folder / PIAL["whole"].format(brain=name))
        for name in names[1:]
    ]
    pairs = [read_pair(arguments.folder, *pair) for pair in pairwise(names)]
    earlier = None
    if arguments.earlier:
        before = max(week for week in arguments.weeks if week < arguments.begin)
        state = unfinished(arguments.earlier, before).read()
        assert state, f"{arguments.earlier} has no state of {before:g} GW"
        earlier = SeriesShapes(*state)
    # reading surfaces loads PETSc without initialising it
    petsc4py.init()
    body = ElasticFit(mesh)
    later = dict(zip(arguments.weeks[1:], surfaces, strict=True))
    measured = Measurement(mesh, later, arguments.states)
    options: dict[str, Any] = {
        "has_slits": True,
        "earlier": earlier,
        "after_week": measured.end_week,
    }
    follow_series(mesh, arguments.weeks, pairs, surfaces, body, **options)
    total = sum(row["cpu_s"] for row in measured.rows)
    print_rows(measured.rows, elements=len(mesh.tets), cpu_seconds=total)


if __name__ == "__main__":
    main()
