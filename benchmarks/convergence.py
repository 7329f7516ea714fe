"""How much folding depends on the mesh: one smooth start, several resolutions, both orders of elements.

    ./run python benchmarks/convergence.py --folder FOLDER

A smooth hemisphere of 21 GW whose cortex and core grow, free, in contact with itself, is folded on meshes with so many
node distances at the surface to the cortical thickness, linear and quadratic elements alike, so that both orders have
about the same unknowns. The shape is the left half of the shipped atlas' brain of 21 GW, from labels smoothed more than
a study would, with shallow bumps of 8 to 24 mm, far higher than facets and mesh noise: every mesh starts from the same
imperfection. Every run carries the same surface along, which is measured; runs are compared with the finest one at the
same material points. A second mesh of the same resolution, made of the surface turned, shows what chance does.

Runs are done one at a time on one rank; what in FOLDER is done already is not done again. Each run prints a JSON line;
the last line is one JSON object with `runs` and the differences from the finest (`against_finest`) at the end.

    ./run python benchmarks/convergence.py --folder FOLDER --run MESH PARAMS [MAPS]

varies the tolerance of Newton's method and the time step of a study's run instead: `tolerances` and `run_steps` give
the error of positions at its end against the least of each.
"""

import argparse
import json
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyriflow.anatomy.extraction import smooth_mask
from gyriflow.anatomy.labels import read_cerebrum
from gyriflow.anatomy.pose import pose_of_hemisphere
from gyriflow.anatomy.repair import surface_of_mask
from gyriflow.compare.placement import correlation
from gyriflow.geometry.alignment import motion, rigid_fit, without_rigid_motion
from gyriflow.geometry.matching import match_points, nearest_on, surface_distance, values_at
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface, finer_surface
from gyriflow.geometry.triangles import TriangleMesh, transformed, vertex_areas, vertex_normals
from gyriflow.io.files import read_json
from gyriflow.io.frames import read_positions, read_tets
from gyriflow.io.tetmeshes import read_tetrahedral_mesh, write_tetrahedral_mesh
from gyriflow.io.volumes import read_label_volume
from gyriflow.io.yaml_files import SCHEMES, read_yaml, write_yaml
from gyriflow.mesh.tetrahedralisation import tetrahedralise
from gyriflow.metrics.measure import folding_metrics, measure_hemisphere, size_metrics, spectrum_metrics
from gyriflow.settings.terms import CURVATURE_RADIUS_MM

ROOT = Path(__file__).resolve().parents[1]
Floats = NDArray[np.float64]

LABELS = "atlases/spina-bifida/fetal_SB_atlas_GA21_notoperated/parcellation.nii.gz"
START_WEEK, END_WEEK = 21.0, 28.0
SMOOTHING_VOXELS = 2.0
BUMPS, BUMP_MM = 24, 0.15
"""Number of the waves, and the standard deviation of their sum."""
WAVELENGTHS_MM = (8.0, 24.0)
FINE_EDGE_MM = 0.6
"""Edges of the surface that all meshes hold."""
MEASURED_EDGE_MM = 1.0
"""Edges of the surface that is carried along by every run and measured, as those of a study."""
CORE = 1.6
"""Largest distance of nodes inside, in those at the surface: meshes differ by their scale only."""
ROTATION = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
"""Turns the surface while it is meshed: another mesh of the same resolution."""
ORDERS = {1: "linear", 2: "quadratic"}
NODES_TO_CORTEX = (1.41, 2.0, 2.83, 4.0)
"""Thickness over the distance of nodes at the surface: halved, elements to the cortex of quadratic ones."""
REPEATED = 2.0
"""The resolution at which a second mesh of quadratic elements is made."""
THICKNESS_MM = 2.0
DAY_S = 86400.0
PARAMETERS = {
    "start_week": START_WEEK,
    "end_week": END_WEEK,
    "output_weeks": [START_WEEK, END_WEEK],
    "step_s": DAY_S,
    "thickness_mm": THICKNESS_MM,
    "contact": {"kind": "global"},
    "fissure_x_mm": 0.0,
    # about as the atlas' areas and volumes grow from 21 to 29 GW, had nothing to be pressed together
    "growth_rate_per_s": 2.0e-7,
    "core_growth_rate_per_s": 0.8e-7,
    "support": "free",
    "no_growth": {"kind": "none"},
    "fields": ["displacement"],
}
COMPARED = (
    *("area", "volume", "gyrification_index", "mean_sulcal_depth", "sulcal_depth_95", "mean_curvedness"),
    *("folding_index", *(f"spangy_B{band}_relative_power" for band in range(1, 6))),
)
TOLERANCES, STEPS_DAYS = (1e-6, 1e-5, 1e-4, 1e-3), (0.25, 0.5, 1.0, 1.75)
"""Of Newton's method and in time, of a study's run."""


