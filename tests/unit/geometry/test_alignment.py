"""Steps towards planes, and the choice among poses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gyriflow.geometry.alignment import Fit, angle_deg, fits_from_all_sides, margin, step_towards_planes

RANDOM = np.random.default_rng(2)
POINTS = RANDOM.normal(size=(200, 3)) * [3.0, 2.0, 1.0] + [10.0, -5.0, 2.0]
NORMALS = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)
NORMALS = NORMALS[RANDOM.permutation(200)]


def turned(degrees, axis=(0.0, 0.0, 1.0)):
    return Rotation.from_rotvec(np.array(axis) * degrees, degrees=True).as_matrix()


def test_a_small_motion_is_taken_back_in_one_step():
    turn, move = turned(0.01, (0.6, 0.0, 0.8)), np.array([0.002, -0.001, 0.003])
    targets = POINTS @ turn.T + move
    found, shift = step_towards_planes(POINTS, NORMALS, np.einsum("ij,ij->i", targets - POINTS, NORMALS))
    np.testing.assert_allclose(POINTS @ found.T + shift, targets, atol=1e-5)


def test_a_sphere_is_not_turned():
    ball = NORMALS - NORMALS.mean(axis=0)
    rotation, _ = step_towards_planes(ball, ball, RANDOM.normal(size=200) * 0.01)
    assert angle_deg(rotation) < 1e-6


def test_the_best_poses_that_differ_are_compared_and_the_first_start_always():
    # four poses, the second and third alike; the one that looks worse becomes the best
    rough = {0.0: 3.0, 90.0: 1.0, 95.0: 1.1, 180.0: 2.0, 270.0: 2.5}
    asked = []

    def roughly(start):
        return Fit(start, np.zeros(3), rough[round(float(np.degrees(np.arctan2(start[1, 0], start[0, 0])) % 360))])

    def better(fit):
        asked.append(fit.residual)
        return Fit(fit.rotation, fit.shift, {3.0: 1.5, 1.0: 0.9, 2.0: 0.6}[fit.residual])

    fits = fits_from_all_sides([turned(angle) for angle in rough], roughly, better, candidates=2, apart_deg=30.0)
    assert asked == [3.0, 1.0, 2.0]
    assert [fit.residual for fit in fits] == [1.5, 0.9, 0.6]
    assert margin(fits, fits[2], 30.0) == pytest.approx(1.5)
    assert margin(fits[2:], fits[2], 30.0) == np.inf
