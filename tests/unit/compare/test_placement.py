import numpy as np
import pytest
from shapes import rigid

from gyriflow.compare.placement import correlation, drawn_patches, gain_interval, patches, placement, skill
from gyriflow.compare.shapes import Shape, against_real, cortex_dice, ready
from gyriflow.compare.validation import ordered, validation_row
from gyriflow.errors import InputError
from gyriflow.geometry.triangles import TriangleMesh, area, flipped, mean_edge_length, signed_volume, transformed

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
    laid = ready(scaled, REAL)
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
    row = placement(TRUTH, Shape(REAL, added, added), shaped(SMOOTH, noise(2)), TRUTH, horizon=3)
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
        ready(flipped(REAL), REAL)


def test_size_and_distance_of_curvature():
    half = np.where(SMOOTH.vertices[:, 2] > 0, 0.1, -0.1)
    against = against_real(Shape(SMOOTH, 2 * half, half), Shape(SMOOTH, half, half))
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
