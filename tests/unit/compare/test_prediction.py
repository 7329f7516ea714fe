"""Predicted surfaces against the observed brain and the simpler predictions of a week."""

import numpy as np
import pandas as pd
import pytest
from shapes import rigid, sphere

from gyriflow.compare.placement import number_patches
from gyriflow.compare.prediction import endpoints, roughness_mm, with_skill
from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.report.labels import SIMPLER_WAYS

from .bumpy import RADIUS, bumpy, shaped


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
    patch = number_patches(shape.mesh.vertices, shape.areas, 5.0)
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
