"""What the script that compares a run with observed brains writes of several weeks."""

from types import SimpleNamespace

import numpy as np
import pytest
from scripts import run_script
from shapes import FAR, ellipsoid_mesh, rigid, scaling

from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import (
    TriangleMesh,
    transformed,
)
from gyriflow.io.files import read_table
from gyriflow.io.registrations import WeeklyShapes, write_weekly_shapes
from gyriflow.io.surfaces import (
    read_surface,
    write_surface,
    write_vertex_maps,
)
from gyriflow.io.tetmeshes import write_tetrahedral_mesh
from gyriflow.metrics.curvature import curvature

from .bumpy import bumpy


def save_curvature(surface, signs):
    """Write the maps of a surface to files, with opposite folds where their sign is
    −1."""
    bend = curvature(surface, radius_mm=3.0)
    for path, sign in signs.items():
        maps = {"mean_curvature": sign * bend.mean}
        maps["shape_index"] = sign * bend.shape_index
        write_vertex_maps(path, maps)


def validated(folder, inputs, **params):
    """Return the table that the script writes for a run of a brain of 21 GW."""
    common = {"start_week": 21.0, "curvature_radius_mm": 3.0}
    job = {"params": common | params, "wildcards": SimpleNamespace(brain="b21")}
    run_script("validation.py", folder, inputs, {"table": "validation.csv"}, **job)
    return read_table(folder / "validation.csv")


@pytest.mark.usefixtures("recorded_outputs")
def test_a_run_is_compared_with_the_observed_brain_of_each_week(tmp_path):
    """The run is the observed brain of each week; the start has the opposite folds, the
    brain before equal ones."""
    weeks = (22.0, 24.0)
    files = [f"{week}.gii" for week in weeks]
    inputs = {"whole": files, "simulated": files, "observed": files}
    folds = {"observed": 1, "start": -1, "adjacent": 1}
    for name in folds:
        inputs[f"{name}_maps"] = [f"{name}-{week}.gii" for week in weeks]
    for week in weeks:
        surface = bumpy(int(week), 0.6)
        write_surface(tmp_path / f"{week}.gii", surface)
        signs = {tmp_path / f"{name}-{week}.gii": folds[name] for name in folds}
        save_curvature(surface, signs)
    run = {"run": "thin", "kind": "explained", "weeks": weeks}
    table = validated(tmp_path, inputs, **run, observed=["b22", "b24"])
    labels = table[["run", "kind", "start", "observed", "week", "horizon"]]
    assert labels.to_numpy().tolist() == [
        ["thin", "explained", "b21", f"b{week:g}", week, week - 21] for week in weeks
    ]
    # curvature of another radius is another one
    assert table["r_mean_curvature"].tolist() == pytest.approx([1, 1], abs=0.002)


@pytest.mark.usefixtures("recorded_outputs")
def test_predictions_without_mechanics_are_those_of_their_week(tmp_path):
    """The brain grows by 10 % a week, along the path that the run follows, the
    registered atlas by half as much."""
    mesh = ellipsoid_mesh(8, (12.0, 14.0, 13.0))
    boundary, used = boundary_surface(mesh)
    positions = [mesh.vertices * factor for factor in (1.0, 1.1, 1.21)]
    atlas = [boundary.vertices * factor for factor in (1.0, 1.05, 1.1)]
    shapes = WeeklyShapes(
        np.array([21.0, 22.0, 23.0]),
        np.stack(positions),
        surfaces={"atlas": atlas},
        tets=mesh.tets,
    )
    write_weekly_shapes(tmp_path / "targets.h5", shapes)
    write_tetrahedral_mesh(tmp_path / "mesh.xdmf", mesh)
    observed = TriangleMesh(positions[1][used], boundary.faces)
    write_surface(tmp_path / "observed.gii", observed)
    save_curvature(observed, {tmp_path / "maps.gii": 1})
    inputs = {"targets": "targets.h5", "mesh": "mesh.xdmf", "atlas": []}
    for name in ("whole", "simulated", "observed", "start", "adjacent"):
        inputs |= {name: ["observed.gii"], f"{name}_maps": ["maps.gii"]}
    run = {"run": "atlas", "kind": "predicted", "weeks": [22.0], "observed": ["b22"]}
    table = validated(tmp_path, inputs, **run, of_atlas=True, atlas_weeks=[])
    # all are scaled to the volume of the target of this week, of which they are copies
    assert table["distance_mm"].max() < 0.01
    assert table["area_difference"].abs().max() < 1e-4


@pytest.mark.usefixtures("recorded_outputs")
@pytest.mark.remeshed
def test_surfaces_are_prepared_for_the_observed_brain_each_under_its_name(tmp_path):
    heights = {"observed": 0.6, "start": 0.3, "adjacent": 0.9}
    surfaces = {}
    for seed, (name, height) in enumerate(heights.items(), start=1):
        surfaces[name] = bumpy(seed, height)
        # start and neighbour lie elsewhere and are smaller
        pose = rigid(0.0, 20.0, 0.0, shift=(3.0, 8.0, -4.0)) @ scaling(0.9)
        moved = transformed(surfaces[name], np.eye(4) if seed == 1 else pose)
        write_surface(tmp_path / f"{name}.gii", moved)
    inputs = {name: f"{name}.gii" for name in surfaces}
    outputs = {"observed": "prepared-observed.gii"}
    outputs |= {f"{name}_maps": f"maps-{name}.gii" for name in surfaces}
    params = {"curvature_radius_mm": 4.0}
    run_script("prepared_surfaces.py", tmp_path, inputs, outputs, params)


@pytest.mark.usefixtures("recorded_outputs")
@pytest.mark.remeshed
def test_the_atlas_own_brain_is_that_of_the_week_at_the_predicted_size(tmp_path):
    mesh = ellipsoid_mesh(8, (20.0, 24.0, 22.0))
    boundary, _ = boundary_surface(mesh)
    # longer from week to week
    atlas = [boundary.vertices * [1.0, length, 1.0] for length in (1.0, 1.1, 1.2)]
    shapes = WeeklyShapes(
        np.array([21.0, 22.0, 23.0]),
        np.stack([mesh.vertices] * 3),
        surfaces={"atlas": [transform_points(places, FAR[0]) for places in atlas]},
        tets=mesh.tets,
    )
    write_weekly_shapes(tmp_path / "targets.h5", shapes)
    write_tetrahedral_mesh(tmp_path / "mesh.xdmf", mesh)
    predicted = TriangleMesh(1.2 * atlas[1], boundary.faces)
    write_surface(tmp_path / "predicted.gii", predicted)
    inputs = {"mesh": "mesh.xdmf", "targets": "targets.h5"}
    inputs |= {"predicted": "predicted.gii"}
    run_script("atlas_brain.py", tmp_path, inputs, {0: "found.gii"}, {"week": 22.0})
    found = read_surface(tmp_path / "found.gii")
    assert found.vertices == pytest.approx(predicted.vertices, abs=0.2)
