"""Folds whose banks press on each other: nothing crosses, and depth and pressure converge in mesh and time step."""

import numpy as np
import pytest
from verification_cases.deep_folds import Slab, at_ratio, folded

pytestmark = pytest.mark.one_rank

AREA_RATIO = 1.6
TOLERANCES = [0.04, 0.02, 0.15]
"""Largest changes of growth, depth and pressure from one mesh or time step to the finest, of linear elements."""


def test_a_deep_fold_presses_on_itself_where_it_crosses_without_contact():
    assert max(fold.crossing for fold in folded(Slab(2, 1, 0.04, contact="none"), AREA_RATIO)) > 0
    growth, depth_mm, pressure_pa = found_at(Slab(2, 1, 0.04))
    # finer meshes of linear elements have 0.48, 4.78 mm and 1900 Pa
    assert growth == pytest.approx(0.48, rel=0.1)
    assert depth_mm == pytest.approx(4.78, rel=0.05)
    assert pressure_pa == pytest.approx(1900, rel=0.15)


def found_at(slab):
    """Return growth, depth and pressure at the area ratio; no step has crossing faces or inverted elements."""
    folds = folded(slab, AREA_RATIO)
    assert not any(fold.crossing for fold in folds)
    assert min(fold.least_volume_ratio for fold in folds) > 0.5
    return at_ratio(folds, AREA_RATIO)


@pytest.mark.slow
def test_growth_depth_and_pressure_of_a_deep_fold_converge_in_mesh_and_time_step():
    by_step = [[found_at(Slab(cells, 1, growth)) for cells in (2, 3, 4)] for growth in (0.04, 0.02)]
    for coarse, middle, fine in by_step:
        assert (np.abs(middle / fine - 1) < TOLERANCES).all()
        assert abs(middle[0] - fine[0]) < abs(coarse[0] - fine[0])
    assert (np.abs(by_step[0][-1] / by_step[1][-1] - 1) < TOLERANCES).all()


@pytest.mark.extended
def test_a_deep_fold_of_quadratic_elements_changes_little_with_the_mesh():
    # it does with the time step: steps of half the length make it 15 % deeper (docs/verification.md)
    coarse, fine = (found_at(Slab(cells, 2, 0.04)) for cells in (1, 1.5))
    assert (np.abs(coarse / fine - 1) < [0.06, 0.04, 0.15]).all()
