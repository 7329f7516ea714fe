"""Measure how folding depends on the mesh: one smooth start surface, several resolutions, both element orders.

    ./run python benchmarks/convergence.py --folder FOLDER

A smooth hemisphere of 21 GW is folded on meshes of several resolutions. Its cortex and core grow; it is free and in
contact with itself. Resolution is the number of node distances per cortical thickness, so linear and quadratic meshes
have about the same number of unknowns. The shape is the left half of the shipped atlas brain of 21 GW, from labels
smoothed more than in a study. It gets shallow bumps of 8 to 24 mm, far higher than facets and mesh noise, so every mesh
starts from the same imperfection. Every run carries the same surface, which is measured, and is compared with the
finest run at the same material points. A second mesh of the same resolution, of the rotated surface, shows how much is
chance.

Runs are done one after another on one rank; finished runs in FOLDER are not repeated. Each run prints a JSON line. The
last line is one JSON object with `runs` and the differences from the finest run (`against_finest`).

    ./run python benchmarks/convergence.py --folder FOLDER --run MESH PARAMS [MAPS]

varies the Newton tolerance and the time step of a study's run instead: `tolerances` and `run_steps` give the error of
its final positions, relative to the run with the smallest value.
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
"""Number of waves, and the standard deviation of their sum."""
WAVELENGTHS_MM = (8.0, 24.0)
FINE_EDGE_MM = 0.6
"""Edge length of the surface that all meshes are made from."""
MEASURED_EDGE_MM = 1.0
"""Edge length of the surface that every run carries and that is measured, as in a study."""
CORE_FACTOR = 1.6
"""Node distance inside over that at the surface: meshes differ only in scale."""
ROTATION = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
"""Rotation of the surface during meshing, which gives another mesh of the same resolution."""
ORDERS = {1: "linear", 2: "quadratic"}
NODES_TO_CORTEX = (1.41, 2.0, 2.83, 4.0)
"""Cortical thickness over the node distance at the surface; quadratic elements per thickness are half as many."""
REPEATED = 2.0
"""Resolution of the second mesh of quadratic elements."""
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
    # about the growth of the atlas' areas and volumes from 21 to 29 GW, if nothing were compressed
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
"""Newton tolerances and time steps to try with a study's run, the most accurate first."""


@cache
def start_surface() -> TriangleMesh:
    """Return the smooth hemisphere, closed and outward, in RAS+ mm."""
    volume, scheme = read_label_volume(ROOT / LABELS), SCHEMES["spina-bifida-atlas"]
    places = np.stack(np.indices(volume.labels.shape), axis=-1) @ volume.affine[:3, :3].T + volume.affine[:3, 3]
    x = places[..., 0]
    cerebrum_x = x[np.isin(volume.labels, scheme.cerebrum)]
    # shifted by half a voxel, since the middle lies on voxel centres
    left = np.where(x < (cerebrum_x.min() + cerebrum_x.max()) / 2 - volume.affine[0, 0] / 2, volume.labels, 0)
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
    """A mesh to fold: element order, node distances per cortical thickness, and whether the surface was rotated."""

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
        core_edge_mm=CORE_FACTOR * spacing_mm,
        envelope_mm=0.1,
        time_limit_s=1800,
        mesher="tetgen",
        order=case.order,
    )
    return TetrahedralMesh(mesh.vertices @ rotation, mesh.tets)


@dataclass(frozen=True, eq=False)
class Carried:
    """The measured surface moved by a run, the mean curvature (1/mm) at its vertices, and its metrics."""

    surface: TriangleMesh
    mean_curvature: Floats
    values: dict[str, float]


@cache
def measured_surface() -> TriangleMesh:
    """Return the start surface, remeshed with the edge length of a study's surfaces."""
    return remesh(start_surface(), MEASURED_EDGE_MM)


def carried(frames: Path, week: float) -> Carried:
    """Return the measured surface as a run moved it until a week, with its metrics."""
    start = TetrahedralMesh(read_positions(frames, START_WEEK), read_tets(frames))
    boundary, nodes = boundary_surface(start)
    before, after, faces = boundary.vertices, read_positions(frames, week)[nodes], boundary.faces.astype(np.int64)
    if start.order == 2:
        matrix, faces = finer_surface(faces)
        before, after = matrix @ before, matrix @ after
    mesh = measured_surface()
    match = match_points(mesh.vertices, vertex_normals(mesh), TriangleMesh(before, faces))
    surface = TriangleMesh(mesh.vertices + values_at(match, after - before), mesh.faces)
    side = measure_hemisphere("left", surface, None, CURVATURE_RADIUS_MM, "B5")
    metrics = size_metrics(surface, side.crossing) | folding_metrics([side]) | spectrum_metrics(side)
    return Carried(surface, side.curvature_maps.mean, metrics)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, required=True, help="folder of meshes and runs")
    parser.add_argument("--run", type=Path, nargs="+", help="mesh, params.yaml and, if there is one, maps.h5 of a run")
    parser.add_argument(
        "--nodes", type=float, nargs="+", default=list(NODES_TO_CORTEX), help="node distances per cortical thickness"
    )
    return parser.parse_args()


