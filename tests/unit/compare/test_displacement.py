"""Displacement from week to week against the measured one, on spheres whose growth is known."""

import numpy as np
import pytest
from facts import Facts
from shapes import sphere

from gyriflow.compare.displacement import displacement_table, vector_agreement
from gyriflow.errors import InputError

BALL = sphere(20.0)
POINTS, FACES = BALL.vertices, BALL.faces
TURN = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1.0]])


def stretched(week: float, factor: float = 1.0) -> np.ndarray:
    """Return a sphere that grows along x by a tenth a week, and along y by a part of it."""
    grown = 1 + factor * (week - 21) * np.array([0.10, 0.05, 0.0])
    return POINTS * grown


def test_equal_vectors_agree_and_parts_have_their_slope():
    generator = np.random.default_rng(1)
    u, v, weights = generator.normal(size=(50, 3)), generator.normal(size=(50, 3)), generator.uniform(1, 2, 50)
    assert vector_agreement(u, u, weights) == pytest.approx((1.0, 1.0))
    assert vector_agreement(0.4 * u, u, weights) == pytest.approx((1.0, 0.4))
    assert vector_agreement(-u, u, weights) == pytest.approx((-1.0, -1.0))
    assert abs(vector_agreement(u, v, weights)[0]) < 0.3
    assert np.isnan(vector_agreement(0 * u, u, weights)).all()


def test_displacement_agrees_whatever_pose_the_run_is_in():
    weeks = [21, 22, 24]
    measured = np.stack([stretched(week) for week in weeks])
    simulated = np.stack([stretched(week) @ TURN.T + [5, week, 0] for week in weeks])
    table = displacement_table(weeks, simulated, measured, FACES)
    assert table["from_week"].tolist() == [21, 22]
    assert table["test"].tolist() == ["comparison", "comparison"]
    assert table["displacement_r"].tolist() == pytest.approx([1.0, 1.0])
    assert table["displacement_slope"].tolist() == pytest.approx([1.0, 1.0], abs=1e-6)
    assert table["rms_mm"].tolist() == pytest.approx(table["measured_rms_mm"].tolist())
    half = displacement_table(weeks, np.stack([stretched(week, 0.5) for week in weeks]), measured, FACES)
    assert half["displacement_slope"].iloc[0] == pytest.approx(0.5)


def test_uniform_scaling_is_the_baseline():
    measured = np.stack([POINTS, POINTS * [1.1, 1.05, 1.0]])
    table = displacement_table([21, 22], measured, measured, FACES)
    # on a sphere, Σ x² = Σ y² = Σ z²: (0.1 + 0.05)/√(3 (0.1² + 0.05²))
    assert table["displacement_r_scaling"].iloc[0] == pytest.approx(0.15 / np.sqrt(3 * 0.0125), abs=0.01)
    scale = np.cbrt(1.1 * 1.05) - 1
    assert table["displacement_slope_scaling"].iloc[0] == pytest.approx(scale * 0.15 / 0.0125, rel=0.02)
    uniform = np.stack([POINTS, 1.2 * POINTS])
    alike = displacement_table([21, 22], uniform, uniform, FACES)
    assert alike["displacement_r_scaling"].iloc[0] == pytest.approx(1.0)
    assert alike["displacement_slope_scaling"].iloc[0] == pytest.approx(1.0)


def test_separate_bodies_may_move_relative_to_each_other():
    faces = np.concatenate([FACES, FACES + len(POINTS)])
    measured = np.stack(
        [np.concatenate([stretched(week) - [22, 0, 0], stretched(week) + [22, 0, 0]]) for week in (21, 22)]
    )
    apart = np.stack([measured[0], measured[1] + np.repeat([[-3.0, 0, 1], [2, 0, 0]], len(POINTS), axis=0)])
    table = displacement_table([21, 22], apart, measured, faces)
    assert table["displacement_r"].iloc[0] == pytest.approx(1.0)
    assert table["rms_mm"].iloc[0] == pytest.approx(table["measured_rms_mm"].iloc[0])
    one = displacement_table([21, 22], measured[:, : len(POINTS)], measured[:, : len(POINTS)], FACES)
    for name in ("displacement_r_scaling", "displacement_slope_scaling", "measured_rms_mm"):
        assert table[name].iloc[0] == pytest.approx(one[name].iloc[0])


def test_a_single_week_is_refused():
    with pytest.raises(InputError, check=Facts(1)):
        displacement_table([21], POINTS[None], POINTS[None], FACES)
