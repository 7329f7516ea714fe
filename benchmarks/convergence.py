"""Measure how the folds of a brain depend on the mesh, the order of the elements and
the time step.

    ./run python benchmarks/convergence.py --folder FOLDER
    ./run python benchmarks/convergence.py --folder FOLDER \\
        --only quadratic-1.41-1-days --end-week 32

The left half of the shipped atlas brain of 21 GW is folded with the paper's thickness,
stiffness and growth, the same everywhere, free and in contact with itself, until its
gyrification index is 1.3. Resolution is the number of node distances per cortical
thickness. Four meshes of quadratic elements and one of linear elements are folded with
time steps of a day, one of the quadratic ones also with two days. Every run carries the
same surface, which is measured and compared with that of the finest run at the same
material points.

Runs are done one after another on one rank; finished runs in FOLDER are not repeated.
Each run prints a JSON line. The last line is one JSON object with `runs`, the values of
the finest one and the differences from it (`against_finest`). With `--only` some runs
are done and nothing is compared: to another `--end-week`, with another rate of growth
of the core (`--core-growth`), or with a multiple of the contact distance
(`--contact-distance`). Give such runs a folder of their own.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from gyriflow.anatomy.extraction import smooth_mask
from gyriflow.anatomy.labels import read_cerebrum
from gyriflow.anatomy.pose import pose_of_hemisphere
from gyriflow.anatomy.repair import surface_of_mask
from gyriflow.compare.placement import correlation
from gyriflow.geometry.alignment import align_points, rigid_fit
from gyriflow.geometry.matching import (
    match_points,
    nearest_on,
    surface_distance,
    values_at,
)
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_surface,
    finer_surface,
)
from gyriflow.geometry.triangles import (
    Floats,
    TriangleMesh,
    transformed,
    vertex_areas,
    vertex_normals,
)
from gyriflow.io.files import read_json
from gyriflow.io.frames import read_positions, read_tets, read_weeks
from gyriflow.io.tetmeshes import read_tetrahedral_mesh, write_tetrahedral_mesh
from gyriflow.io.volumes import read_label_volume
from gyriflow.io.yaml_files import SCHEMES, write_yaml
from gyriflow.mesh.tetrahedralisation import tetrahedralise
from gyriflow.metrics.measure import folding_metrics, measure_folds, size_metrics
from gyriflow.settings.terms import CURVATURE_RADIUS_MM
from gyriflow.shipped import ATLASES

LABELS = (
    ATLASES / "spina-bifida" / "fetal_SB_atlas_GA21_notoperated" / "parcellation.nii.gz"
)
START_WEEK, END_WEEK, OUTPUTS_A_WEEK = 21.0, 30.0, 2
CORE_GROWTH_PER_S = 0.8e-7
END_GI = 1.3
"""Gyrification index of the finest run at which all runs are compared."""
SURFACE_EDGE_MM = 0.6
"""Edge length of the surface that all meshes are made from."""
MEASURED_EDGE_MM = 1.0
"""Edge length of the surface that every run carries and that is measured, as in a
study."""
CORE_FACTOR = 1.6
"""Node distance inside over that at the surface: meshes differ only in scale."""
FOLD = """
import runpy, sys
from gyriflow.folding import contact
factor = float(sys.argv.pop(1))
contact.DISTANCE_PER_MEAN_EDGE *= factor
contact.DISTANCE_PER_SHORT_EDGE *= factor
runpy.run_module("gyriflow.folding", run_name="__main__", alter_sys=True)
"""
"""Program that folds with a multiple of the contact distance, its first argument."""
ORDERS = {1: "linear", 2: "quadratic"}
THICKNESS_MM = 1.5
DAY_S = 86400.0
PARAMETERS = {
    "start_week": START_WEEK,
    "thickness_mm": THICKNESS_MM,
    "shear_modulus_cortex_pa": 1500.0,
    "shear_modulus_core_pa": 300.0,
    "contact": "global",
    "fissure_x_mm": 0.0,
    "growth_rate_per_s": 2.0e-7,
    "support": "free",
    "fields": ["displacement"],
}
COMPARED = (
    "area",
    "gyrification_index",
    "mean_curvedness",
    "mean_sulcal_depth",
    "sulcal_depth_95",
    "folding_index",
)


@cache
def start_surface() -> TriangleMesh:
    """Return the surface of the hemisphere, closed and outward, in RAS+ mm."""
    volume, scheme = read_label_volume(LABELS), SCHEMES["spina-bifida-atlas"]
    places = (
        np.stack(np.indices(volume.labels.shape), axis=-1) @ volume.affine[:3, :3].T
        + volume.affine[:3, 3]
    )
    x = places[..., 0]
    cerebrum_x = x[np.isin(volume.labels, scheme.cerebrum)]
    # shifted by half a voxel, since the middle lies on voxel centres
    left = np.where(
        x < (cerebrum_x.min() + cerebrum_x.max()) / 2 - volume.affine[0, 0] / 2,
        volume.labels,
        0,
    )
    cerebrum = read_cerebrum(left, volume.affine, scheme, 0.0)
    mesh = surface_of_mask(
        smooth_mask(cerebrum.mask),
        cerebrum.affine,
        cerebrum.volume_mm3,
        SURFACE_EDGE_MM,
    ).mesh
    return transformed(
        mesh, pose_of_hemisphere(mesh, "left", "auto", of_volume=True).of_file()
    )


@dataclass(frozen=True)
class Case:
    """A run: element order, node distances per cortical thickness, and the time step in
    days."""

    order: int
    nodes: float
    step_days: float = 1.0

    @property
    def mesh_name(self) -> str:
        return f"{ORDERS[self.order]}-{self.nodes:g}"

    @property
    def name(self) -> str:
        return f"{self.mesh_name}-{self.step_days:g}-days"


FINEST = Case(2, 2.83)
CASES = (
    FINEST,
    Case(2, 1.41),
    Case(2, 2.0),
    Case(1, 2.0),
    Case(2, 2.0, 2.0),
    Case(2, 2.4),
)


def mesh_of(surface: TriangleMesh, case: Case) -> TetrahedralMesh:
    """Return the mesh of a case."""
    spacing_mm = THICKNESS_MM / case.nodes
    return tetrahedralise(
        surface,
        surface_edge_mm=spacing_mm,
        core_edge_mm=CORE_FACTOR * spacing_mm,
        time_limit_s=1800,
        mesher="tetgen",
        order=case.order,
    )


@dataclass(frozen=True, eq=False)
class CarriedSurface:
    """The measured surface moved by a run, its shape index at the vertices, and its
    metrics."""

    surface: TriangleMesh
    shape_index: Floats
    values: dict[str, float]


@cache
def measured_surface() -> TriangleMesh:
    """Return the start surface, remeshed with the edge length of a study's surfaces."""
    return remesh(start_surface(), MEASURED_EDGE_MM)


