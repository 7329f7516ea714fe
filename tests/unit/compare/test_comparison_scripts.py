"""What the script that compares a run with observed brains writes of several weeks."""

from types import SimpleNamespace

import numpy as np
import pytest
from scripts import run_script
from shapes import ellipsoid_mesh

from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, area
from gyriflow.io.files import read_table
from gyriflow.io.registrations import WeeklyShapes, write_weekly_shapes
from gyriflow.io.surfaces import write_surface, write_vertex_maps
from gyriflow.io.tetmeshes import write_tetrahedral_mesh
from gyriflow.metrics.curvature import curvature

from .bumpy import bumpy


def smaller(mesh):
    """Return a surface of 0.6 times the lengths, which has fewer even triangles."""
    return TriangleMesh(0.6 * mesh.vertices, mesh.faces)


def test_a_run_is_compared_with_the_observed_brain_of_each_week(tmp_path):
    """The run is the observed brain of each week; the start has the opposite folds, the
    brain before equal ones."""
    weeks = (22.0, 24.0)
    observed = [smaller(bumpy(seed)) for seed in (1, 2)]
    inputs = {
        name: ["22.0.gii", "24.0.gii"]
        for name in ("whole", "simulated", "observed", "start", "adjacent")
    }
    for name, sign in {"observed": 1, "start": -1, "adjacent": 1}.items():
        inputs[f"{name}_maps"] = [f"{name}-{week}.gii" for week in weeks]
        for week, surface in zip(weeks, observed, strict=True):
            write_surface(tmp_path / f"{week}.gii", surface)
            bend = curvature(surface, radius_mm=3.0)
            maps = {
                "mean_curvature": sign * bend.mean,
                "shape_index": sign * bend.shape_index,
            }
            write_vertex_maps(tmp_path / f"{name}-{week}.gii", maps)
    params = {
        "run": "thin",
        "kind": "explained",
        "start_week": 21.0,
        "curvature_radius_mm": 3.0,
    }
    params |= {"weeks": weeks, "observed": ["b22", "b24"]}
    job = {"params": params, "wildcards": SimpleNamespace(brain="b21")}
    run_script("validation.py", tmp_path, inputs, {"table": "validation.csv"}, **job)
    table = read_table(tmp_path / "validation.csv")
    assert table[
        ["run", "kind", "start", "observed", "week", "horizon"]
    ].to_numpy().tolist() == [
        ["thin", "explained", "b21", f"b{week:g}", week, week - 21] for week in weeks
    ]
    assert table["observed_area_cm2"].tolist() == pytest.approx(
        [area(surface) / 100 for surface in observed]
    )
    assert (
        table["distance_mm"].max() < 0.1,
        table["volume_difference"].abs().max() < 1e-6,
    ) == (True, True)
    assert table["r_start_shape_index"].tolist() == pytest.approx([-1, -1])
    assert table["r_adjacent_mean_curvature"].tolist() == pytest.approx([1, 1])
    # curvature of another radius is another one
    assert table["r_mean_curvature"].tolist() == pytest.approx([1, 1], abs=0.002)


def test_predictions_without_mechanics_are_those_of_their_week(tmp_path):
    """The brain grows by 10 % a week, along the path that the run follows."""
    mesh = ellipsoid_mesh(8, (12.0, 14.0, 13.0))
    boundary, used = boundary_surface(mesh)
    weeks = np.array([21.0, 22.0, 23.0])
    positions = [mesh.vertices * factor for factor in (1.0, 1.1, 1.21)]
    # the registered atlas grows by half as much
    atlas = [boundary.vertices * factor for factor in (1.0, 1.05, 1.1)]
    write_weekly_shapes(
        tmp_path / "targets.h5",
        WeeklyShapes(
            weeks, np.stack(positions), surfaces={"atlas": atlas}, tets=mesh.tets
        ),
    )
    write_tetrahedral_mesh(tmp_path / "mesh.xdmf", mesh)
    observed = TriangleMesh(positions[1][used], boundary.faces)
    write_surface(tmp_path / "observed.gii", observed)
    bend = curvature(observed, radius_mm=3.0)
    write_vertex_maps(
        tmp_path / "maps.gii",
        {"mean_curvature": bend.mean, "shape_index": bend.shape_index},
    )
    inputs = {"targets": "targets.h5", "mesh": "mesh.xdmf", "atlas": []}
    for name in ("whole", "simulated", "observed", "start", "adjacent"):
        inputs |= {name: ["observed.gii"], f"{name}_maps": ["maps.gii"]}
    params = {
        "run": "atlas",
        "kind": "predicted",
        "start_week": 21.0,
        "curvature_radius_mm": 3.0,
        "of_atlas": True,
        "atlas_weeks": [],
        "weeks": [22.0],
        "observed": ["b22"],
    }
    job = {"params": params, "wildcards": SimpleNamespace(brain="b21")}
    run_script("validation.py", tmp_path, inputs, {"table": "validation.csv"}, **job)
    table = read_table(tmp_path / "validation.csv").set_index("model")
    assert set(table.index) == {"run", "target", "scaled", "atlas"}
    # all are scaled to the volume of the target of this week, of which they are copies
    assert table["distance_mm"].max() < 0.01
    assert table["area_difference"].abs().max() < 1e-4