@cache
def start_surface() -> TriangleMesh:
    """Return the smooth hemisphere, closed and outward, in RAS+ mm."""
    volume, scheme = read_label_volume(ROOT / LABELS), SCHEMES["spina-bifida-atlas"]
    places = np.stack(np.indices(volume.labels.shape), axis=-1) @ volume.affine[:3, :3].T + volume.affine[:3, 3]
    x = places[..., 0]
    of_cerebrum = x[np.isin(volume.labels, scheme.cerebrum)]
    # half a voxel aside, since the middle lies on voxels
    left = np.where(x < (of_cerebrum.min() + of_cerebrum.max()) / 2 - volume.affine[0, 0] / 2, volume.labels, 0)
    cerebrum = read_cerebrum(left, volume.affine, scheme, 0.0)
    field = smooth_mask(cerebrum.mask, SMOOTHING_VOXELS)
    mesh = surface_of_mask(field, cerebrum.affine, cerebrum.volume_mm3, FINE_EDGE_MM).mesh
    smooth = transformed(mesh, pose_of_hemisphere(mesh, "left", "auto", of_volume=True).of_file())
    height = bumps(smooth.vertices)
    return TriangleMesh(smooth.vertices + height[:, None] * vertex_normals(smooth), smooth.faces)


def bumps(points: Floats) -> Floats:
    """Return the (n,) height in mm of the bumps: waves in directions spread evenly (a Fibonacci sphere)."""
    number = np.arange(BUMPS) + 0.5
    polar, azimuth = np.arccos(1 - 2 * number / BUMPS), np.pi * (1 + np.sqrt(5)) * number
    directions = np.stack([np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)], axis=1)
    phases = 2 * np.pi * (points @ directions.T) / np.linspace(*WAVELENGTHS_MM, BUMPS) + number**2
    return BUMP_MM * np.cos(phases).sum(axis=1) / np.sqrt(BUMPS / 2)


@dataclass(frozen=True)
class Case:
    """A mesh to be folded: order of its elements, node distances to the thickness, and whether it is the second one."""

    order: int
    nodes: float
    turned: bool = False

    @property
    def name(self) -> str:
        return f"{ORDERS[self.order]}-{self.nodes:g}{'-turned' if self.turned else ''}"


def mesh_of(surface: TriangleMesh, case: Case) -> TetrahedralMesh:
    """Return the mesh of a case."""
    rotation, spacing_mm = ROTATION if case.turned else np.eye(3), THICKNESS_MM / case.nodes
    mesh = tetrahedralise(
        transformed(surface, motion(rotation)),
        surface_edge_mm=spacing_mm,
        core_edge_mm=CORE * spacing_mm,
        envelope_mm=0.1,
        time_limit_s=1800,
        mesher="tetgen",
        order=case.order,
    )
    return TetrahedralMesh(mesh.vertices @ rotation, mesh.tets)


@dataclass(frozen=True, eq=False)
class Carried:
    """The measured surface as a run has moved it, with the mean curvature in 1/mm at its vertices, and metrics."""

    surface: TriangleMesh
    mean_curvature: Floats
    values: dict[str, float]


@cache
def measured_surface() -> TriangleMesh:
    """Return the start surface with the edges at which a study measures."""
    return remesh(start_surface(), MEASURED_EDGE_MM)


def carried(frames: Path, week: float) -> Carried:
    """Return the measured surface as a run has moved it by a week, with its metrics."""
    start = TetrahedralMesh(read_positions(frames, START_WEEK), read_tets(frames))
    own, nodes = boundary_surface(start)
    before, after, faces = own.vertices, read_positions(frames, week)[nodes], own.faces.astype(np.int64)
    if start.order == 2:
        matrix, faces = finer_surface(faces)
        before, after = matrix @ before, matrix @ after
    measured = measured_surface()
    match = match_points(measured.vertices, vertex_normals(measured), TriangleMesh(before, faces))
    surface = TriangleMesh(measured.vertices + values_at(match, after - before), measured.faces)
    side = measure_hemisphere("left", surface, None, CURVATURE_RADIUS_MM, "B5")
    metrics = size_metrics(surface, side.crossing) | folding_metrics([side]) | spectrum_metrics(side)
    return Carried(surface, side.bend.mean, metrics)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, required=True, help="for meshes and runs, which are kept")
    parser.add_argument("--run", type=Path, nargs="+", help="mesh and params.yaml of a run, with its maps.h5")
    parser.add_argument("--nodes", type=float, nargs="+", default=list(NODES_TO_CORTEX), help="to the thickness")
    return parser.parse_args()


def mesh_file(folder: Path, case: Case) -> Path:
    """Return the file of a case's mesh, made where it is not there."""
    file = folder / f"{case.name}.xdmf"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        write_tetrahedral_mesh(file, mesh_of(start_surface(), case))
    return file


def fold(mesh: Path, out: Path, parameters: dict[str, Any], *maps: Path) -> dict[str, Any]:
    """Return the summary of a run on one rank, done where it has not been; an interrupted one goes on."""
    if not (out / "summary.json").exists():
        out.mkdir(parents=True, exist_ok=True)
        write_yaml(out / "params.yaml", parameters)
        program = [sys.executable, "-m", "gyriflow.folding", str(mesh), "--params", str(out / "params.yaml")]
        program += [f"--maps={file}" for file in maps]
        with (out / "log").open("w") as log:
            done = subprocess.run([*program, "--out", str(out)], stdout=log, stderr=log, check=False)
        if done.returncode != 0:
            raise SystemExit(f"{out} failed: see its log")
    return read_json(out / "summary.json")