def carry_surface(frames: Path, week: float) -> CarriedSurface:
    """Return the measured surface as a run moved it until a week, with its metrics."""
    start = TetrahedralMesh(read_positions(frames, START_WEEK), read_tets(frames))
    boundary, nodes = boundary_surface(start)
    before = boundary.vertices
    after = read_positions(frames, week)[nodes]
    faces = boundary.faces.astype(np.int64)
    if start.order == 2:
        matrix, faces = finer_surface(faces)
        before, after = matrix @ before, matrix @ after
    mesh = measured_surface()
    match = match_points(
        mesh.vertices, vertex_normals(mesh), TriangleMesh(before, faces)
    )
    surface = TriangleMesh(mesh.vertices + values_at(match, after - before), mesh.faces)
    side = measure_folds(surface, CURVATURE_RADIUS_MM)
    metrics = size_metrics(surface) | folding_metrics([side])
    return CarriedSurface(surface, side.curvature_maps.shape_index, metrics)


def mesh_file(folder: Path, case: Case) -> Path:
    """Return the file of a case's mesh; make the mesh if the file does not exist."""
    file = folder / f"{case.mesh_name}.xdmf"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        write_tetrahedral_mesh(file, mesh_of(start_surface(), case))
    return file


def fold(
    mesh: Path, out: Path, parameters: dict[str, Any], contact_distance: float
) -> dict[str, Any]:
    """Run a simulation on one rank unless it is finished, and return its summary.
    Interrupted runs are resumed."""
    if not (out / "summary.json").exists():
        out.mkdir(parents=True, exist_ok=True)
        write_yaml(out / "params.yaml", parameters)
        program = [
            sys.executable,
            "-c",
            FOLD,
            str(contact_distance),
            str(mesh),
            "--params",
            str(out / "params.yaml"),
        ]
        with (out / "log").open("w") as log:
            done = subprocess.run(
                [*program, "--out", str(out)], stdout=log, stderr=log, check=False
            )
        if done.returncode != 0:
            raise SystemExit(f"{out} failed: see its log")
    return read_json(out / "summary.json")


