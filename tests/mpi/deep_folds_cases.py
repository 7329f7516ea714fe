"""Folds whose banks press on each other: nothing crosses; growth and depth converge in
mesh, order and time step."""

from dataclasses import replace

import pytest
from verification_cases.deep_folds import Slab, at_ratio, folded

pytestmark = pytest.mark.one_rank

AREA_RATIO = 1.6
GROWTH, DEPTH_MM, PRESSURE_PA = 0.436, 4.69, 1850
"""Of the finest meshes (docs/verification.md)."""


def found_at(slab):
    """Return growth, depth and pressure at the area ratio; no step has crossing faces
    or inverted elements."""
    folds = folded(slab, AREA_RATIO)
    assert not any(fold.crossing for fold in folds)
    assert min(fold.least_volume_ratio for fold in folds) > 0.5
    return at_ratio(folds, AREA_RATIO)


def test_a_deep_fold_presses_on_itself_where_it_crosses_without_contact():
    slab = Slab(2, 1, 0.04)
    without = folded(replace(slab, contact="none"), AREA_RATIO)
    assert any(fold.crossing for fold in without)
    growth, depth_mm, pressure_pa = found_at(slab)
    # two linear elements through the cortex are too stiff: they need more growth
    assert growth == pytest.approx(GROWTH, rel=0.15)
    assert depth_mm == pytest.approx(DEPTH_MM, rel=0.035)
    assert pressure_pa == pytest.approx(PRESSURE_PA, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize(
    "slab", [Slab(4, 1, 0.02), Slab(1, 2, 0.04), Slab(1, 2, 0.02), Slab(1.25, 2, 0.02)]
)
def test_a_deep_fold_is_the_same_with_both_orders_of_elements_and_any_step(slab):
    growth, depth_mm, pressure_pa = found_at(slab)
    assert growth == pytest.approx(GROWTH, rel=0.08 if slab.order == 1 else 0.03)
    assert depth_mm == pytest.approx(DEPTH_MM, rel=0.02)
    assert pressure_pa == pytest.approx(PRESSURE_PA, rel=0.15)
