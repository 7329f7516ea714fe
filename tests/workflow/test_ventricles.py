"""Ventricles that grow by a curve of their own, with the real commands, from the labels of phantoms."""

import pandas as pd
import pytest
import yaml

from gyriflow.geometry.tetrahedra import linear_pieces, volumes_between
from gyriflow.io.maps import read_maps
from gyriflow.io.tetmeshes import read_tetrahedral_mesh

from .conftest import COARSE

STUDY = {
    "brains": [{"id": f"p{week}", "week": week, "phantom": {"voxel_mm": 2.0}} for week in (21, 22)],
    "start": "p21",
    "surface": {"edge_length_mm": 2.5},
    "mesh": COARSE | {"max_surface_distance_mm": 1.5},
    "folding": {
        "end_week": 22,
        "thickness_mm": 4.0,
        "step_s": 86400,
        "support": "free",
        "no_growth": {"kind": "none"},
        "contact": {"kind": "none"},
        "follow": {"ventricles_ml": "measured"},
        "allow_negative_growth": True,
        "ranks": 1,
    },
    "runs": {"reference": {}, "alike": {"follow": {"ventricles_ml": None}}},
}


@pytest.mark.slow
def test_ventricles_of_a_phantom_come_to_the_next_weeks(workflow):
    name = workflow.write("study.yaml", STUDY)
    runs = [f"results/runs/{run}/p21/folding/steps.csv" for run in STUDY["runs"]]
    outcome = workflow.run(*runs, "--cores", "2", "--configfile", name)
    assert outcome.returncode == 0, outcome.stderr[-3000:]
    results = workflow.directory / "results"
    measured = pd.read_csv(results / "study/growth/areas.csv").set_index("subject")
    curve = yaml.safe_load((results / "runs/reference/p21/params.yaml").read_text())["follow"]["ventricles_ml"]
    assert curve[21.0] == pytest.approx(measured.loc["p21", "ventricles_ml"], rel=1e-3)
    assert curve[22.0] == pytest.approx(measured.loc["p22", "ventricles_ml"], rel=1e-3)
    # where the labels have them
    mesh = read_tetrahedral_mesh(results / "brains/p21/mesh/brain.xdmf")
    cells = linear_pieces(mesh)
    part = read_maps(results / "runs/reference/p21/folding/maps.h5")["ventricles"][cells].mean(axis=1)
    inside = part @ volumes_between(mesh.vertices, cells) / 1000
    assert inside == pytest.approx(measured.loc["p21", "ventricles_ml"], rel=0.2)
    steps, alike = (pd.read_csv(workflow.directory / run) for run in runs)
    assert steps["ventricles_aim_ml"].iloc[-1] == pytest.approx(curve[22.0], rel=1e-3)
    assert steps["ventricles_ml"].iloc[-1] == pytest.approx(curve[22.0], rel=0.005)
    assert "ventricles_ml" not in alike
