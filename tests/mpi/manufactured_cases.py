"""The solver's errors against manufactured solutions fall as those of linear and quadratic elements must."""

import pytest
from verification_cases.manufactured import CASES, rates, solved

pytestmark = [pytest.mark.slow, pytest.mark.one_rank]


@pytest.mark.parametrize(
    ("order", "cells", "fall", "gradient_falls", "left"),
    # left of a displacement with gradients up to 0.4
    [(1, (5, 10, 20), 1.8, (0.9, 1.2), 0.015), (2, (3, 5, 10), 2.7, (1.8, 2.4), 0.003)],
    ids=["linear", "quadratic"],
)
@pytest.mark.parametrize("case", CASES)
def test_errors_fall_with_one_power_more_than_those_of_gradients(case, order, cells, fall, gradient_falls, left):
    errors = [solved(case, number, order=order) for number in cells]
    displacement, gradient = rates(errors).T
    assert displacement[-1] >= fall
    assert order == 2 or displacement[-1] > displacement[0]
    assert gradient_falls[0] <= gradient[-1] <= gradient_falls[1]
    assert errors[-1].displacement < left
