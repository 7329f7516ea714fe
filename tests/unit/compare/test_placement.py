"""Folds in their places: correlations, gains with their intervals, and skill."""

import numpy as np
import pytest
from shapes import moved, rigid

from gyriflow.compare.placement import correlation, gain_interval, make_patches, number_patches, score_placement, skill
from gyriflow.compare.shapes import PreparedSurface, prepare_for_comparison
from gyriflow.geometry.triangles import TriangleMesh, merged, transformed

from .bumpy import PREPARED, RADIUS, REAL, SMOOTH, bumpy, field, shaped


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=len(REAL.vertices))


def test_weighted_correlation_is_that_of_repeated_values():
    x, y, weights = np.array([1.0, 2.0, 4.0]), np.array([1.0, 3.0, 2.0]), np.array([1, 2, 3])
    repeated = np.corrcoef(np.repeat(x, weights), np.repeat(y, weights))[0, 1]
    assert correlation(x, y, weights.astype(float)) == pytest.approx(repeated)
    assert np.isnan(correlation(x, np.full(3, 0.3), np.ones(3)))


def test_skill_is_between_the_start_and_the_adjacent_week():
    assert skill(0.6, 0.4, 0.8, 4) == pytest.approx(0.5)
    assert skill(0.2, 0.4, 0.8, 2) == pytest.approx(-0.5)
    assert np.isnan(skill(0.6, 0.4, 0.8, 1))
    assert np.isnan(skill(0.6, 0.4, 0.3, 4))


def test_a_brain_moved_and_scaled_back_has_its_folds_in_place():
    scaled = transformed(REAL, rigid(0, 0, 12, shift=(5, -3, 2)) @ np.diag([0.7, 0.7, 0.7, 1.0]))
    aligned = prepare_for_comparison(scaled, REAL)
    row = score_placement(aligned, PREPARED, shaped(SMOOTH, noise(1)), PREPARED, horizon=3)
    assert row["r_mean_curvature"] > 0.95
    assert row["r_start_mean_curvature"] == pytest.approx(0, abs=0.06)
    assert row["matched_share"] == pytest.approx(1.0)
    rotated = score_placement(shaped(transformed(REAL, rigid(0, 0, 90))), PREPARED, PREPARED, PREPARED, horizon=3)
    assert abs(rotated["r_mean_curvature"]) < 0.25


def test_noise_lowers_the_correlation_by_its_variance():
    pattern = PREPARED.mean_curvature
    added = pattern + pattern.std() * noise(4)
    row = score_placement(PreparedSurface(REAL, added, added), PREPARED, shaped(SMOOTH, noise(2)), PREPARED, horizon=3)
    assert row["r_mean_curvature"] == pytest.approx(1 / np.sqrt(2), abs=0.06)
    assert row["skill_mean_curvature"] == pytest.approx(row["r_mean_curvature"], abs=0.08)
    assert row["gain_low_mean_curvature"] < row["gain_mean_curvature"] < row["gain_high_mean_curvature"]
    assert row["gain_low_mean_curvature"] > 0


def test_interval_is_as_wide_as_gains_scatter_from_surface_to_surface():
    points, areas = SMOOTH.vertices, np.ones(len(SMOOTH.vertices))
    directions = points / RADIUS
    patch = number_patches(points, np.full(len(points), 4 * np.pi * RADIUS**2 / len(points)), 10.0)
    gains, inside = [], []
    for seed in range(30):
        shared, own, other = (field(directions, 100 * seed + k) for k in range(3))
        truth, run, start = shared, shared + own, 0.5 * shared + other
        gains.append(correlation(truth, run, areas) - correlation(truth, start, areas))
        low, high = gain_interval(truth, run, start, areas, patch)
        expected = 1 / np.sqrt(2) - 0.5 / np.sqrt(1.25)
        inside.append(low < expected < high)
    assert np.mean(inside) > 0.75
    assert gain_interval(truth, run, start, areas, patch) == (low, high)


def two_sided(mesh: TriangleMesh) -> TriangleMesh:
    """Return a brain of the surface on the right and its mirror image on the left."""
    return merged(right := moved(mesh, 1.5 * RADIUS), transformed(right, np.diag([-1.0, 1.0, 1.0, 1.0])))


def test_mirror_patches_are_drawn_together_where_the_brain_is_its_mirror_image():
    brain = two_sided(REAL)
    half = len(REAL.vertices)
    # in any pose
    posed = transformed(brain, rigid(0, 0, 8, shift=(5, -3, 2)))
    patch, drawn = make_patches(shaped(posed, np.zeros(2 * half)))
    assert drawn["mirrored_patches"] is True
    assert drawn["asymmetry_mm"] == pytest.approx(0, abs=0.02)
    assert np.mean(patch[:half] == patch[half:]) > 0.98
    assert patch.max() + 1 == round(shaped(posed, np.zeros(2 * half)).areas.sum() / 20**2 / 2)
    # another brain on the other side: only on demand
    other = bumpy(5).vertices - [1.5 * RADIUS, 0, 0]
    both = np.concatenate([REAL.faces, REAL.faces + half])
    shape = shaped(TriangleMesh(np.concatenate([brain.vertices[:half], other]), both), np.zeros(2 * half))
    patch, drawn = make_patches(shape)
    assert drawn["mirrored_patches"] is False
    assert drawn["asymmetry_mm"] > 0.4
    assert not set(patch[:half]) & set(patch[half:])
    patch, drawn = make_patches(shape, mirrored=True)
    assert drawn["mirrored_patches"] is True
    assert set(patch[:half]) & set(patch[half:])


def test_intervals_of_symmetric_brains_are_root_two_wider_when_mirror_patches_are_drawn_together():
    brain = two_sided(SMOOTH)
    areas = np.ones(len(brain.vertices))
    directions = SMOOTH.vertices / RADIUS
    place = brain.vertices * [-1, 1, 1]
    sizes = np.full(len(areas), 8 * np.pi * RADIUS**2 / len(areas))
    ratios = []
    for seed in range(10):
        shared, own, other = (np.tile(field(directions, 100 * seed + k), 2) for k in range(3))
        widths = [
            np.ptp(gain_interval(shared, shared + own, 0.5 * shared + other, areas, patch))
            for patch in (number_patches(brain.vertices, sizes, 10.0, image) for image in (None, place))
        ]
        ratios.append(widths[1] / widths[0])
    assert np.mean(ratios) == pytest.approx(np.sqrt(2), abs=0.15)
