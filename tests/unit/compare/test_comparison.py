"""Comparison of a surface with an observed brain: each column, of surfaces that differ
in a known way."""

import numpy as np
import pytest
from shapes import ellipsoid, rigid, sphere, uneven

from gyriflow.compare.comparison import (
    GROUPS,
    ObservedBrain,
    aligned_distances,
    bootstrap_distances,
    compare,
    observed_brain,
    pairwise_distances,
    roughness_mm,
    surface_distances,
)
from gyriflow.geometry.matching import crossing_faces
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    merged,
    signed_volume,
    transformed,
)

from .bumpy import PREPARED, RADIUS, REAL, bumpy, shaped

OBSERVED = ObservedBrain(
    "b",
    REAL,
    PREPARED,
    {"start": shaped(bumpy(2)), "adjacent": shaped(bumpy(1, height=0.8))},
)


def grown(factor):
    """Return the observed brain in another pose, its lengths multiplied by a factor."""
    return transformed(
        REAL, rigid(0, 4, 8, shift=(3, -2, 1)) @ np.diag([factor] * 3 + [1.0])
    )


def test_a_brain_that_is_a_fiftieth_too_large_has_this_difference_in_its_place():
    found, samples = compare(grown(1.02), OBSERVED, radius_mm=3.0)
    # a ball of 20 mm with shallow bumps: 50 cm², 34 mL
    assert found["observed_area_cm2"] == pytest.approx(area(REAL) / 100)
    assert found["area_cm2"] == pytest.approx(1.02**2 * area(REAL) / 100)
    assert found["volume_ml"] == pytest.approx(1.02**3 * signed_volume(REAL) / 1000)
    assert found["observed_volume_ml"] == pytest.approx(
        4 / 3 * np.pi * RADIUS**3 / 1000, rel=0.1
    )
    assert found["area_difference"] == pytest.approx(1.02**2 - 1)
    assert found["volume_difference"] == pytest.approx(1.02**3 - 1)
    assert found["relative_area"] == pytest.approx(
        area(REAL) / signed_volume(REAL) ** (2 / 3)
    )
    assert found["relative_area"] == pytest.approx(found["observed_relative_area"])
    # as they are, not scaled: a fiftieth of the radius everywhere
    assert found["distance_mm"] == pytest.approx(
        0.02 * np.linalg.norm(REAL.vertices, axis=1).mean(), rel=0.05
    )
    assert found["distance95_mm"] > found["distance_mm"]
    assert 0.7 < found["cortex_dice"] < 0.99
    # folds are compared after scaling
    assert found["r_shape_index"] > 0.95
    assert found["curvature_rms_ratio"] == pytest.approx(1.0, abs=0.05)
    assert found["crossing_faces"] == 0
    assert (found["is_symmetric"], found["asymmetry_mm"] > 0.4) == (False, True)
    for name in ("distance_mm", "r_shape_index"):
        assert samples[name][0] == pytest.approx(found[name])
    assert found["distance_mm_low"] < found["distance_mm"] < found["distance_mm_high"]


def test_columns_that_are_left_out_change_no_other():
    larger = grown(1.05)
    every, first, second = (
        compare(larger, OBSERVED, radius_mm=3.0, groups=groups)[0]
        for groups in (
            GROUPS,
            ["size", "folds", "intervals"],
            ["distance", "quality"],
        )
    )
    assert first | second == pytest.approx(every)
    assert first.keys() & second.keys() == {"distance_mm"}


def test_flatter_waves_are_too_smooth_and_deeper_ones_too_folded():
    observed, heights = observed_brain("b", REAL, 3.0), (0.4, 1.6)
    groups = ["folds", "quality"]
    flat, deep = (
        compare(bumpy(1, height), observed, radius_mm=3.0, groups=groups)[0]
        for height in heights
    )
    assert flat["curvature_rms_ratio"] < 0.97 < 1.05 < deep["curvature_rms_ratio"]
    assert flat["roughness_ratio"] < 1 < deep["roughness_ratio"] - 0.03


def test_faces_that_cross_are_those_of_the_predicted_surface():
    crossed = merged(
        sphere(10.0, 2), transformed(sphere(10.0, 2), rigid(0, 0, 0, shift=(5, 0, 0)))
    )
    found, _ = compare(crossed, OBSERVED, radius_mm=3.0, groups=["quality"])
    # not those of the same surface with other triangles
    assert found["crossing_faces"] == crossing_faces(crossed) > 10


def test_folds_are_measured_with_the_radius_that_is_asked_for():
    sharp = bumpy(1, height=2.0, sharpness=60.0)
    fine, coarse = (
        compare(sharp, OBSERVED, radius_mm=radius, groups=["folds"])[0][
            "curvature_rms_ratio"
        ]
        for radius in (3.0, 6.0)
    )
    assert coarse < 0.9 * fine


