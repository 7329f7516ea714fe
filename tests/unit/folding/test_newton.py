"""How far the linear solves of Newton's method go."""

import pytest

from gyriflow.folding.newton import LOOSE, linear_tolerance


@pytest.mark.parametrize(
    ("enough", "left", "part"),
    [
        (1e-3, 0.9, LOOSE),  # forces change abruptly: the next iterate is as bad, however well this one is solved
        (0.3, 0.9, 0.3),
        (1e-6, 0.1, 0.01),  # the square of what the last one left
        (4e-3, 0.1, 4e-3),  # a little farther ends the step
        (0.3, 0.1, 0.3),
        (1e-9, 1e-4, 1e-5),  # no farther than the linear tolerance
    ],
)
def test_a_solve_goes_as_far_as_it_helps(enough, left, part):
    assert linear_tolerance(enough, left, 1e-5) == pytest.approx(part)
