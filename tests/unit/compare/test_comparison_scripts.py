"""What the scripts that compare a run, or a carried mesh, with observed brains write of several weeks."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scripts import run_script
from shapes import ellipsoid, ellipsoid_mesh, rigid

from gyriflow.geometry.deformations import MatchedSurfaces, transform_points
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, area
from gyriflow.io.files import read_table, write_json
from gyriflow.io.frames import join_frames, write_frame
from gyriflow.io.registrations import WeeklyShapes, write_correspondence, write_weekly_shapes
from gyriflow.io.surfaces import write_surface, write_vertex_maps
from gyriflow.io.tetmeshes import write_tetrahedral_mesh

MESH = ellipsoid_mesh(8, (20.0, 20.0, 20.0))


def test_displacement_is_compared_over_the_weeks_that_both_have(tmp_path):
    def grown(week, rate):
        return MESH.vertices * (1 + (week - 21) * np.array([rate, 0, 0]))

    frames = {week: tmp_path / f"{week}.h5" for week in (21.0, 22.0, 23.0, 24.0)}
    for week, path in frames.items():
        write_frame(path, week, {"positions": grown(week, 0.1)})
    join_frames(tmp_path / "frames.h5", MESH.tets, list(frames.values()))
    weeks = np.array([21.0, 22.5, 23.0, 24.0])
    carried = np.stack([grown(week, {22.5: 0.5, 23.0: 0.2}.get(week, 0.1)) for week in weeks])
    write_weekly_shapes(tmp_path / "carried.h5", WeeklyShapes(weeks, carried))
    inputs = {"frames": ["frames.h5"], "carried": ["carried.h5"]}
    outputs, params = {"displacement_agreement": "agreement.csv"}, {"carried": [("thin", False)]}
    run_script("validation_tables.py", tmp_path, inputs, outputs, params)
    table = read_table(tmp_path / "agreement.csv")
    assert set(table["test"]) == {"comparison"}
    assert table[["run", "from_week", "to_week"]].to_numpy().tolist() == [["thin", 21, 23], ["thin", 23, 24]]
    # the run moves by half of what is measured; then on where that shrinks
    assert table["displacement_slope"].iloc[0] == pytest.approx(0.5)
    assert table["displacement_r"].tolist() == pytest.approx([1, -1])


def test_a_carried_mesh_is_compared_with_the_observed_brain_of_each_week(tmp_path):
    """The carried mesh is the observed brain of each week; the start has the opposite folds, the brain before equal."""
    weeks, axes, folds = (
        (22.0, 24.0),
        ((20.0, 24.0, 22.0), (26.0, 26.0, 26.0)),
        {"observed": 1, "start": -1, "adjacent": 1},
    )
    pose, observed = Pose(rigid(0, 0, 90, shift=(3, 0, 0))), [ellipsoid(half) for half in axes]
    boundary, _ = boundary_surface(MESH)
    shapes = [np.divide(half, 20.0) * boundary.vertices for half in ([20.0] * 3, [10.0] * 3, *axes)]
    worlds = [TriangleMesh(transform_points(points, pose.inverse), boundary.faces) for points in shapes]
    for number, (one, other) in enumerate(pairwise(worlds)):
        write_correspondence(tmp_path / f"{number}.h5", MatchedSurfaces(one, other.vertices), {})
    write_tetrahedral_mesh(tmp_path / "mesh.xdmf", MESH)
    write_json(tmp_path / "surface.json", {"pose": pose.plain()})
    inputs = {"correspondences": ["0.h5", "1.h5", "2.h5"], "mesh": "mesh.xdmf", "report": "surface.json"}
    inputs |= {name: ["22.0.gii", "24.0.gii"] for name in ("whole", *folds)}
    for name, sign in folds.items():
        inputs[f"{name}_maps"] = [f"{name}-{week}.gii" for week in weeks]
        for week, surface in zip(weeks, observed, strict=True):
            write_surface(tmp_path / f"{week}.gii", surface)
            pattern = sign * np.random.default_rng(0).normal(size=len(surface.vertices))
            maps = {"mean_curvature": 0.1 * pattern, "shape_index": np.tanh(pattern)}
            write_vertex_maps(tmp_path / f"{name}-{week}.gii", maps)
    params = {
        "run": "registration",
        "kind": "explained",
        "start_week": 21.0,
        "weeks": weeks,
        "observed": ["b22", "b24"],
    }
    params |= {"carried_weeks": [21.0, 21.5, *weeks], "curvature_radius_mm": 3.0}
    job = {"params": params, "wildcards": SimpleNamespace(brain="b21")}
    run_script("validation.py", tmp_path, inputs, {"table": "ceiling.csv", "carried": "carried.h5"}, **job)
    table = read_table(tmp_path / "ceiling.csv")
    assert table[["run", "kind", "start", "observed", "week", "horizon"]].to_numpy().tolist() == [
        ["registration", "explained", "b21", f"b{week:g}", week, week - 21] for week in weeks
    ]
    assert table["observed_area_cm2"].tolist() == pytest.approx([area(surface) / 100 for surface in observed])
    assert (table["distance_mm"].max() < 0.4, table["volume_difference"].abs().max() < 0.1) == (True, True)
    assert table["r_start_shape_index"].tolist() == pytest.approx([-1, -1])
    assert table["r_adjacent_mean_curvature"].tolist() == pytest.approx([1, 1])