def test_patches_of_a_symmetric_brain_are_drawn_with_their_mirror_images():
    brain = ellipsoid((30.0, 40.0, 26.0))
    observed = ObservedBrain("b", brain, shaped(brain, np.zeros(len(brain.vertices))))
    patch, drawn = observed.patch
    assert observed.resampling.is_symmetric
    # about 400 mm² on either side
    assert drawn.shape[1] == pytest.approx(area(brain) / 2 / 400, rel=0.1)
    left = brain.vertices[:, 0] < -5
    image = [
        np.linalg.norm(brain.vertices - point, axis=1).argmin()
        for point in brain.vertices[left] * [-1, 1, 1]
    ]
    assert np.mean(patch[left] == patch[image]) > 0.95


def test_jagged_vertices_are_rough_and_even_ones_are_not():
    ball = sphere(10.0)
    ends = np.random.default_rng(0).choice([-0.1, 0.1], len(ball.vertices))
    jagged = TriangleMesh(ball.vertices * (1 + ends[:, None] / 10), ball.faces)
    assert roughness_mm(ball) < 0.03
    # a vertex is 0.1 away, the mean of its six neighbours 0.1/√6
    rough_mm = 0.1 * np.sqrt(1 + 1 / 6)
    assert roughness_mm(jagged) == pytest.approx(rough_mm, rel=0.1)
    # the lower half alone, which has half of the area and far fewer vertices
    low = uneven(sphere(10.0, 5), ratio=3.0)
    ends = np.random.default_rng(0).choice([-0.1, 0.1], len(low.vertices))
    ends[low.vertices[:, 2] > 0] = 0.0
    jagged = TriangleMesh(low.vertices * (1 + ends[:, None] / 10), low.faces)
    assert roughness_mm(jagged) == pytest.approx(rough_mm / np.sqrt(2), rel=0.1)


def test_a_motion_is_no_distance():
    # an ellipsoid with a bump, so that only one pose fits
    ball = sphere(1.0, 4)
    bump = 1 + 0.25 * np.exp(
        -8 * ((ball.vertices - np.array([0.6, 0.64, 0.48])) ** 2).sum(axis=1)
    )
    mesh = TriangleMesh(ball.vertices * bump[:, None] * [20.0, 28.0, 16.0], ball.faces)
    found = aligned_distances(
        transformed(mesh, rigid(4.0, 6.0, 9.0, shift=(8.0, -5.0, 3.0))), mesh
    )
    assert found["distance_mm"] < 0.02
    assert found["distance95_mm"] < 0.05


def test_spheres_of_different_radius():
    assert aligned_distances(sphere(20.0), sphere(22.0)) == pytest.approx(
        {
            "distance_mm": 2.0,
            "distance_left_mm": 2.0,
            "distance_right_mm": 2.0,
            "distance95_mm": 2.0,
        },
        abs=0.05,
    )


def raised(ball):
    """Return a ball whose two caps beyond 0.9 of a radius, a tenth of its area, are a
    tenth higher."""
    caps = np.abs(ball.vertices[:, 2:]) > 0.9 * np.linalg.norm(ball.vertices[0])
    return TriangleMesh(ball.vertices * np.where(caps, 1.1, 1.0), ball.faces)


def test_distances_are_weighted_by_area():
    ball = uneven(sphere(10.0))
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
    ball = uneven(sphere(10.0, 5))
    x, _, z = ball.vertices.T
    # half a millimetre on the lower right, a tenth on the lower left; the triangles
    # below are the wide ones
    raised_mm = np.where(z < 0, np.where(x > 0, 0.5, 0.1), 0.0)
    larger = TriangleMesh(ball.vertices * (1 + raised_mm / 10)[:, None], ball.faces)
    found = surface_distances(pairwise_distances(larger, ball))
    for side, mm in (("right", 0.5), ("left", 0.1)):
        # of the larger surface, and of the ball
        shares = (1 + mm / 10) ** 2 / (1 + (1 + mm / 10) ** 2), 0.5
        assert found[f"distance_{side}_mm"] == pytest.approx(
            mm * np.mean(shares), rel=0.12
        )
    assert found["distance_mm"] == pytest.approx(
        (found["distance_left_mm"] + found["distance_right_mm"]) / 2, rel=0.05
    )
    half = TriangleMesh(ball.vertices + [20.0, 0, 0], ball.faces)
    assert np.isnan(
        surface_distances(pairwise_distances(half, half))["distance_left_mm"]
    )


def test_distances_of_drawn_patches_are_those_of_these_patches():
    ball = uneven(sphere(10.0))
    pair = pairwise_distances(raised(ball), ball)
    # patch 1 is the upper cap, patch 0 the rest
    patch = (ball.vertices[:, 2] > 9.0).astype(np.int64)
    both, upper, twice = bootstrap_distances(
        pair, ball.vertices, patch, np.array([[1, 1], [0, 2], [1, 2]])
    )
    assert both == pytest.approx(surface_distances(pair)["distance_mm"])
    assert upper == pytest.approx(1.0, abs=0.1)
    assert both < twice < upper
