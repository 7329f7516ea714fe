"""Predicted surfaces against the observed brain and the simpler predictions of a week."""

import numpy as np
import pandas as pd
import pytest
from shapes import rigid, sphere

from gyriflow.compare.placement import number_patches
from gyriflow.compare.prediction import add_skill, prediction_row, prediction_table, roughness_mm, simple_predictions
from gyriflow.geometry.triangles import TriangleMesh, signed_volume, transformed
from gyriflow.report.labels import SIMPLER_PREDICTIONS

from .bumpy import RADIUS, REAL, bumpy, shaped


def test_jagged_vertices_are_rough_and_even_ones_are_not():
    ball = sphere(10.0)
    ends = np.random.default_rng(0).choice([-0.1, 0.1], len(ball.vertices))
    jagged = TriangleMesh(ball.vertices * (1 + ends[:, None] / 10), ball.faces)
    assert roughness_mm(ball) < 0.03
    # a vertex is 0.1 away, the mean of its six neighbours 0.1/√6
    assert roughness_mm(jagged) == pytest.approx(0.1 * np.sqrt(1 + 1 / 6), rel=0.1)


def test_an_exact_prediction_has_no_error():
    real = bumpy(1, height=1.0)
    shape = shaped(real)
    patch = number_patches(shape.mesh.vertices, shape.areas, 5.0)
    moved = transformed(real, rigid(2, -3, 4, shift=(1, 2, 1)))
    own = prediction_row(moved, shape, real, shape, patch)
    assert own["distance_mm"] < 0.02
    assert own["cortex_dice"] > 0.97
    assert own["crossing_faces"] == 0
    for name in ("r_shape_index", "r_shape_index_low", "r_mean_curvature", "roughness_ratio", "curvature_rms_ratio"):
        assert own[name] == pytest.approx(1), name
    grown = transformed(real, np.diag([1.1, 1.1, 1.1, 1.0]))
    found = prediction_row(grown, shape, real, shape, patch)
    assert found["area_error"] == pytest.approx(0.21)
    assert found["volume_error"] == pytest.approx(0.331)
    assert found["distance_mm"] == pytest.approx(0.1 * RADIUS, rel=0.1)
    other = bumpy(2, height=1.0)
    unlike = prediction_row(other, shaped(other), real, shape, patch)
    assert abs(unlike["r_shape_index"]) < 0.4
    for name in ("r_shape_index", "distance_mm"):
        assert unlike[f"{name}_low"] < unlike[name] < unlike[f"{name}_high"]


def drawn_distances(weeks: dict[int, dict[str, list[float]]]) -> pd.DataFrame:
    rows = [(week, name, np.array(draws)) for week, models in weeks.items() for name, draws in models.items()]
    return pd.DataFrame(rows, columns=["week", "model", "drawn_mm"])


def test_skill_is_against_the_best_baseline_of_the_week_the_target_among_them():
    names = ["run", *SIMPLER_PREDICTIONS]
    away = {22: [0.3, 0.6, 0.8, 0.9, 1.2, 0.7], 23: [0.9, 0.9, 0.8, 0.6, 1.2, 0.45]}
    # the skill is the same in every draw if all distances are multiplied by one factor
    rows = drawn_distances(
        {week: {name: [x, x, 2 * x] for name, x in zip(names, values, strict=True)} for week, values in away.items()}
    )
    table = add_skill(rows).set_index(["week", "model"])
    assert "drawn_mm" not in table
    found = table["skill"]
    assert table["skill_low"].to_numpy() == pytest.approx(found.to_numpy())
    assert table["skill_high"].to_numpy() == pytest.approx(found.to_numpy())
    assert (found[22, "run"], found[22, "scaled"], found[22, "displaced"]) == pytest.approx((0.5, 0.0, -1.0))
    assert (found[23, "run"], found[23, "target"]) == pytest.approx((-1.0, 0.0))
    alone = add_skill(rows[rows["model"] == "run"])
    assert alone[["skill", "skill_low", "skill_high"]].isna().all(axis=None)


def test_the_best_baseline_is_chosen_in_each_sample_anew():
    # of two baselines, each sample has another one that is as good as the run
    swapped = {"run": [1, 1, 1], "scaled": [1.9, 1, 3], "atlas": [2, 3, 1]}
    (run, *_) = add_skill(drawn_distances({22: swapped})).to_dict("records")
    assert (run["skill"], run["skill_low"], run["skill_high"]) == pytest.approx((1 - 1 / 1.9, 0, 0))


def test_simple_predictions_have_the_volume_of_the_target_or_are_taken_as_they_are():
    start, target = sphere(10.0), REAL
    registered = {"atlas": sphere(12.0), "displaced": sphere(13.0)}
    models = simple_predictions(start, target, registered, None)
    assert list(models) == ["scaled", "atlas", "displaced", "target"]
    assert models["target"] is target
    assert models["displaced"] is registered["displaced"]
    for name in ("scaled", "atlas"):
        assert signed_volume(models[name]) == pytest.approx(signed_volume(target))
    assert np.ptp(np.linalg.norm(models["atlas"].vertices, axis=1)) < 1e-9
    # the atlas' own surface of the week instead of the interpolated one
    own = simple_predictions(start, target, registered, bumpy(2, height=3.0))["atlas"]
    assert signed_volume(own) == pytest.approx(signed_volume(target))
    assert np.ptp(np.linalg.norm(own.vertices, axis=1)) > 1.0


def test_each_week_and_model_is_compared_with_the_observed_brain_of_its_week():
    first, second = REAL, bumpy(2)
    larger = TriangleMesh(1.05 * second.vertices, second.faces)
    target = TriangleMesh(1.02 * second.vertices, second.faces)
    models = {22.0: {"run": first}, 24.0: {"run": second, "scaled": larger, "target": target}}
    observed = {22.0: first, 24.0: second}
    labels = {"run": "expected", "start": "a", "start_week": 21.0}
    prepared = {week: shaped(mesh) for week, mesh in observed.items()}
    table = prediction_table(labels, models, observed, prepared, radius_mm=3.0)
    rows = [("a", 22.0, 1.0, "run"), ("a", 24.0, 3.0, "run"), ("a", 24.0, 3.0, "scaled"), ("a", 24.0, 3.0, "target")]
    assert list(table[["start", "week", "horizon", "model"]].itertuples(index=False, name=None)) == rows
    table = table.set_index(["week", "model"])
    assert table.loc[(24.0, "scaled"), "distance_mm"] == pytest.approx(0.05 * RADIUS, rel=0.1)
    assert table.loc[(24.0, "scaled"), "volume_error"] == pytest.approx(1.05**3 - 1)
    exact = table.drop(index=(24.0, "scaled"))
    assert (exact["distance_mm"] < 0.5).all()
    assert (exact["r_mean_curvature"] > 0.95).all()
    # the best baseline is the target
    assert table["skill"].tolist() == pytest.approx([np.nan, 1.0, -1.5, 0.0], abs=0.1, nan_ok=True)
    assert table.loc[(24.0, "target"), ["skill_low", "skill_high"]].tolist() == pytest.approx([0, 0])
    assert set(table["resampled"]) == {"patches of one brain, not subjects"}
