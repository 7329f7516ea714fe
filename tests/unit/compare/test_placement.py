"""Folds in their places and what a foretold brain is worth: correlations, gains, distances, sizes, roughness, skill."""

import numpy as np
import pandas as pd
import pytest
from shapes import rigid, sphere

from gyriflow.compare.placement import correlation, drawn_patches, gain_interval, patches, placement, skill
from gyriflow.compare.prediction import deviation_maps, endpoints, roughness_mm, with_skill
from gyriflow.compare.shapes import PreparedSurface, cortex_dice, curvature_differences, prepare_for_comparison
from gyriflow.compare.validation import ordered, validation_row
from gyriflow.errors import InputError
from gyriflow.geometry.triangles import TriangleMesh, area, flipped, mean_edge_length, signed_volume, transformed
from gyriflow.report.labels import SIMPLER_WAYS

from .bumpy import RADIUS, bumpy, field, shaped

REAL = bumpy(1)
TRUTH = shaped(REAL)
SMOOTH = bumpy(1, height=0.0)


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


def test_a_brain_that_is_laid_back_has_its_folds_in_place():
    scaled = transformed(REAL, rigid(0, 0, 12, shift=(5, -3, 2)) @ np.diag([0.7, 0.7, 0.7, 1.0]))
    laid = prepare_for_comparison(scaled, REAL).mesh
    assert signed_volume(laid) == pytest.approx(signed_volume(REAL), rel=0.01)
    assert mean_edge_length(laid) == pytest.approx(1.0, abs=0.1)
    row = placement(TRUTH, shaped(laid), shaped(SMOOTH, noise(1)), TRUTH, horizon=3)
    assert row["r_mean_curvature"] > 0.95
    assert row["r_start_mean_curvature"] == pytest.approx(0, abs=0.06)
    assert row["matched_share"] == pytest.approx(1.0)
    rotated = placement(TRUTH, shaped(transformed(REAL, rigid(0, 0, 90))), TRUTH, TRUTH, horizon=3)
    assert abs(rotated["r_mean_curvature"]) < 0.25


def test_noise_has_the_correlation_that_it_leaves():
    pattern = TRUTH.mean_curvature
    added = pattern + pattern.std() * noise(4)
    row = placement(TRUTH, PreparedSurface(REAL, added, added), shaped(SMOOTH, noise(2)), TRUTH, horizon=3)
    assert row["r_mean_curvature"] == pytest.approx(1 / np.sqrt(2), abs=0.06)
    assert row["skill_mean_curvature"] == pytest.approx(row["r_mean_curvature"], abs=0.08)
    assert row["gain_low_mean_curvature"] < row["gain_mean_curvature"] < row["gain_high_mean_curvature"]
    assert row["gain_low_mean_curvature"] > 0


def test_interval_is_as_wide_as_gains_scatter_from_surface_to_surface():
    points, areas = SMOOTH.vertices, np.ones(len(SMOOTH.vertices))
    directions = points / RADIUS
    patch = patches(points, np.full(len(points), 4 * np.pi * RADIUS**2 / len(points)), 10.0)
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
    """Return the surface beside its mirror image."""
    away = mesh.vertices + [1.5 * RADIUS, 0, 0]
    return TriangleMesh(
        np.concatenate([away, away * [-1, 1, 1]]),
        np.concatenate([mesh.faces, flipped(mesh).faces + len(away)]),
    )


def test_mirror_patches_are_drawn_together_where_the_brain_is_its_mirror_image():
    brain = two_sided(bumpy(1))
    half = len(REAL.vertices)
    # wherever the brain lies
    laid = transformed(brain, rigid(0, 0, 8, shift=(5, -3, 2)))
    patch, drawn = drawn_patches(shaped(laid, np.zeros(2 * half)))
    assert drawn["mirrored_patches"] is True
    assert drawn["asymmetry_mm"] == pytest.approx(0, abs=0.02)
    assert np.mean(patch[:half] == patch[half:]) > 0.98
    assert patch.max() + 1 == round(shaped(laid, np.zeros(2 * half)).areas.sum() / 20**2 / 2)
    # another brain on the other side: only on demand
    other = bumpy(5).vertices - [1.5 * RADIUS, 0, 0]
    both = np.concatenate([REAL.faces, REAL.faces + half])
    shape = shaped(TriangleMesh(np.concatenate([brain.vertices[:half], other]), both), np.zeros(2 * half))
    patch, drawn = drawn_patches(shape)
    assert drawn["mirrored_patches"] is False
    assert drawn["asymmetry_mm"] > 0.4
    assert not set(patch[:half]) & set(patch[half:])
    patch, drawn = drawn_patches(shape, mirrored=True)
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
            for patch in (patches(brain.vertices, sizes, 10.0), patches(brain.vertices, sizes, 10.0, place))
        ]
        ratios.append(widths[1] / widths[0])
    assert np.mean(ratios) == pytest.approx(np.sqrt(2), abs=0.15)


