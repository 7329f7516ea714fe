"""Folds whose banks press on each other: nothing crosses, and depth and pressure converge in mesh and time step."""

import numpy as np
import pytest
from verification_cases.deep_folds import Slab, at_ratio, folded

pytestmark = pytest.mark.one_rank

AREA_RATIO = 1.6
TOLERANCES = {1: [0.04, 0.02, 0.15], 2: [0.08, 0.04, 0.3]}
"""Largest changes of growth, depth and pressure from one mesh or time step to the finest, by element order."""


def test_a_deep_fold_presses_on_itself_where_it_crosses_without_contact():
    assert max(fold.crossing for fold in folded(Slab(2, 1, 0.04, contact="none"), AREA_RATIO)) > 0
    folds = folded(Slab(2, 1, 0.04), AREA_RATIO)
    assert not any(fold.crossing for fold in folds)
    assert min(fold.least_volume_ratio for fold in folds) > 0.5
    growth, depth_mm, pressure_pa = at_ratio(folds, AREA_RATIO)
    # finer meshes of linear elements have 0.48, 4.78 mm and 1900 Pa
    assert growth == pytest.approx(0.48, rel=0.1)
    assert depth_mm == pytest.approx(4.78, rel=0.05)
    assert pressure_pa == pytest.approx(1900, rel=0.15)


@pytest.mark.extended
@pytest.mark.parametrize(("order", "cells"), [(1, (2, 3, 4)), (2, (1, 1.5, 2))], ids=["linear", "quadratic"])
def test_growth_depth_and_pressure_of_a_deep_fold_converge(order, cells):
    found = []
    for growth in (0.04, 0.02):
        for number in cells:
            folds = folded(Slab(number, order, growth), AREA_RATIO)
            assert not any(fold.crossing for fold in folds)
            assert min(fold.least_volume_ratio for fold in folds) > 0.5
            found.append(at_ratio(folds, AREA_RATIO))
    by_step = np.reshape(found, (2, 3, 3))
    for coarse, middle, fine in by_step:
        assert (np.abs(middle / fine - 1) < TOLERANCES[order]).all()
        # growth converges monotonically, depth and pressure from either side
        assert abs(middle[0] - fine[0]) < abs(coarse[0] - fine[0])
    assert (np.abs(by_step[0] / by_step[1] - 1) < TOLERANCES[order]).all()
