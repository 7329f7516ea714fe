"""Folds whose banks press on each other: nothing crosses, and depth and pressure converge in mesh and time step."""

import numpy as np
import pytest
from verification_cases.deep_folds import Slab, at_ratio, folded

pytestmark = pytest.mark.one_rank

AREA_RATIO = 1.6


def test_a_deep_fold_presses_on_itself_where_it_crosses_without_contact():
    assert max(fold.crossing for fold in folded(Slab(2, 1, 0.04, contact="none"), AREA_RATIO)) > 0
    folds = folded(Slab(2, 1, 0.04), AREA_RATIO)
    assert not any(fold.crossing for fold in folds)
    assert min(fold.least_volume_ratio for fold in folds) > 0.5
    growth, depth_mm, pressure_pa = at_ratio(folds, AREA_RATIO)
    # the finest mesh of linear elements has 0.47, 4.74 mm and 1430 Pa
    assert growth == pytest.approx(0.47, rel=0.1)
    assert depth_mm == pytest.approx(4.74, rel=0.05)
    assert pressure_pa == pytest.approx(1430, rel=0.4)