def test_open_or_turned_surfaces_are_refused():
    with pytest.raises(InputError, match="encloses no volume"):
        prepare_for_comparison(flipped(REAL), REAL)


def test_size_and_distance_of_curvature():
    half = np.where(SMOOTH.vertices[:, 2] > 0, 0.1, -0.1)
    against = curvature_differences(PreparedSurface(SMOOTH, 2 * half, half), PreparedSurface(SMOOTH, half, half))
    assert against["curvature_rms_ratio"] == pytest.approx(2.0)
    assert against["curvature_distance_per_mm"] == pytest.approx(0.1, rel=0.02)


def test_cortices_overlap_as_far_as_their_surfaces_are_the_same():
    # the outer 2 mm of balls of 20 and 21 mm share those from 19 to 20 mm
    shared, *whole = ((far**3 - near**3) for near, far in ((19, 20), (18, 20), (19, 21)))
    larger = TriangleMesh(SMOOTH.vertices * 21 / 20, SMOOTH.faces)
    assert cortex_dice(SMOOTH, larger) == pytest.approx(2 * shared / sum(whole), abs=0.04)
    assert cortex_dice(SMOOTH, SMOOTH) == 1.0


def row(week: float, *, grown: float = 1.0, run: str = "measured") -> dict:
    """A row of the real brain `grown`, which was to have the real brain's own area and volume."""
    return validation_row(
        {"run": run, "kind": "predicted", "start_week": 21.0, "week": week, "start": "a", "real": f"b{week:g}"},
        simulated=transformed(REAL, np.diag([grown] * 3 + [1.0])),
        real_brain=REAL,
        aims={"area_cm2": area(REAL) / 100, "volume_ml": signed_volume(REAL) / 1000},
        run=TRUTH,
        real=TRUTH,
        start=shaped(bumpy(2)),
        adjacent=shaped(bumpy(1, height=0.8)),
    )


def test_a_row_of_validation_holds_sizes_errors_placement_and_folds():
    without_curve = {"curve_area_cm2": np.nan, "area_error": np.nan, "volume_error": np.nan}
    table = ordered([row(23.0, grown=1.02), row(22.0), row(22.0, run="reference") | without_curve])
    found = table.iloc[1]
    assert (found["start"], found["real"]) == ("a", "b23")
    assert found["horizon"] == 2
    # a ball of 20 mm with shallow bumps: 50 cm², 34 mL
    assert found["curve_area_cm2"] == pytest.approx(4 * np.pi * RADIUS**2 / 100, rel=0.1)
    assert found["curve_volume_ml"] == pytest.approx(4 / 3 * np.pi * RADIUS**3 / 1000, rel=0.1)
    assert found["area_cm2"] == pytest.approx(1.02**2 * found["curve_area_cm2"])
    assert found["area_error"] == pytest.approx(1.02**2 - 1)
    assert found["volume_difference"] == pytest.approx(1.02**3 - 1)
    assert found["relative_area"] == pytest.approx(found["real_relative_area"])
    assert found["r_shape_index"] == pytest.approx(1.0)
    assert found["skill_shape_index"] > 1.0
    # as they are, not scaled: a fiftieth of the radius apart everywhere
    assert found["distance_mm"] == pytest.approx(0.02 * np.linalg.norm(REAL.vertices, axis=1).mean(), rel=0.05)
    assert found["distance95_mm"] > found["distance_mm"]
    assert 0.7 < found["cortex_dice"] < table["cortex_dice"].iloc[0] == 1.0
    assert found["curvature_rms_ratio"] == pytest.approx(1.0)
    assert table[["run", "week"]].to_numpy().tolist() == [["measured", 22.0], ["measured", 23.0], ["reference", 22.0]]


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


def test_areas_are_compared_after_a_gaussian_of_3_mm():
    degree, height = 8, 0.005
    wave = np.polynomial.Legendre.basis(degree)(BALL.vertices[:, 2] / 20)
    found = deviation_maps(BALL, scaled(1 + height * wave[:, None]))["log_area"]
    # heat over the time σ²/2 in eight implicit steps, along the sphere's own wave
    decay = (1 + degree * (degree + 1) / 20**2 * 3**2 / 2 / 8) ** -8
    assert found @ wave / (wave @ wave) == pytest.approx(2 * height * decay, rel=0.1)
