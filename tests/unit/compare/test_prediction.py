"""What a foretold brain is worth, and how the real one deviates from it: known distances, sizes, roughness, skill."""

import numpy as np
import pandas as pd
import pytest
from shapes import rigid, sphere

from gyriflow.compare.placement import patches
from gyriflow.compare.prediction import apart, deviation_maps, distances, endpoints, roughness_mm, with_skill
from gyriflow.compare.shapes import ready
from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.report.labels import SIMPLER_WAYS

from .bumpy import RADIUS, bumpy, shaped


def lying_apart(found, real):
    return distances(apart(found, real, ready(real, real)))


def test_distances_are_weighted_by_area_and_the_far_ones_are_a_quantile():
    ball = sphere(10.0)
    # the two caps beyond 0.9 of a radius have a tenth of a ball's area
    caps = np.abs(ball.vertices[:, 2:]) > 9.0
    raised = TriangleMesh(ball.vertices * np.where(caps, 1.1, 1.0), ball.faces)
    found = lying_apart(raised, ball)
    assert found["distance_mm"] == pytest.approx(0.1, abs=0.05)
    assert found["distance95_mm"] == pytest.approx(1.0, abs=0.15)


def test_each_side_of_the_middle_has_its_distance():
    ball = sphere(10.0)
    # waves on the right only
    right = np.where(ball.vertices[:, 0] > 0, 1 + 0.05 * np.cos(np.arctan2(*ball.vertices[:, 1:].T) * 8), 1.0)
    found = lying_apart(TriangleMesh(ball.vertices * right[:, None], ball.faces), ball)
    assert found["distance_right_mm"] > 5 * found["distance_left_mm"]
    assert found["distance_mm"] == pytest.approx((found["distance_left_mm"] + found["distance_right_mm"]) / 2, rel=0.05)
    half = TriangleMesh(ball.vertices + [20.0, 0, 0], ball.faces)
    assert np.isnan(lying_apart(half, half)["distance_left_mm"])


def test_jagged_vertices_are_rough_and_even_ones_are_not():
    ball = sphere(10.0)
    ends = np.random.default_rng(0).choice([-0.1, 0.1], len(ball.vertices))
    jagged = TriangleMesh(ball.vertices * (1 + ends[:, None] / 10), ball.faces)
    assert roughness_mm(ball) < 0.03
    # a vertex is 0.1 away, the mean of its six neighbours 0.1/√6
    assert roughness_mm(jagged) == pytest.approx(0.1 * np.sqrt(1 + 1 / 6), rel=0.1)


def test_a_surface_is_worth_most_against_itself():
    real = bumpy(1, height=1.0)
    shape = shaped(real)
    patch = patches(shape.mesh.vertices, shape.areas, 5.0)
    moved = transformed(real, rigid(2, -3, 4, shift=(1, 2, 1)))
    own = endpoints(moved, real, shape, shape, patch)
    assert own["distance_mm"] < 0.02
    assert own["cortex_dice"] > 0.97
    assert own["crossing_faces"] == 0
    for name in ("r_shape_index", "r_shape_index_low", "r_mean_curvature", "roughness_ratio", "curvature_rms_ratio"):
        assert own[name] == pytest.approx(1), name
    grown = transformed(real, np.diag([1.1, 1.1, 1.1, 1.0]))
    found = endpoints(grown, real, shape, shape, patch)
    assert found["area_error"] == pytest.approx(0.21)
    assert found["volume_error"] == pytest.approx(0.331)
    assert found["distance_mm"] == pytest.approx(0.1 * RADIUS, rel=0.1)
    other = bumpy(2, height=1.0)
    unlike = endpoints(other, real, shaped(other), shape, patch)
    assert abs(unlike["r_shape_index"]) < 0.4
    for name in ("r_shape_index", "distance_mm"):
        assert unlike[f"{name}_low"] < unlike[name] < unlike[f"{name}_high"]


def test_skill_is_against_the_best_simple_way_of_the_week():
    names = ["run", *SIMPLER_WAYS]
    away = {22: [0.3, 0.6, 0.8, 0.9, 1.2, 0.1], 23: [0.9, 0.9, 0.8, 0.45, 1.2, 0.2]}
    rows = pd.DataFrame(
        [(week, name, value) for week, values in away.items() for name, value in zip(names, values, strict=True)],
        columns=["week", "model", "distance_mm"],
    )
    # draws that are as far apart as the means, or twice as far for all alike, do not change the skill
    rows["drawn_mm"] = [value * np.array([1.0, 2.0]) for value in rows["distance_mm"]]
    table = with_skill(rows).set_index(["week", "model"])
    assert "drawn_mm" not in table
    found = table["skill"]
    assert table["skill_low"].to_numpy() == pytest.approx(found.to_numpy())
    assert table["skill_high"].to_numpy() == pytest.approx(found.to_numpy())
    assert (found[22, "run"], found[22, "scaled"], found[22, "displaced"]) == pytest.approx((0.5, 0.0, -1.0))
    assert (found[23, "run"], found[23, "atlas_deformed"]) == pytest.approx((-1.0, 0.0))
    alone = with_skill(rows[rows["model"] == "run"])
    assert alone[["skill", "skill_low", "skill_high"]].isna().all(axis=None)


BALL = sphere(20.0)


def scaled(factors):
    return TriangleMesh(BALL.vertices * factors, BALL.faces)


def test_a_larger_ball_lies_outside_and_has_more_area():
    maps = deviation_maps(BALL, scaled(1.1))
    np.testing.assert_allclose(maps["distance_mm"], 2.0, atol=0.01)
    np.testing.assert_allclose(maps["log_area"], 2 * np.log(1.1), atol=1e-6)
    smaller = deviation_maps(BALL, scaled(0.9))
    assert (smaller["distance_mm"] < 0).all()
    assert (smaller["log_area"] < 0).all()


def test_what_deviates_in_one_place_does_so_there_alone():
    top = np.linalg.norm(BALL.vertices - [0, 0, 20], axis=1) < 12
    maps = deviation_maps(BALL, scaled(np.where(top, 1.1, 1.0)[:, None]))
    assert maps["distance_mm"][top] == pytest.approx(2.0, abs=0.05)
    assert not maps["distance_mm"][~top].any()
    pole, opposite = BALL.vertices[:, 2].argmax(), BALL.vertices[:, 2].argmin()
    assert maps["log_area"][pole] == pytest.approx(2 * np.log(1.1), abs=0.01)
    assert maps["log_area"][opposite] == pytest.approx(0.0, abs=0.01)
