"""In which week a sulcus begins, by the rule itself: on surfaces whose sulcus is as deep as it is made."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from configurations import labelled
from shapes import sphere

from gyriflow.config import load
from gyriflow.geometry.deformations import MatchedSurfaces
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.files import write_json
from gyriflow.io.registrations import write_correspondence
from gyriflow.io.surfaces import write_surface, write_vertex_labels
from gyriflow.study.resolve import resolve

BALL = sphere(20.0)
MM_PER_WEEK = {"real": 1.2, "reference": 0.8}
"""How the groove deepens in the real brains, and in the run."""
THERE_MM = 2.74
"""Its depth when its bottom is 2 mm below the hull of its rims."""


def groove(depth_mm):
    """Return a ball with a groove along the equator's front."""
    x, y, z = BALL.vertices.T
    depth = depth_mm * np.exp(-((z / 4) ** 2)) * (np.abs(np.arctan2(y, x)) * 20 < 15)
    return TriangleMesh(BALL.vertices * (1 - depth / 20)[:, None], BALL.faces)


@pytest.mark.slow
def test_sulci_of_real_brains_and_of_a_run_begin_in_their_weeks(workflow):
    # the last brain is named first
    folding = {"end_week": 27, "output_every_gw": 2}
    config = {"brains": labelled(27, 22, 24), "start": "b", "folding": folding, "runs": {"reference": {}}}
    name = workflow.write("study.yaml", config)
    study = resolve(load(config, workflow.directory))
    files = study.onset_files("reference", "b")
    weeks = {"real": [22, 24, 27], "reference": [22, 24, 26, 27]}
    assert list(study.simulations["reference", "b"].weeks) == weeks["reference"]
    shapes = {who: [groove(rate * (week - 22)) for week in weeks[who]] for who, rate in MM_PER_WEEK.items()}
    for side in ("left", "right"):
        for key, who in (("real", "real"), ("run", "reference")):
            for file, shape in zip(files[f"{key}_{side}"], shapes[who], strict=True):
                write_surface(workflow.directory / file, shape)
        write_vertex_labels(workflow.directory / files[f"{side}_regions"], np.zeros(len(BALL.vertices), int), {})
    for file in files["reports"]:
        write_json(workflow.directory / file, {"pose": Pose().plain()})
    for file, (one, other) in zip(files["correspondences"], pairwise(shapes["real"]), strict=True):
        write_correspondence(workflow.directory / file, MatchedSurfaces(one, other.vertices), {})
    table = "results/runs/reference/b/metrics/onset.csv"
    outcome = workflow.run(table, "--allowed-rules", "onset", "--cores", "1", "--configfile", name)
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    begins = pd.read_csv(workflow.directory / table).set_index(["run", "hemisphere"])["onset_week"]
    assert len(begins) == 4
    for who, rate in MM_PER_WEEK.items():
        assert begins[who].to_list() == pytest.approx([22 + THERE_MM / rate] * 2, abs=0.15)
