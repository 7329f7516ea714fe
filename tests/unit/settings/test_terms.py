"""Errors of elements that are known, and between them; names of runs in figures."""

import math

import pytest
from facts import Facts

from gyriflow.settings.terms import element_error, rounded_elements, run_names


@pytest.mark.parametrize(
    ("order", "elements", "percent", "facts"),
    [
        (1, 1.0, 32.2, ["more than", "quadratic elements on as many nodes"]),
        (1, 2.0, 32.2, ["up to", "quadratic elements on as many nodes"]),
        # half as many quadratic elements have as many nodes
        (1, 4.0, 13.3, ["up to 13 %", "on as many nodes: up to 1 %"]),
        # half-way between 4 and 8 by the logarithm
        (1, math.sqrt(32.0), math.sqrt(13.3 * 4.5), ["up to"]),
        (1, 20.0, 4.5, ["up to"]),
        (2, 0.5, 4.3, ["more than"]),
        (2, 2.0, 0.9, ["up to"]),
    ],
)
def test_errors_of_elements_are_interpolated_by_their_logarithms(
    order, elements, percent, facts
):
    error, text = element_error(order, elements)
    assert error == pytest.approx(percent)
    assert text == Facts(f"{elements:.2g}", f"{percent:.0f} %", *facts)
    assert ("quadratic elements on" in text) == (order == 1 and percent > 10)


def test_elements_have_two_digits_and_runs_of_several_brains_the_brain():
    assert [rounded_elements(n) for n in (1.96, 0.796, 12.4)] == [2.0, 0.8, 12.0]
    pairs = [("fast", "a"), ("slow", "a"), ("slow", "b")]
    assert run_names(pairs) == ["fast", "slow · a", "slow · b"]