def resolution_runs(arguments: argparse.Namespace) -> dict[Case, dict[str, Any]]:
    """Fold all cases, coarse ones first; what their runs took."""
    cases = [Case(order, nodes) for nodes in sorted(arguments.nodes) for order in ORDERS]
    if REPEATED in arguments.nodes:
        cases.append(Case(2, REPEATED, turned=True))
    rows = {}
    for case in cases:
        mesh = mesh_file(arguments.folder / "meshes", case)
        summary = fold(mesh, arguments.folder / "runs" / case.name, PARAMETERS)
        size = {"nodes": len(read_tetrahedral_mesh(mesh).vertices), "elements_to_cortex": case.nodes / case.order}
        rows[case] = {"run": case.name, **size, **{key: summary[key] for key in summary if key != "weeks"}}
        print(json.dumps(rows[case]), flush=True)
    return rows


def difference(one: Carried, other: Carried, start: Carried) -> dict[str, float]:
    """Return how two runs differ at a week: places in mm at the same material points, surfaces, curvature, metrics."""
    areas = vertex_areas(other.surface)
    apart = without_rigid_motion(other.surface.vertices, one.surface.vertices, areas)
    moved = without_rigid_motion(start.surface.vertices, other.surface.vertices, areas)
    laid = transformed(one.surface, rigid_fit(one.surface.vertices, other.surface.vertices, areas))
    pairs = ((laid, other.surface), (other.surface, laid))
    ways = [(nearest_on(surface.vertices, far)[0], vertex_areas(surface)) for surface, far in pairs]
    distance, distance95 = surface_distance(ways)

    def rms(vectors: np.ndarray) -> float:
        return float(np.sqrt(np.average((vectors**2).sum(axis=1), weights=areas)))

    return {
        "displacement_rms_mm": rms(apart),
        "displacement_share": rms(apart) / rms(moved),
        "surface_distance_mm": distance,
        "surface_distance_95_mm": distance95,
        "r_mean_curvature": correlation(one.mean_curvature, other.mean_curvature, areas),
        **{name: one.values[name] - other.values[name] for name in COMPARED},
    }


def errors(
    varied: str, runs: dict[float, dict[str, Any]], folder: Path, mesh: Path, *maps: Path
) -> list[dict[str, Any]]:
    """Return the error of positions at the end of each run against the first, and what it took."""
    rows, exact = [], None
    for value, parameters in runs.items():
        out = folder / f"{value:g}"
        found = fold(mesh, out, parameters, *maps)
        ends = parameters["start_week"], parameters["end_week"]
        before, after = (read_positions(out / "frames.h5", week) for week in ends)
        exact = after if exact is None else exact
        apart, moved = np.linalg.norm(after - exact, axis=1), np.linalg.norm(exact - before, axis=1)
        row = {varied: value} | {name: found[name] for name in ("steps", "newton", "krylov", "cpu_seconds")}
        row |= {"rms_mm": float(np.sqrt((apart**2).mean())), "mean_mm": float(apart.mean())}
        row |= {"p95_mm": float(np.quantile(apart, 0.95)), "largest_mm": float(apart.max())}
        rows.append(row | {"share": row["rms_mm"] / float(np.sqrt((moved**2).mean()))})
        print(json.dumps(rows[-1]), flush=True)
    return rows


def solver_errors(arguments: argparse.Namespace) -> dict[str, list[dict[str, Any]]]:
    """Return the errors that tolerance and time step of a study's run leave, against its least of each."""
    mesh, file, *maps = arguments.run
    given = read_yaml(file)
    solver = given["solver"]
    tolerances = {value: given | {"solver": solver | {"newton_tolerance": value}} for value in TOLERANCES}
    steps = {days: given | {"step_s": days * DAY_S} for days in STEPS_DAYS}
    return {
        "run_steps": errors("step_days", steps, arguments.folder / "run_steps", mesh, *maps),
        "tolerances": errors("newton_tolerance", tolerances, arguments.folder / "tolerances", mesh, *maps),
    }


def against_finest(arguments: argparse.Namespace, cases: list[Case]) -> list[dict[str, Any]]:
    """Return how all runs differ from the finest at the end."""
    finest = max((case for case in cases if not case.turned), key=lambda case: (case.nodes, case.order))
    frames = {case: arguments.folder / "runs" / case.name / "frames.h5" for case in cases}
    start, exact = carried(frames[finest], START_WEEK), carried(frames[finest], END_WEEK)
    return [
        {"run": case.name, "finest": finest.name} | difference(carried(frames[case], END_WEEK), exact, start)
        for case in cases
        if case is not finest
    ]


def main(arguments: argparse.Namespace) -> None:
    if arguments.run:
        result: dict[str, Any] = solver_errors(arguments)
    else:
        runs = resolution_runs(arguments)
        result = {"runs": list(runs.values()), "against_finest": against_finest(arguments, list(runs))}
    print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main(parse())