def mesh_file(folder: Path, case: Case) -> Path:
    """Return the file of a case's mesh; make the mesh if the file does not exist."""
    file = folder / f"{case.name}.xdmf"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        write_tetrahedral_mesh(file, mesh_of(start_surface(), case))
    return file


def fold(mesh: Path, out: Path, parameters: dict[str, Any], *maps: Path) -> dict[str, Any]:
    """Run a simulation on one rank unless it is finished, and return its summary. Interrupted runs are resumed."""
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
    """Fold all cases, coarse ones first, and return the size and cost of each run."""
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


def difference(run: Carried, reference: Carried, start: Carried) -> dict[str, float]:
    """Return how a run differs from a reference at a week: material points and surfaces (mm), curvature, metrics."""
    areas = vertex_areas(reference.surface)
    gaps = without_rigid_motion(reference.surface.vertices, run.surface.vertices, areas)
    displacements = without_rigid_motion(start.surface.vertices, reference.surface.vertices, areas)
    aligned = transformed(run.surface, rigid_fit(run.surface.vertices, reference.surface.vertices, areas))
    pairs = ((aligned, reference.surface), (reference.surface, aligned))
    distances = [(nearest_on(source.vertices, target)[0], vertex_areas(source)) for source, target in pairs]
    distance, distance95 = surface_distance(distances)

    def rms(vectors: np.ndarray) -> float:
        return float(np.sqrt(np.average((vectors**2).sum(axis=1), weights=areas)))

    return {
        "displacement_rms_mm": rms(gaps),
        "displacement_share": rms(gaps) / rms(displacements),
        "surface_distance_mm": distance,
        "surface_distance_95_mm": distance95,
        "r_mean_curvature": correlation(run.mean_curvature, reference.mean_curvature, areas),
        **{name: run.values[name] - reference.values[name] for name in COMPARED},
    }


def errors(
    varied: str, runs: dict[float, dict[str, Any]], folder: Path, mesh: Path, *maps: Path
) -> list[dict[str, Any]]:
    """Return the error of each run's final positions, relative to the first run, and its cost."""
    rows, exact = [], None
    for value, parameters in runs.items():
        out = folder / f"{value:g}"
        found = fold(mesh, out, parameters, *maps)
        ends = parameters["start_week"], parameters["end_week"]
        before, after = (read_positions(out / "frames.h5", week) for week in ends)
        exact = after if exact is None else exact
        gaps, moved = np.linalg.norm(after - exact, axis=1), np.linalg.norm(exact - before, axis=1)
        row = {varied: value} | {name: found[name] for name in ("steps", "newton", "krylov", "cpu_seconds")}
        row |= {"rms_mm": float(np.sqrt((gaps**2).mean())), "mean_mm": float(gaps.mean())}
        row |= {"p95_mm": float(np.quantile(gaps, 0.95)), "largest_mm": float(gaps.max())}
        rows.append(row | {"share": row["rms_mm"] / float(np.sqrt((moved**2).mean()))})
        print(json.dumps(rows[-1]), flush=True)
    return rows


def solver_errors(arguments: argparse.Namespace) -> dict[str, list[dict[str, Any]]]:
    """Return the errors due to the Newton tolerance and the time step of a study's run."""
    mesh, file, *maps = arguments.run
    values = read_yaml(file)
    solver = values["solver"]
    tolerances = {value: values | {"solver": solver | {"newton_tolerance": value}} for value in TOLERANCES}
    steps = {days: values | {"step_s": days * DAY_S} for days in STEPS_DAYS}
    return {
        "run_steps": errors("step_days", steps, arguments.folder / "run_steps", mesh, *maps),
        "tolerances": errors("newton_tolerance", tolerances, arguments.folder / "tolerances", mesh, *maps),
    }


def against_finest(arguments: argparse.Namespace, cases: list[Case]) -> list[dict[str, Any]]:
    """Return how all runs differ from the finest run at the end."""
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