def parameters_until(end_week: float, core_growth_per_s: float) -> dict[str, Any]:
    """Return the parameters of runs to a week, with the growth of the core, without a
    time step."""
    n_outputs = int((end_week - START_WEEK) * OUTPUTS_A_WEEK) + 1
    weeks = np.linspace(START_WEEK, end_week, n_outputs).tolist()
    return PARAMETERS | {
        "end_week": end_week,
        "output_weeks": weeks,
        "core_growth_rate_per_s": core_growth_per_s,
    }


def runs_of_cases(
    folder: Path,
    cases: Sequence[Case],
    parameters: dict[str, Any],
    contact_distance: float,
) -> list[dict[str, Any]]:
    """Fold all cases, and return the size and cost of each run."""
    rows = []
    for case in cases:
        mesh = mesh_file(folder / "meshes", case)
        summary = fold(
            mesh,
            folder / "runs" / case.name,
            parameters | {"step_s": case.step_days * DAY_S},
            contact_distance,
        )
        nodes = len(read_tetrahedral_mesh(mesh).vertices)
        rows.append(
            {
                "run": case.name,
                "nodes": nodes,
                **{key: summary[key] for key in summary if key != "weeks"},
            }
        )
        print(json.dumps(rows[-1]), flush=True)
    return rows


def difference(
    run: CarriedSurface, reference: CarriedSurface, start: CarriedSurface
) -> dict[str, float]:
    """Return how a run differs from a reference: material points and surfaces (mm),
    shape index, metrics (relative)."""
    areas = vertex_areas(reference.surface)
    places, before = reference.surface.vertices, start.surface.vertices
    gaps = align_points(run.surface.vertices, places, areas) - places
    displacements = align_points(places, before, areas) - before
    aligned = transformed(
        run.surface, rigid_fit(run.surface.vertices, reference.surface.vertices, areas)
    )
    pairs = ((aligned, reference.surface), (reference.surface, aligned))
    distances = [
        (nearest_on(source.vertices, target)[0], vertex_areas(source))
        for source, target in pairs
    ]
    distance, distance95 = surface_distance(distances)

    def rms(vectors: Floats) -> float:
        return float(np.sqrt(np.average((vectors**2).sum(axis=1), weights=areas)))

    return {
        "displacement_rms_mm": rms(gaps),
        "displacement_share": rms(gaps) / rms(displacements),
        "surface_distance_mm": distance,
        "surface_distance_95_mm": distance95,
        "r_shape_index": correlation(run.shape_index, reference.shape_index, areas),
        "crossing_faces": run.values["crossing_faces"],
        **{name: run.values[name] / reference.values[name] - 1 for name in COMPARED},
    }


def against_finest(folder: Path) -> dict[str, Any]:
    """Return how all runs differ from the finest one, in the first week when that
    reaches `END_GI`."""
    frames = {case: folder / "runs" / case.name / "frames.h5" for case in CASES}
    start = carry_surface(frames[FINEST], START_WEEK)
    for week in read_weeks(frames[FINEST]):
        exact = carry_surface(frames[FINEST], week)
        if exact.values["gyrification_index"] >= END_GI:
            break
    values = {"week": week} | {
        name: exact.values[name] for name in (*COMPARED, "crossing_faces")
    }
    cases = [
        case
        for case in CASES
        if case is not FINEST and week in read_weeks(frames[case])
    ]
    rows = [
        {"run": case.name} | difference(carry_surface(frames[case], week), exact, start)
        for case in cases
    ]
    return {"finest": {"run": FINEST.name} | values, "against_finest": rows}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--folder", type=Path, required=True, help="folder of meshes and runs"
    )
    parser.add_argument(
        "--only",
        nargs="+",
        choices=[case.name for case in CASES],
        help="runs that are done",
    )
    parser.add_argument("--end-week", type=float, default=END_WEEK)
    parser.add_argument(
        "--core-growth", type=float, default=CORE_GROWTH_PER_S, help="rate (1/s)"
    )
    parser.add_argument(
        "--contact-distance", type=float, default=1.0, help="multiple of the default"
    )
    arguments = parser.parse_args()
    folder, distance = arguments.folder, arguments.contact_distance
    parameters = parameters_until(arguments.end_week, arguments.core_growth)
    if arguments.only:
        cases = [case for case in CASES if case.name in arguments.only]
        runs_of_cases(folder, cases, parameters, distance)
        return
    runs = runs_of_cases(folder, CASES, parameters, distance)
    print(json.dumps({"runs": runs, **against_finest(folder)}), flush=True)


if __name__ == "__main__":
    main()
