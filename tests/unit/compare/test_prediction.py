"""Predicted surfaces against the observed brain and the simpler predictions of a
week."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.compare.comparison import add_curves, model_columns


def samples(models, r=None):
    """Return samples of models by their distances, and by their r if given."""
    return {
        model: {
            "distance_mm": np.array(drawn),
            "r_shape_index": np.array((r or models)[model]),
        }
        for model, drawn in models.items()
    }


@pytest.mark.parametrize(
    ("distances", "skills"),
    [
        (
            {"run": 0.3, "scaled": 0.6, "atlas": 0.8, "target": 0.7},
            {"run": 0.5, "scaled": 0.0, "atlas": -1 / 3},
        ),
        # the target is a baseline
        ({"run": 0.9, "scaled": 0.9, "target": 0.45}, {"run": -1.0, "target": 0.0}),
    ],
)
def test_skill_is_against_the_best_baseline(distances, skills):
    # the skill is the same in every draw if all distances are multiplied by one factor
    drawn = {model: [mm, mm, 2 * mm] for model, mm in distances.items()}
    found = model_columns(samples(drawn))
    for model, skill in skills.items():
        columns = [found[model][f"skill{end}"] for end in ("", "_low", "_high")]
        assert columns == pytest.approx([skill] * 3)


def test_the_best_baseline_is_chosen_in_each_sample_anew():
    # of two baselines, each sample has another one that is as good as the run
    drawn = {"run": [1, 1, 1], "scaled": [1.9, 1, 3], "atlas": [2, 3, 1]}
    run = model_columns(samples(drawn))["run"]
    columns = run["skill"], run["skill_low"], run["skill_high"]
    assert columns == pytest.approx((1 - 1 / 1.9, 0, 0))


def test_differences_from_the_atlas_are_paired():
    # r and distance vary much, their differences from the atlas' own brain do not
    drawn = np.array([0.5, 0.1, 0.5, 0.9])
    distances = {"run": drawn + 1.2, "atlas": drawn + 1.0}
    found = model_columns(samples(distances, {"run": drawn + 0.03, "atlas": drawn}))
    for end in ("", "_low", "_high"):
        assert found["run"][f"r_less_atlas{end}"] == pytest.approx(0.03)
        assert found["run"][f"distance_less_atlas_mm{end}"] == pytest.approx(0.2)
    without = model_columns(samples({"run": drawn, "scaled": drawn}))
    assert "r_less_atlas" not in without["run"]


def test_a_run_is_off_the_curve_that_it_followed_as_a_fraction_of_the_curve():
    table = pd.DataFrame({"week": [22.0, 25.0], "area_cm2": 110.0, "volume_ml": 40.0})
    found = add_curves(table, {25.0: {"area_cm2": 100.0, "volume_ml": 50.0}})
    assert found["curve_area_cm2"].tolist() == pytest.approx([np.nan, 100], nan_ok=True)
    assert found["area_off_curve"].tolist() == pytest.approx([np.nan, 0.1], nan_ok=True)
    assert found["volume_off_curve"].tolist()[1] == pytest.approx(-0.2)
