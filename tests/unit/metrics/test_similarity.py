"""Distances between surfaces of known distance and motion."""

import numpy as np
import pytest
from shapes import rigid, sphere

from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.metrics.similarity import aligned_distance


def test_a_motion_is_no_distance() -> None:
    # an ellipsoid with a bump, so that only one pose fits
    ball = sphere(1.0, 4)
    bump = 1 + 0.25 * np.exp(-8 * ((ball.vertices - np.array([0.6, 0.64, 0.48])) ** 2).sum(axis=1))
    mesh = TriangleMesh(ball.vertices * bump[:, None] * [20.0, 28.0, 16.0], ball.faces)
    result = aligned_distance(transformed(mesh, rigid(4.0, 6.0, 9.0, shift=(8.0, -5.0, 3.0))), mesh)
    assert result["symmetric_mean"] < 0.02
    assert result["hausdorff95"] < 0.05


def test_spheres_of_different_radius() -> None:
    assert aligned_distance(sphere(20.0), sphere(22.0)) == pytest.approx(
        {"symmetric_mean": 2.0, "hausdorff95": 2.0}, abs=0.05
    )


def test_hausdorff_sees_what_the_mean_does_not() -> None:
    smooth = sphere(25.0)
    tall = smooth.vertices.copy()
    cap = tall[:, 2] > 25.0 * np.cos(np.arccos(1 - 2 * 0.08))  # 8 % of the sphere's area
    tall[cap] *= 1.2
    result = aligned_distance(TriangleMesh(tall, smooth.faces), smooth)
    assert result["symmetric_mean"] < 1.0
    assert result["hausdorff95"] > 3.0
