"""Folds in their places: correlations, gains with their intervals, and their share of
what is to be gained."""

import numpy as np
import pytest
from shapes import moved, rigid

from gyriflow.compare.placement import (
    correlation,
    draw_units,
    gain_columns,
    make_resampling,
)
from gyriflow.geometry.triangles import TriangleMesh, merged, transformed

from .bumpy import PREPARED, RADIUS, REAL, SMOOTH, bumpy, shaped


@pytest.fixture(scope="module")
def sampling():
    """The resampling of the bumpy sphere."""
    return make_resampling(PREPARED)


def test_units_are_drawn_within_their_group_once_less_than_there_are():
    samples = draw_units([12, 5, 1])
    assert (samples[0] == 1).all()
    assert set(samples[1:, :12].sum(axis=1)) == {11}
    assert set(samples[1:, 12:17].sum(axis=1)) == {4}
    assert (samples[1:, 17] == 1).all()
    # the variance of a mean of n values, without bias
    values = np.array([3.0, 1.0, 4.0, 1.0, 5.0])
    assert np.var(samples[1:, 12:17] @ values / 4) == pytest.approx(
        np.var(values, ddof=1) / 5, rel=0.1
    )


def waves(points, wavelengths_mm, seed, count=60):
    """Return the (n,) sum of plane waves of these lengths and random directions at
    points in mm."""
    generator = np.random.default_rng(seed)
    directions = generator.normal(size=(3, count))
    directions /= np.linalg.norm(directions, axis=0)
    directions *= 2 * np.pi / generator.uniform(*wavelengths_mm, count)
    phases = points @ directions + generator.uniform(0, 2 * np.pi, count)
    return np.cos(phases).sum(axis=1) * np.sqrt(2 / count)


@pytest.mark.parametrize(
    ("lengths_mm", "share_of_modes"), [((20, 40), 1.0), ((3.5, 4.5), 0.0)]
)
def test_coordinates_keep_products_and_are_of_modes_or_of_what_is_finer(
    sampling, lengths_mm, share_of_modes
):
    values = waves(REAL.vertices, lengths_mm, 1)
    coordinates = sampling.coordinates(values)
    centred = values - np.average(values, weights=PREPARED.areas)
    assert coordinates @ coordinates == pytest.approx(
        centred @ (PREPARED.areas * centred)
    )
    # modes down to 10 mm, patches of 10 mm
    n_modes, n_patches = sampling.basis[1].shape[1], sampling.patch.max() + 1
    assert n_modes == pytest.approx(np.pi * PREPARED.areas.sum() / 10**2, rel=0.15)
    assert n_patches == pytest.approx(PREPARED.areas.sum() / 10**2, abs=1)
    assert set(sampling.drawn[1:, -n_patches:].sum(axis=1)) == {n_patches - 1}
    of_modes = coordinates[sampling.units < n_modes]
    share = of_modes @ of_modes / (coordinates @ coordinates)
    assert share == pytest.approx(share_of_modes, abs=0.08)


def test_a_correlation_with_a_constant_map_is_unknown(sampling):
    values, constant = REAL.vertices[:, 0], np.full(len(REAL.vertices), 0.3)
    assert np.isnan(correlation(values, constant, PREPARED.areas))
    assert np.isnan(sampling.correlations(values, constant)).all()


def test_intervals_of_random_maps_hold(sampling):
    # benchmarks/intervals.py has larger surfaces and more maps
    held, above = [], []
    for seed in range(60):
        truth, *others = (
            waves(REAL.vertices, (6, 20), 3 * seed + number) for number in range(3)
        )
        run, start = (
            sampling.correlations(truth, 0.4 * truth + np.sqrt(1 - 0.4**2) * other)
            for other in others
        )
        row = gain_columns(run, start, start)
        held.append(row["gain_low"] <= 0 <= row["gain_high"])
        above.append(row["gain_low"] > 0)
    assert np.mean(held) >= 0.89
    assert np.mean(above) <= 0.06


def two_sided(mesh: TriangleMesh) -> TriangleMesh:
    """Return a brain of the surface on the right and its mirror image on the left."""
    return merged(
        right := moved(mesh, 1.5 * RADIUS),
        transformed(right, np.diag([-1.0, 1.0, 1.0, 1.0])),
    )


def test_sides_are_drawn_together_where_the_brain_is_its_mirror_image():
    # in any pose
    pose = rigid(0, 0, 8, shift=(5, -3, 2))
    brain = transformed(two_sided(REAL), pose)
    both = make_resampling(shaped(brain, np.zeros(len(brain.vertices))))
    assert both.is_symmetric
    assert both.asymmetry_mm == pytest.approx(0, abs=0.02)
    n_modes = both.basis[1].shape[1]
    assert n_modes == pytest.approx(np.pi * both.areas.sum() / 2 / 10**2, rel=0.15)
    # another brain on the other side
    unlike = merged(moved(REAL, 1.5 * RADIUS), moved(bumpy(5), -1.5 * RADIUS))
    apart = make_resampling(shaped(unlike, np.zeros(len(unlike.vertices))))
    assert not apart.is_symmetric
    assert apart.asymmetry_mm > 0.4
    assert apart.basis[1].shape[1] == pytest.approx(2 * n_modes, rel=0.1)


def test_intervals_of_symmetric_brains_are_root_two_wider_than_with_independent_sides(
    monkeypatch,
):
    brain = two_sided(SMOOTH)
    prepared = shaped(brain, np.zeros(len(brain.vertices)))
    together = make_resampling(prepared)
    monkeypatch.setattr("gyriflow.compare.placement.SYMMETRY_TOL_MM", 0.0)
    alone = make_resampling(prepared)
    assert (together.is_symmetric, alone.is_symmetric) == (True, False)
    ratios = []
    for seed in range(6):
        shared, own = (
            np.tile(waves(SMOOTH.vertices, (6, 20), 2 * seed + number), 2)
            for number in range(2)
        )
        samples = (
            sampling.correlations(shared, shared + own)
            for sampling in (together, alone)
        )
        widths = [np.ptp(np.quantile(r[1:], [0.1, 0.9])) for r in samples]
        ratios.append(widths[0] / widths[1])
    assert np.mean(ratios) == pytest.approx(np.sqrt(2), abs=0.15)
