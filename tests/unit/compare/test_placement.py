"""Folds in their places: correlations, gains with their intervals, and skill."""

import numpy as np
import pytest
from facts import Facts
from shapes import moved, rigid

from gyriflow.compare.placement import correlation, correlation_scores, make_patches, number_patches, score_placement
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


def patchy(generator: np.random.Generator, count: int = 40) -> np.ndarray:
    """Return values of unit variance, six to a patch, that share half of it within their patch."""
    shared, own = generator.normal(size=(count, 1)), generator.normal(size=(count, 6))
    return ((shared + own) / np.sqrt(2)).ravel()


def drawn_scores(simulated: float, start: float, adjacent: float) -> list[dict]:
    """Return the scores of 200 surfaces whose values have these correlations with the observed ones."""
    generator, patch, rows = np.random.default_rng(1), np.repeat(np.arange(40), 6), []
    for _ in range(200):
        truth = patchy(generator)
        values = [r * truth + np.sqrt(1 - r**2) * patchy(generator) for r in (simulated, start, adjacent)]
        rows.append(correlation_scores(truth, *values, np.ones(len(patch)), patch))
    return rows


@pytest.mark.fault(85)
def test_intervals_hold_the_true_values_and_skill_its_own_where_there_is_room():
    rows = drawn_scores(0.6, 0.3, 0.8)
    assert {row["skill_flag"] for row in rows} == {"ok"}
    for name, true in {"r": 0.6, "gain": 0.3, "room": 0.5, "skill": 0.6}.items():
        assert 0.85 <= np.mean([row[f"{name}_low"] < true < row[f"{name}_high"] for row in rows]) <= 0.95, name


@pytest.mark.fault(85)
@pytest.mark.parametrize("adjacent", [0.2, 0.5, 0.52])
def test_a_baseline_that_is_no_better_than_the_start_leaves_no_room_for_skill(adjacent):
    rows = drawn_scores(0.3, 0.5, adjacent)
    without = [row for row in rows if row["skill_flag"] == "no room"]
    assert len(without) > 0.9 * len(rows)
    assert np.isnan([[row[name] for name in ("skill", "skill_low", "skill_high")] for row in without]).all()


def test_a_brain_moved_and_scaled_back_has_its_folds_in_place():
    scaled = transformed(REAL, rigid(0, 0, 12, shift=(5, -3, 2)) @ np.diag([0.7, 0.7, 0.7, 1.0]))
    aligned = prepare_for_comparison(scaled, REAL)
    row = score_placement(aligned, PREPARED, shaped(SMOOTH, noise(1)), PREPARED)
    assert row["r_mean_curvature"] > 0.95
    assert row["r_start_mean_curvature"] == pytest.approx(0, abs=0.06)
    assert row["matched_share"] == pytest.approx(1.0)
    rotated = score_placement(shaped(transformed(REAL, rigid(0, 0, 90))), PREPARED, PREPARED, PREPARED)
    assert abs(rotated["r_mean_curvature"]) < 0.25


def test_noise_lowers_the_correlation_by_its_variance():
    pattern = PREPARED.mean_curvature
    added = pattern + pattern.std() * noise(4)
    row = score_placement(PreparedSurface(REAL, added, added), PREPARED, shaped(SMOOTH, noise(2)), PREPARED)
    assert row["r_mean_curvature"] == pytest.approx(1 / np.sqrt(2), abs=0.06)
    assert row["skill_mean_curvature"] == pytest.approx(row["r_mean_curvature"], abs=0.08)
    assert row["gain_low_mean_curvature"] < row["gain_mean_curvature"] < row["gain_high_mean_curvature"]
    assert row["gain_low_mean_curvature"] > 0
    assert row["resampled"] == Facts("patches", "not subjects")


def test_interval_is_as_wide_as_gains_scatter_from_surface_to_surface():
    points, areas = SMOOTH.vertices, np.ones(len(SMOOTH.vertices))
    directions = points / RADIUS
    patch = number_patches(points, np.full(len(points), 4 * np.pi * RADIUS**2 / len(points)), 10.0)
    inside = []
    for seed in range(30):
        shared, own, other = (field(directions, 100 * seed + k) for k in range(3))
        truth, run, start = shared, shared + own, 0.5 * shared + other
        scores = correlation_scores(truth, run, start, start, areas, patch)
        expected = 1 / np.sqrt(2) - 0.5 / np.sqrt(1.25)
        inside.append(scores["gain_low"] < expected < scores["gain_high"])
    assert np.mean(inside) > 0.75
    assert (scores["room"], scores["room_high"], scores["skill_flag"]) == (0, 0, "no room")
    assert correlation_scores(truth, run, start, truth, areas, patch)["gain_low"] == scores["gain_low"]


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
            scores["gain_high"] - scores["gain_low"]
            for patch in (number_patches(brain.vertices, sizes, 10.0, image) for image in (None, place))
            for scores in [correlation_scores(shared, shared + own, 0.5 * shared + other, other, areas, patch)]
        ]
        ratios.append(widths[1] / widths[0])
    assert np.mean(ratios) == pytest.approx(np.sqrt(2), abs=0.15)
