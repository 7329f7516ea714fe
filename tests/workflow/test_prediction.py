"""A brain predicted by another population's growth, with the real commands."""

import numpy as np
import pandas as pd
import pytest
from phantoms import phantom_labels
from shapes import LPS, cerebrum_surface, save_gifti, save_labels

from gyriflow.geometry.triangles import transformed
from gyriflow.report.labels import SIMPLER_PREDICTIONS

from .conftest import COARSE

pytestmark = [pytest.mark.slow, pytest.mark.extended]

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
        brain = {"id": f"{population}{week}", "week": week, "population": population}
        brain |= {"labels": f"{brain['id']}.nii.gz", "scheme": "spina-bifida-atlas"}
        made = phantom_labels(week, voxel_mm=2.0, seed=seed)
        save_labels(workflow.directory / brain["labels"], *made)
        entries.append(brain)
    return entries


def test_a_brain_is_predicted_and_compared_with_the_observed_ones_of_any_week(workflow):
    """It is a surface in LPS, in an atlas of labels."""
    start = cerebrum_surface(*phantom_labels(21.5, voxel_mm=2.0, seed=2))
    save_gifti(workflow.directory / "b.surf.gii", transformed(start, LPS))
    brain = {"id": "b21.5", "week": 21.5, "population": "b"}
    brains = [
        brain | {"pial": "b.surf.gii", "coordinates": "lps"},
        *brains_of(workflow, "a", 1, 21, 22, 23),
        *brains_of(workflow, "b", 2, 22.6, 23),
    ]
    name = workflow.write("study.yaml", STUDY | {"brains": brains, "start": "b21.5"})
    study, run = "results/study", "results/runs/expected/b21.5"
    targets = [
        f"{study}/prediction.csv",
        f"{study}/validation.csv",
        f"{study}/deviation_centiles.csv",
        f"{study}/figures/prediction.png",
        f"{run}/figures/expected.png",
        f"{run}/figures/deviation_log_area.png",
    ]
    call = (*targets, "--cores", "2", "--configfile", name)
    outcome = workflow.run(*call, timeout_s=1500)
    assert outcome.returncode == 0, outcome.stdout[-1000:] + outcome.stderr[-3000:]
    prediction, validation, deviation = (
        pd.read_csv(workflow.directory / table) for table in targets[:3]
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
    steps = pd.read_csv(workflow.directory / run / "folding/steps.csv")
    assert steps["to_path_mm"].iloc[-1] < 0.3
    # the observed brain deviates as it is larger or smaller
    whole = deviation.query("hemisphere == 'whole' and metric == 'log_area'")
    areas = whole.set_index("week")["value"]
    errors = prediction.query("model == 'run'").set_index("week")["area_difference"]
    for week, value in areas.items():
        assert value == pytest.approx(-np.log1p(errors[week]), abs=0.05)
