"""Comparison of a surface with an observed brain: each column, of surfaces that differ
in a known way."""

import numpy as np
import pytest
from facts import Facts
from shapes import ellipsoid, moved, rigid, sphere, uneven

from gyriflow.compare.comparison import (
    GROUPS,
    ObservedBrain,
    bootstrap_distances,
    compare,
    roughness_mm,
    surface_distances,
)
from gyriflow.compare.shapes import interpolate_measures
from gyriflow.geometry.matching import faces_that_cross
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    merged,
    transformed,
    vertex_areas,
)

from .bumpy import PREPARED, RADIUS, REAL, bumpy, shaped

OTHERS = {"start": bumpy(2), "adjacent": bumpy(1, height=0.7)}
OBSERVED = ObservedBrain(
    "b",
    REAL,
    PREPARED,
    {
        name: interpolate_measures(shaped(mesh), PREPARED)[0]
        for name, mesh in OTHERS.items()
    },
)


def grown(factor):
    """Return the observed brain in another pose, its lengths multiplied by a factor."""
    return transformed(
        REAL, rigid(0, 4, 8, shift=(3, -2, 1)) @ np.diag([factor] * 3 + [1.0])
    )


def test_a_larger_brain_differs_in_size_and_distance_and_not_in_its_folds():
    found, samples = compare(grown(1.02), OBSERVED, radius_mm=3.0)
    assert found["area_difference"] == pytest.approx(1.02**2 - 1)
    assert found["volume_difference"] == pytest.approx(1.02**3 - 1)
    # a fiftieth of the radius everywhere
    assert found["distance_mm"] == pytest.approx(0.02 * RADIUS, rel=0.1)
    assert found["distance_mm_low"] < found["distance_mm"] < found["distance_mm_high"]
    # folds are compared after scaling
    assert found["r_shape_index"] > 0.95
    assert found["curvature_rms_ratio"] == pytest.approx(1.0, abs=0.05)
    assert (found["crossing_faces"], found["is_symmetric"]) == (0, False)
    assert found["resampled"] == Facts("modes", "not subjects")
    for name in ("distance_mm", "r_shape_index"):
        assert samples[name][0] == pytest.approx(found[name])


def test_columns_that_are_left_out_change_no_other():
    larger = grown(1.05)
    choices = GROUPS, ["size", "folds", "intervals"], ["distance", "quality"]
    every, first, second = (
        compare(larger, OBSERVED, radius_mm=3.0, groups=groups)[0] for groups in choices
    )
    assert first | second == pytest.approx(every)
    assert first.keys() & second.keys() == {"distance_mm"}


def test_faces_that_cross_are_those_of_the_predicted_surface():
    crossed = merged(sphere(5.0, 2), moved(sphere(5.0, 2), 2.5))
    ball = sphere(5.0)
    small = ObservedBrain("b", ball, shaped(ball, np.zeros(len(ball.vertices))))
    found, _ = compare(crossed, small, radius_mm=3.0, groups=["quality"])
    # not those of the same surface with other triangles
    assert found["crossing_faces"] == len(faces_that_cross(crossed)) > 10


def test_patches_of_a_symmetric_brain_are_drawn_with_their_mirror_images():
    brain = ellipsoid((20.0, 26.0, 18.0))
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


def test_roughness_is_that_of_single_vertices_by_area():
    assert roughness_mm(sphere(10.0)) < 0.03
    # of the lower half alone, which has half of the area and far fewer vertices
    ball = uneven(sphere(10.0, 5), ratio=3.0)
    ends = np.random.default_rng(0).choice([-0.01, 0.01], len(ball.vertices))
    ends[ball.vertices[:, 2] > 0] = 0.0
    jagged = TriangleMesh(ball.vertices * (1 + ends[:, None]), ball.faces)
    # a vertex is 0.1 mm away, the mean of its six neighbours 0.1/√6
    rough_mm = 0.1 * np.sqrt(1 + 1 / 6)
    assert roughness_mm(jagged) == pytest.approx(rough_mm / np.sqrt(2), rel=0.1)


# triangles below are wider than those above
BALL = uneven(sphere(10.0))
X, _, Z = BALL.vertices.T


def pair_of(distances, back=0.0):
    """Return the distances of two balls from each other at their vertices."""
    return [(BALL, distances), (BALL, np.full(len(Z), back))]


def test_distances_are_weighted_by_area():
    # two caps with a tenth of the area
    found = surface_distances(pair_of(np.where(np.abs(Z) > 9.0, 1.0, 0.2), 0.5))
    assert found["distance_mm"] == pytest.approx((0.28 + 0.5) / 2, abs=0.02)
    assert found["distance95_mm"] == 1.0


def test_each_side_of_the_middle_has_its_distance():
    below = np.where(Z < 0, np.where(X > 0, 0.5, 0.1), 0.0)
    found = surface_distances(pair_of(below, 0.3))
    assert found["distance_right_mm"] == pytest.approx((0.25 + 0.3) / 2, abs=0.02)
    assert found["distance_left_mm"] == pytest.approx((0.05 + 0.3) / 2, abs=0.02)
    half = moved(BALL, 20.0)
    found = surface_distances([(half, X), (half, X)])
    assert np.isnan(found["distance_left_mm"])


def test_distances_of_drawn_patches_are_those_of_these_patches():
    # patch 1 is the upper cap, patch 0 the rest
    is_cap = Z > 9.0
    pair = pair_of(is_cap.astype(float), 0.5)
    drawn = np.array([[1, 1], [0, 2], [1, 2]])
    both, cap, twice = bootstrap_distances(
        pair, BALL.vertices, is_cap.astype(np.int64), drawn
    )
    assert both == pytest.approx(surface_distances(pair)["distance_mm"])
    assert cap == pytest.approx((1.0 + 0.5) / 2)
    share = vertex_areas(BALL)[is_cap].sum() / vertex_areas(BALL).sum()
    assert twice == pytest.approx((2 * share / (1 + share) + 0.5) / 2)
