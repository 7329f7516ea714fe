"""A brain predicted by another population's growth, with the real commands, from
phantoms given as labels or surface."""

import numpy as np
import pandas as pd
import pytest
from atlas_brains import atlas_labels
from phantoms import phantom_labels
from shapes import cerebrum_surface, rigid, save_gifti, save_labels

from gyriflow.compare.comparison import aligned_distances
from gyriflow.geometry.alignment import angle_deg, rigid_fit
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, signed_volume, transformed
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.report.labels import SIMPLER_PREDICTIONS

from .conftest import COARSE

STUDY = {
    "surface": {"edge_length_mm": 2.0},
    "mesh": COARSE | {"surface_edge_mm": 2.8, "max_surface_distance_mm": 1.5},
    "growth": {"brains": {"atlas": ["a21", "a22", "a23"]}},
    "folding": {"end_week": 23},
    "runs": {"expected": {"preset": "expected", "contact": "none", "ranks": 1}},
}


def brains_of(workflow, population, seed, *weeks):
    """Return the entries of synthetic brains of a population, written as label
    volumes."""
    entries = []
    for week in weeks:
        file = f"{population}{week}.nii.gz"
        save_labels(
            workflow.directory / file, *phantom_labels(week, voxel_mm=2.0, seed=seed)
        )
        known = {
            "labels": file,
            "scheme": "spina-bifida-atlas",
            "population": population,
        }
        entries.append({"id": f"{population}{week}", "week": week} | known)
    return entries


@pytest.mark.slow
@pytest.mark.extended
def test_a_brain_is_predicted_and_compared_with_the_observed_ones_of_any_week(workflow):
    brains = [
        *brains_of(workflow, "a", 1, 21, 22, 23),
        *brains_of(workflow, "b", 2, 21.5, 22.6, 23),
    ]
    name = workflow.write("study.yaml", STUDY | {"brains": brains, "start": "b21.5"})
    tables = [f"results/study/{table}.csv" for table in ("prediction", "validation")]
    names = ("expected", "deviation_log_area")
    drawn = [f"results/runs/expected/b21.5/figures/{figure}.png" for figure in names]
    further = [
        "results/study/deviation_centiles.csv",
        "results/study/figures/prediction.png",
        *drawn,
    ]
    outcome = workflow.run(
        *tables, *further, "--cores", "2", "--configfile", name, timeout_s=1500
    )
    assert outcome.returncode == 0, outcome.stdout[-1000:] + outcome.stderr[-3000:]
    prediction, validation = (
        pd.read_csv(workflow.directory / table) for table in tables
    )
    assert set(prediction["model"]) == {"run", *SIMPLER_PREDICTIONS}
    assert list(prediction["horizon"].unique()) == pytest.approx([1.1, 1.5])
    assert set(validation["kind"]) == {"predicted"}
    assert set(validation["week"]) == {22.6, 23.0}
    for _, of_week in prediction.groupby("week"):
        rows = of_week.set_index("model")
        # the run comes to the shape that it grows towards, which is as large as the
        # real brain, if not the same
        assert rows.loc["run", "volume_difference"] == pytest.approx(
            rows.loc["target", "volume_difference"], abs=0.02
        )
        assert abs(rows.loc["run", "volume_difference"]) < 0.1
        assert rows.loc["run", "distance_mm"] == pytest.approx(
            rows.loc["target", "distance_mm"], abs=0.2
        )
        # of no week is the atlas' brain that of another one
        assert rows.loc["atlas", "volume_difference"] == pytest.approx(
            rows.loc["target", "volume_difference"]
        )
        assert rows.loc["atlas", "distance_mm"] < 1.5
    steps = pd.read_csv(
        workflow.directory / "results/runs/expected/b21.5/folding/steps.csv"
    )
    assert steps["to_path_mm"].iloc[-1] < 0.3
    # the real brain deviates as it is larger or smaller
    deviation = pd.read_csv(workflow.directory / further[0]).query(
        "hemisphere == 'whole'"
    )
    areas = deviation[deviation["metric"] == "log_area"].set_index("week")["value"]
    errors = prediction.query("model == 'run'").set_index("week")["area_difference"]
    for week, value in areas.items():
        assert value == pytest.approx(-np.log1p(errors[week]), abs=0.05)


