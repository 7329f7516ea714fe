"""Predicted surfaces against the observed brain and the simpler predictions of a
week."""

import numpy as np
import pytest
from shapes import sphere

from gyriflow.compare.comparison import (
    ObservedBrain,
    add_curves,
    comparison_table,
    model_columns,
    simple_predictions,
)
from gyriflow.geometry.triangles import TriangleMesh, area, signed_volume
from gyriflow.report.labels import SIMPLER_PREDICTIONS

from .bumpy import PREPARED, RADIUS, REAL, bumpy, shaped

LABELS = {"run": "expected", "kind": "predicted", "start": "a", "start_week": 21.0}


def samples(models, r=None):
    """Return samples of models by their distances, and by their r if given."""
    return {
        model: {
            "distance_mm": np.array(drawn),
            "r_shape_index": np.array((r or models)[model]),
        }
        for model, drawn in models.items()
    }


def test_skill_is_against_the_best_baseline_the_target_among_them():
    names = ["run", *SIMPLER_PREDICTIONS]
    # the skill is the same in every draw if all distances are multiplied by one factor
    first, second = (
        model_columns(
            samples(
                {name: [x, x, 2 * x] for name, x in zip(names, values, strict=True)}
            )
        )
        for values in ([0.3, 0.6, 0.8, 1.2, 0.7], [0.9, 0.9, 0.8, 1.2, 0.45])
    )
    for row in (*first.values(), *second.values()):
        assert (row["skill_low"], row["skill_high"]) == pytest.approx(
            (row["skill"],) * 2
        )
    assert [
        first[name]["skill"] for name in ("run", "scaled", "atlas_deformed")
    ] == pytest.approx([0.5, 0.0, -1.0])
    assert [second[name]["skill"] for name in ("run", "target")] == pytest.approx(
        [-1.0, 0.0]
    )


def test_the_best_baseline_is_chosen_in_each_sample_anew():
    # of two baselines, each sample has another one that is as good as the run
    run = model_columns(
        samples({"run": [1, 1, 1], "scaled": [1.9, 1, 3], "atlas": [2, 3, 1]})
    )["run"]
    assert (run["skill"], run["skill_low"], run["skill_high"]) == pytest.approx(
        (1 - 1 / 1.9, 0, 0)
    )


def test_differences_from_the_atlas_are_paired():
    # r and distance vary much, their differences from those of the atlas' own brain do
    # not
    drawn = np.array([0.5, 0.1, 0.5, 0.9])
    r = {"run": drawn + 0.03, "atlas": drawn}
    run = model_columns(samples({"run": drawn + 1.2, "atlas": drawn + 1.0}, r))["run"]
    assert [
        run[f"r_less_atlas{end}"] for end in ("", "_low", "_high")
    ] == pytest.approx([0.03] * 3)
    assert [
        run[f"distance_less_atlas_mm{end}"] for end in ("", "_low", "_high")
    ] == pytest.approx([0.2] * 3)
    assert (
        "r_less_atlas"
        not in model_columns(samples({"run": drawn, "scaled": drawn}))["run"]
    )


def test_simple_predictions_have_the_volume_of_the_target_or_are_taken_as_they_are():
    start, target = sphere(10.0), REAL
    registered = {"atlas": sphere(12.0), "atlas_deformed": sphere(13.0)}
    models = simple_predictions(start, target, registered, None)
    assert list(models) == ["scaled", "atlas", "atlas_deformed", "target"]
    assert models["target"] is target
    assert models["atlas_deformed"] is registered["atlas_deformed"]
    for name in ("scaled", "atlas"):
        assert signed_volume(models[name]) == pytest.approx(signed_volume(target))
    assert np.ptp(np.linalg.norm(models["atlas"].vertices, axis=1)) < 1e-9
    # the atlas' own surface of the week instead of the interpolated one
    own = simple_predictions(start, target, registered, bumpy(2, height=3.0))["atlas"]
    assert signed_volume(own) == pytest.approx(signed_volume(target))
    assert np.ptp(np.linalg.norm(own.vertices, axis=1)) > 1.0


def test_each_week_and_model_is_compared_with_its_observed_brain_and_baselines():
    first, second = REAL, bumpy(2)
    larger = TriangleMesh(1.05 * second.vertices, second.faces)
    target = TriangleMesh(1.02 * second.vertices, second.faces)
    models = {
        24.0: {"run": second, "scaled": larger, "target": target},
        22.0: {"run": first},
    }
    other = shaped(second)
    observed = {
        22.0: ObservedBrain(
            "b22", first, PREPARED, {"start": other, "adjacent": other}
        ),
        24.0: ObservedBrain(
            "b24", second, other, {"start": PREPARED, "adjacent": other}
        ),
    }
    table = comparison_table(LABELS, models, observed, radius_mm=3.0)
    rows = [
        ("a", "b22", 22.0, 1.0, "run"),
        *(("a", "b24", 24.0, 3.0, model) for model in ("run", "scaled", "target")),
    ]
    names = ["start", "observed", "week", "horizon", "model"]
    assert list(table[names].itertuples(index=False, name=None)) == rows
    assert set(table["run"] + table["kind"]) == {"expectedpredicted"}
    table = table.set_index(["week", "model"])
    assert table.loc[(24.0, "scaled"), "distance_mm"] == pytest.approx(
        0.05 * RADIUS, rel=0.1
    )
    assert table.loc[(24.0, "scaled"), "volume_difference"] == pytest.approx(
        1.05**3 - 1
    )
    exact = table.drop(index=(24.0, "scaled"))
    assert (exact["distance_mm"] < 0.5).all()
    assert (exact["r_mean_curvature"] > 0.95).all()
    assert (table["r_start_mean_curvature"].abs() < 0.4).all()
    adjacent = [
        table.loc[(week, "run"), "r_adjacent_mean_curvature"] for week in (22.0, 24.0)
    ]
    assert adjacent == pytest.approx(
        [table.loc[(22.0, "run"), "r_start_mean_curvature"], 1.0]
    )
    # the best baseline is the target
    assert table["skill"].tolist() == pytest.approx(
        [np.nan, 1.0, -1.5, 0.0], abs=0.1, nan_ok=True
    )
    assert table.loc[
        (24.0, "target"), ["skill_low", "skill_high"]
    ].tolist() == pytest.approx([0, 0])
    assert set(table["resampled"]) == {"modes and patches of one brain, not subjects"}


def test_a_run_is_off_the_curve_that_it_followed_as_a_fraction_of_the_curve():
    models = {week: {"run": REAL} for week in (22.0, 25.0)}
    brain = ObservedBrain("b", REAL, PREPARED)
    table = comparison_table(
        LABELS, models, dict.fromkeys(models, brain), radius_mm=3.0
    )
    sizes = {
        25.0: {
            "area_cm2": area(REAL) / 100 / 1.1,
            "volume_ml": signed_volume(REAL) / 1000 / 0.8,
        }
    }
    table = add_curves(table, sizes).set_index("week")
    assert table.loc[
        25.0, ["area_off_curve", "volume_off_curve"]
    ].tolist() == pytest.approx([0.1, -0.2])
    assert table.loc[25.0, "curve_area_cm2"] == sizes[25.0]["area_cm2"]
    # no curve, no difference from one
    assert (
        table.loc[22.0, ["curve_area_cm2", "area_off_curve", "volume_off_curve"]]
        .isna()
        .all()
    )
