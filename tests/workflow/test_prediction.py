"""A brain foretold by another population's growth, with the real commands, from phantoms given as labels."""

import nibabel as nib
import numpy as np
import pandas as pd
import pytest

from gyriflow.comparison.prediction import BASELINES
from gyriflow.phantom.brain import phantom_labels

STUDY = {
    "surface": {"edge_length_mm": 2.0},
    "mesh": {
        "order": 1,
        "mesher": "tetgen",
        "surface_edge_mm": 3.0,
        "core_edge_mm": 5.0,
        "max_surface_distance_mm": 1.5,
    },
    "start": "b21",
    "growth": {"brains": {"atlas": ["a21", "a22", "a23"]}},
    "folding": {"end_week": 23},
    "runs": {"expected": {"preset": "expected", "contact": {"kind": "none"}, "ranks": 1}},
}


@pytest.mark.slow
def test_a_brain_is_foretold_and_compared_with_the_real_one(workflow):
    brains = []
    for population, seed, weeks in (("a", 1, (21, 22, 23)), ("b", 2, (21, 23))):
        for week in weeks:
            file = f"{population}{week}.nii.gz"
            labels, affine = phantom_labels(week, voxel_mm=2.0, seed=seed)
            nib.save(nib.Nifti1Image(labels.astype(np.uint8), affine), workflow.directory / file)
            known = {"labels": file, "scheme": "spina-bifida-atlas", "population": population}
            brains.append({"id": f"{population}{week}", "week": week} | known)
    name = workflow.write("study.yaml", STUDY | {"brains": brains})
    tables = [f"results/study/{table}.csv" for table in ("prediction", "validation")]
    outcome = workflow.run(*tables, "--cores", "2", "--configfile", name, timeout_s=1500)
    assert outcome.returncode == 0, outcome.stdout[-1000:] + outcome.stderr[-3000:]
    prediction, validation = (pd.read_csv(workflow.directory / table) for table in tables)
    assert set(prediction["model"]) == {"run", *BASELINES}
    assert set(prediction["week"]) == {23.0}
    assert set(prediction["horizon"]) == {2.0}
    assert set(validation["kind"]) == {"predicted"}
    rows = prediction.set_index("model")
    # the run comes to the shape that it grows towards, which is as large as the real brain, if not the same
    assert rows.loc["run", "volume_error"] == pytest.approx(rows.loc["target", "volume_error"], abs=0.02)
    assert abs(rows.loc["run", "volume_error"]) < 0.1
    assert rows.loc["run", "distance_mm"] == pytest.approx(rows.loc["target", "distance_mm"], abs=0.2)
    steps = pd.read_csv(workflow.directory / "results/runs/expected/b21/folding/steps.csv")
    assert steps["to_target_mm"].iloc[-1] < 0.3