def test_a_prediction_is_measured_and_compared_by_surfaces_of_observed_brains(workflow):
    brains = [
        *brains_of(workflow, "a", 1, 21, 22, 23),
        *brains_of(workflow, "b", 2, 21.5, 23),
    ]
    study = STUDY | {"brains": brains, "start": "b21.5"}
    name = workflow.write("study.yaml", study)
    folder = "results/runs/expected/b21.5"
    targets = [
        f"{folder}/metrics/week-23.00/metrics.csv",
        f"{folder}/surfaces/week-22.50/pial.surf.gii",
    ]
    jobs = workflow.jobs(*targets, "--configfile", name)
    assert jobs["fine_surface"] == jobs["measure_simulated"] == 2
    jobs = workflow.jobs("results/study/prediction.csv", "--configfile", name)
    assert jobs["fine_surface"] >= 1
    # growth at a rate needs none
    own = study | {"runs": {"own": {}}}
    jobs = workflow.jobs(
        "results/runs/own/b21.5/metrics/week-23.00/metrics.csv",
        "--configfile",
        workflow.write("own.yaml", own),
    )
    assert "fine_surface" not in jobs


@pytest.mark.slow
def test_a_surface_in_another_pose_is_carried_through_the_labels_of_an_atlas(workflow):
    brains = []
    for week in (22, 23, 24):
        save_labels(workflow.directory / f"a{week}.nii.gz", *atlas_labels(week))
        labels = {
            "labels": f"a{week}.nii.gz",
            "scheme": "spina-bifida-atlas",
            "population": "a",
        }
        brains.append({"id": f"a{week}", "week": week} | labels)
    # another brain of the first week: longer and narrower
    start = cerebrum_surface(*atlas_labels(22))
    start = TriangleMesh(start.vertices * [0.97, 1.03, 1.0], start.faces)
    save_gifti(
        workflow.directory / "b22.surf.gii",
        transformed(start, rigid(0, 0, 90, shift=(30, -9, 4))),
    )
    brains.append({"id": "b22", "week": 22, "pial": "b22.surf.gii", "population": "b"})
    growth, folding = {"brains": {"atlas": ["a22", "a23", "a24"]}}, {"end_week": 24}
    study = STUDY | {
        "brains": brains,
        "start": "b22",
        "growth": growth,
        "folding": folding,
    }
    name = workflow.write("study.yaml", study)
    folder = workflow.directory / "results/brains"
    outcome = workflow.run(
        "results/brains/b22/mesh/targets.atlas.h5",
        "--cores",
        "2",
        "--configfile",
        name,
        timeout_s=900,
    )
    assert outcome.returncode == 0, outcome.stdout[-1000:] + outcome.stderr[-3000:]
    boundary, used = boundary_surface(
        read_tetrahedral_mesh(folder / "b22/mesh/brain.xdmf")
    )
    targets = read_weekly_shapes(folder / "b22/mesh/targets.atlas.h5")
    real = read_surface(folder / "a24/surface/pial.surf.gii")
    ends = targets.surfaces["atlas"][2], targets.positions[2][used]
    atlas, target = (TriangleMesh(places, boundary.faces) for places in ends)
    # the former in the pose of that brain, the latter in that of the start
    assert nearest_on(atlas.vertices, real)[0].mean() < 0.8  # half a voxel
    assert aligned_distances(target, real)["distance_mm"] < 1.5
    assert signed_volume(target) == pytest.approx(signed_volume(real), rel=0.1)
    motion = rigid_fit(
        targets.positions[2], targets.positions[0], np.ones(len(targets.positions[0]))
    )
    assert angle_deg(motion[:3, :3]) < 2.0
