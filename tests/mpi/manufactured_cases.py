"""The solver's errors against manufactured solutions fall as those of linear and quadratic elements must."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from verification_cases.manufactured import CASES, rates, solved

pytestmark = [pytest.mark.slow, pytest.mark.one_rank]


@pytest.mark.parametrize("case", CASES)
def test_errors_fall_with_the_square_of_the_edge_and_those_of_gradients_with_the_edge(case):
    errors = [solved(case, cells) for cells in (5, 10, 20)]
    displacement, gradient = rates(errors).T
    assert displacement[-1] >= 1.8
    assert displacement[-1] > displacement[0]
    assert 0.9 <= gradient[-1] <= 1.2
    # of a displacement with gradients up to 0.4
    assert errors[-1].displacement < 0.015


@pytest.mark.parametrize("case", CASES)
def test_errors_of_quadratic_elements_fall_with_one_power_more(case):
    errors = [solved(case, cells, order=2) for cells in (3, 5, 10)]
    displacement, gradient = rates(errors).T
    assert displacement[-1] >= 2.7
    assert 1.8 <= gradient[-1] <= 2.4
    assert errors[-1].displacement < 0.003
