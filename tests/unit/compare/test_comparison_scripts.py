"""What the scripts that compare a run or a carried mesh with observed brains write of several weeks."""

from types import SimpleNamespace

import numpy as np
import pytest
from scripts import run_script
from shapes import ellipsoid, ellipsoid_mesh, rigid, sphere

from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import area
from gyriflow.io.files import read_table, write_json
from gyriflow.io.frames import join_frames, write_frame
from gyriflow.io.registrations import WeeklyShapes, write_weekly_shapes
from gyriflow.io.surfaces import write_surface, write_vertex_maps
from gyriflow.io.tetmeshes import write_tetrahedral_mesh

MESH = ellipsoid_mesh(8, (20.0, 20.0, 20.0))


@pytest.mark.parametrize(("registered", "test"), [(False, "comparison"), (True, "consistency")])
def test_displacement_is_compared_over_the_weeks_that_both_have(tmp_path, registered, test):
    def grown(week, rate):
        return MESH.vertices * (1 + (week - 21) * np.array([rate, 0, 0]))

    for week in (21.0, 22.0, 23.0, 24.0):
        write_frame(tmp_path / f"{week}.h5", week, {"positions": grown(week, 0.1)})
    join_frames(tmp_path / "frames.h5", MESH.tets, [tmp_path / f"{week}.h5" for week in (21.0, 22.0, 23.0, 24.0)])
    weeks = np.array([21.0, 22.5, 23.0, 24.0])
    carried = np.stack([grown(week, {22.5: 0.5, 23.0: 0.2}.get(week, 0.1)) for week in weeks])
    write_weekly_shapes(tmp_path / "carried.h5", WeeklyShapes(weeks, carried))
    params = {"labels": {"run": "thin", "start_week": 21.0}, "registered": registered}
    inputs = {"frames": "frames.h5", "carried": "carried.h5"}
    run_script("displacement_agreement.py", tmp_path, inputs, {0: "agreement.csv"}, params)
    table = read_table(tmp_path / "agreement.csv")
    assert table[["run", "start_week", "from_week", "to_week", "test"]].to_numpy().tolist() == [
        ["thin", 21, 21, 23, test],
        ["thin", 21, 23, 24, test],
    ]
    # the run moves by half of what is measured; then on where that shrinks
    assert table["displacement_slope"].iloc[0] == pytest.approx(0.5)
    assert table["displacement_r"].tolist() == pytest.approx([1, -1])


def test_a_carried_mesh_is_compared_with_the_observed_brain_of_each_week(tmp_path):
    """The carried mesh is the observed brain of each week; the start has the opposite folds, the brain before equal."""
    weeks, names = (22.0, 24.0), {"real": 1.0, "start": -1.0, "adjacent": 1.0}
    pose, axes = Pose(rigid(0, 0, 90, shift=(3, 0, 0))), {22.0: np.array([20.0, 24.0, 22.0]), 24.0: 26.0 * np.ones(3)}
    world = [transform_points(MESH.vertices / 20.0 * axes[week], pose.inverse) for week in weeks]
    carried = np.stack([transform_points(MESH.vertices, pose.inverse), 0 * world[0], *world])
    write_weekly_shapes(tmp_path / "carried.h5", WeeklyShapes(np.array([21.0, 21.5, *weeks]), carried))
    write_tetrahedral_mesh(tmp_path / "mesh.xdmf", MESH)
    write_json(tmp_path / "surface.json", {"pose": pose.plain()})
    inputs = {"carried": "carried.h5", "mesh": "mesh.xdmf", "report": "surface.json", "whole": []}
    inputs |= {f"{name}{maps}": [] for name in names for maps in ("", "_maps")}
    for week in weeks:
        surface = ellipsoid(axes[week])
        write_surface(tmp_path / f"{week}.gii", surface)
        folds = np.random.default_rng(0).normal(size=len(surface.vertices))
        inputs["whole"].append(f"{week}.gii")
        for name, sign in names.items():
            maps = {"mean_curvature": 0.1 * sign * folds, "shape_index": np.tanh(sign * folds)}
            write_vertex_maps(tmp_path / f"{name}-{week}.gii", maps)
            inputs[name].append(f"{week}.gii")
            inputs[f"{name}_maps"].append(f"{name}-{week}.gii")
    params = {"run": "registration", "kind": "explained", "start_week": 21.0, "weeks": weeks, "real": ["b22", "b24"]}
    wildcards = SimpleNamespace(brain="b21")
    params["curvature_radius_mm"] = 3.0
    run_script("validation.py", tmp_path, inputs, {0: "ceiling.csv"}, params, wildcards=wildcards)
    table = read_table(tmp_path / "ceiling.csv")
    assert table[["run", "kind", "start", "real", "week", "horizon"]].to_numpy().tolist() == [
        ["registration", "explained", "b21", "b22", 22, 1],
        ["registration", "explained", "b21", "b24", 24, 3],
    ]
    assert table["real_area_cm2"].tolist() == pytest.approx([area(ellipsoid(axes[week])) / 100 for week in weeks])
    assert table["distance_mm"].max() < 0.4
    assert table["volume_difference"].abs().max() < 0.1
    assert table["r_start_shape_index"].tolist() == pytest.approx([-1, -1])
    assert table["r_adjacent_mean_curvature"].tolist() == pytest.approx([1, 1])


def test_the_thickness_that_is_expected_is_the_start_s_grown_as_in_the_run(tmp_path):
    radii = {"start": 20.0, "first": 20.0, "expected": 22.0, "real": 23.0}
    thickness = {"start": 2.0, "first": 1.0, "expected": 1.5, "real": 2.5}
    for name, radius in radii.items():
        ball = sphere(radius, 3)
        write_surface(tmp_path / f"{name}.surf.gii", ball)
        write_vertex_maps(tmp_path / f"{name}.gii", {"thickness_mm": np.full(len(ball.vertices), thickness[name])})
    inputs = {name: f"{name}.surf.gii" for name in radii} | {"thickness": [f"{name}.gii" for name in radii]}
    inputs |= {"sides": ["expected.surf.gii"], "regions": []}
    params = {"labels": {"run": "thin", "week": 24.0}, "sides": ["left"]}
    run_script("deviation.py", tmp_path, inputs, {"maps": "maps.gii", "table": "deviation.csv"}, params)
    table = read_table(tmp_path / "deviation.csv").set_index(["hemisphere", "metric"])["value"]
    for side in ("whole", "left"):
        # 2.0 mm became 2.0 · 1.5 mm / 1.0 mm
        assert table[side, "thickness_difference"] == pytest.approx(2.5 - 3.0)
        assert table[side, "distance"] == pytest.approx(1.0, abs=0.05)
        assert table[side, "log_area"] == pytest.approx(2 * np.log(23 / 22), abs=0.01)
