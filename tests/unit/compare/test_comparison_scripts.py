"""What the script that compares a run with observed brains writes of several weeks."""

from types import SimpleNamespace

import numpy as np
import pytest
from scripts import run_script
from shapes import FAR, ellipsoid_mesh, rigid

from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    signed_volume,
    transformed,
)
from gyriflow.io.files import read_table
from gyriflow.io.registrations import WeeklyShapes, write_weekly_shapes
from gyriflow.io.surfaces import (
    read_surface,
    read_vertex_maps,
    write_surface,
    write_vertex_maps,
)
from gyriflow.io.tetmeshes import write_tetrahedral_mesh
from gyriflow.metrics.curvature import curvature

from .bumpy import bumpy


def smaller(mesh):
    """Return a surface of 0.6 times the lengths, which has fewer even triangles."""
    return TriangleMesh(0.6 * mesh.vertices, mesh.faces)


@pytest.mark.usefixtures("recorded_outputs")
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


@pytest.mark.usefixtures("recorded_outputs")
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


@pytest.mark.usefixtures("recorded_outputs")
@pytest.mark.remeshed
def test_surfaces_are_prepared_for_the_observed_brain_each_under_its_name(tmp_path):
    surfaces = {
        "observed": bumpy(1),
        "start": bumpy(2, height=0.5),
        "adjacent": bumpy(3, height=1.5),
    }
    pose = rigid(0.0, 20.0, 0.0, shift=(3.0, 8.0, -4.0))
    for name, surface in surfaces.items():
        # start and neighbour lie elsewhere and are smaller
        given = surface
        if name != "observed":
            given = transformed(
                TriangleMesh(0.9 * surface.vertices, surface.faces), pose
            )
        write_surface(tmp_path / f"{name}.gii", given)
    inputs = {name: f"{name}.gii" for name in surfaces}
    outputs = {name: f"prepared-{name}.gii" for name in surfaces}
    outputs |= {f"{name}_maps": f"maps-{name}.gii" for name in surfaces}
    params = {"curvature_radius_mm": 4.0}
    run_script("prepared_surfaces.py", tmp_path, inputs, outputs, params)
    for name, surface in surfaces.items():
        mesh = read_surface(tmp_path / f"prepared-{name}.gii")
        # of the size of the observed brain, and with the folds of its own
        expected = signed_volume(surfaces["observed"])
        assert signed_volume(mesh) == pytest.approx(expected, rel=0.01)
        maps = read_vertex_maps(tmp_path / f"maps-{name}.gii")
        bend = curvature(mesh, radius_mm=4.0)
        assert maps["mean_curvature"] == pytest.approx(bend.mean, abs=2e-3)
        assert maps["shape_index"] == pytest.approx(bend.shape_index, abs=0.05)
        heights = [
            np.linalg.norm(points - points.mean(axis=0), axis=1).std()
            for points in (mesh.vertices, surface.vertices)
        ]
        assert heights[0] == pytest.approx(heights[1], rel=0.15)


@pytest.mark.usefixtures("recorded_outputs")
@pytest.mark.remeshed
def test_the_atlas_own_brain_is_that_of_the_week_at_the_predicted_size(tmp_path):
    mesh = ellipsoid_mesh(8, (20.0, 24.0, 22.0))
    boundary, _ = boundary_surface(mesh)
    weeks = np.array([21.0, 22.0, 23.0])
    # longer from week to week
    stretches = [np.array([1.0, 1.0 + 0.1 * number, 1.0]) for number in range(3)]
    atlas = [
        transform_points(boundary.vertices * stretch, FAR[0]) for stretch in stretches
    ]
    positions = np.stack([mesh.vertices] * 3)
    shapes = WeeklyShapes(weeks, positions, surfaces={"atlas": atlas}, tets=mesh.tets)
    write_weekly_shapes(tmp_path / "targets.h5", shapes)
    write_tetrahedral_mesh(tmp_path / "mesh.xdmf", mesh)
    predicted = TriangleMesh(1.2 * boundary.vertices * stretches[1], boundary.faces)
    write_surface(tmp_path / "predicted.gii", predicted)
    inputs = {
        "mesh": "mesh.xdmf",
        "targets": "targets.h5",
        "predicted": "predicted.gii",
    }
    run_script("atlas_brain.py", tmp_path, inputs, {0: "found.gii"}, {"week": 22.0})
    found = read_surface(tmp_path / "found.gii")
    assert signed_volume(found) == pytest.approx(signed_volume(predicted), rel=1e-3)
    assert found.vertices == pytest.approx(predicted.vertices, abs=0.2)
