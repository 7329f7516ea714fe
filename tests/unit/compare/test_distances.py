"""Distances between surfaces whose distance is known."""

import numpy as np
import pytest
from shapes import rigid, sphere

from gyriflow.compare.distances import aligned_distances, bootstrap_distances, pairwise_distances, surface_distances
from gyriflow.geometry.triangles import TriangleMesh, transformed


def test_a_motion_is_no_distance():
    # an ellipsoid with a bump, so that only one pose fits
    ball = sphere(1.0, 4)
    bump = 1 + 0.25 * np.exp(-8 * ((ball.vertices - np.array([0.6, 0.64, 0.48])) ** 2).sum(axis=1))
    mesh = TriangleMesh(ball.vertices * bump[:, None] * [20.0, 28.0, 16.0], ball.faces)
    found = aligned_distances(transformed(mesh, rigid(4.0, 6.0, 9.0, shift=(8.0, -5.0, 3.0))), mesh)
    assert found["distance_mm"] < 0.02
    assert found["distance95_mm"] < 0.05


def test_spheres_of_different_radius():
    assert aligned_distances(sphere(20.0), sphere(22.0)) == pytest.approx(
        {"distance_mm": 2.0, "distance_left_mm": 2.0, "distance_right_mm": 2.0, "distance95_mm": 2.0}, abs=0.05
    )


def test_a_small_cap_changes_the_quantile_more_than_the_mean():
    smooth = sphere(25.0)
    tall = smooth.vertices.copy()
    cap = tall[:, 2] > 25.0 * np.cos(np.arccos(1 - 2 * 0.08))  # 8 % of the sphere's area
    tall[cap] *= 1.2
    found = aligned_distances(TriangleMesh(tall, smooth.faces), smooth)
    assert found["distance_mm"] < 1.0
    assert found["distance95_mm"] > 3.0


def raised(ball):
    """Return a ball whose two caps beyond 0.9 of a radius, a tenth of its area, are a tenth higher."""
    caps = np.abs(ball.vertices[:, 2:]) > 0.9 * np.linalg.norm(ball.vertices[0])
    return TriangleMesh(ball.vertices * np.where(caps, 1.1, 1.0), ball.faces)


def test_distances_are_weighted_by_area():
    ball = sphere(10.0)
    found = surface_distances(pairwise_distances(raised(ball), ball))
    assert found["distance_mm"] == pytest.approx(0.1, abs=0.05)
    assert found["distance95_mm"] == pytest.approx(1.0, abs=0.15)


def test_vertices_of_the_even_surface_are_measured_instead_of_the_observed_ones():
    ball, even = sphere(10.0), sphere(10.0, 2)
    larger = sphere(11.0)
    for mesh in (ball, even):
        (first, there), (second, back) = pairwise_distances(larger, ball, mesh)
        assert first is larger
        assert second is mesh
        assert len(back) == len(mesh.vertices)
        assert there == pytest.approx(np.ones(len(larger.vertices)), abs=0.02)
        assert back == pytest.approx(np.ones(len(mesh.vertices)), abs=0.02)


def test_each_side_of_the_middle_has_its_distance():
    ball = sphere(10.0)
    # waves on the right only
    right = np.where(ball.vertices[:, 0] > 0, 1 + 0.05 * np.cos(np.arctan2(*ball.vertices[:, 1:].T) * 8), 1.0)
    found = surface_distances(pairwise_distances(TriangleMesh(ball.vertices * right[:, None], ball.faces), ball))
    assert found["distance_right_mm"] > 5 * found["distance_left_mm"]
    assert found["distance_mm"] == pytest.approx((found["distance_left_mm"] + found["distance_right_mm"]) / 2, rel=0.05)
    half = TriangleMesh(ball.vertices + [20.0, 0, 0], ball.faces)
    assert np.isnan(surface_distances(pairwise_distances(half, half))["distance_left_mm"])


def test_distances_of_drawn_patches_are_those_of_these_patches():
    ball = sphere(10.0)
    pair = pairwise_distances(raised(ball), ball)
    # patch 1 is the upper cap, patch 0 the rest
    patch = (ball.vertices[:, 2] > 9.0).astype(np.int64)
    both, upper, twice = bootstrap_distances(pair, ball.vertices, patch, np.array([[1, 1], [0, 2], [1, 2]]))
    assert both == pytest.approx(surface_distances(pair)["distance_mm"])
    assert upper == pytest.approx(1.0, abs=0.1)
    assert both < twice < upper
