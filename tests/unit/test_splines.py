"""Penalised splines: what their penalties leave free, their degrees of freedom, and their ends."""

import numpy as np
import pytest
from facts import Facts

from gyriflow import splines

WEEKS = np.array([21.0, 21.4, 22.0, 23.5, 24.0, 26.5, 27.0, 29.0, 29.5, 31.0])
ENDS = 21.0, 31.0, 5


def coefficients(values: np.ndarray) -> np.ndarray:
    """Return the coefficients of the curve with the values (200,) over all weeks."""
    rows = splines.design(np.linspace(21, 31, 200), *ENDS)
    return np.linalg.lstsq(rows, values, rcond=None)[0]


@pytest.mark.parametrize(("order", "power"), [(1, 1), (2, 2)])
def test_a_penalty_leaves_lines_or_quadratics(order: int, power: int) -> None:
    x, penalty = np.linspace(21, 31, 200), splines.penalty(*ENDS, order)
    free, bent = coefficients(3.0 - 2 * (x - 22) ** power), coefficients((x - 22) ** (power + 1))
    assert free @ penalty @ free == pytest.approx(0.0, abs=1e-8)
    assert bent @ penalty @ bent > 0.01


def test_beyond_its_ends_a_curve_is_a_line() -> None:
    curve = coefficients((np.linspace(21, 31, 200) - 22) ** 3)
    before, after = (
        splines.design(np.array(weeks), *ENDS) @ curve for weeks in ([20.0, 20.5, 21.0], [31.0, 31.5, 32.0])
    )
    # slopes 3·1² and 3·9²
    assert np.diff(before) == pytest.approx([1.5, 1.5], rel=1e-3)
    assert np.diff(after) == pytest.approx([121.5, 121.5], rel=1e-3)


@pytest.mark.parametrize("freedom", [2.5, 4.0, 6.0])
def test_the_strength_gives_the_degrees_of_freedom(freedom: float) -> None:
    rows, penalty = splines.design(WEEKS, *ENDS), splines.penalty(*ENDS, 1)
    normal = rows.T @ rows
    found = normal + splines.strength(normal, penalty, freedom) * penalty
    assert np.trace(np.linalg.solve(found, normal)) == pytest.approx(freedom, abs=0.01)


def test_freedom_that_no_penalty_gives_is_warned_of(caplog) -> None:
    rows, penalty = splines.design(WEEKS[:4], *ENDS), splines.penalty(*ENDS, 1)
    normal = rows.T @ rows
    # four weeks have four degrees of freedom, a line has two
    assert splines.strength(normal, penalty, 6.0, "volume") == pytest.approx(1e-8)
    assert splines.strength(normal, penalty, 1.0, "area") == pytest.approx(1e8)
    for message, facts in zip(caplog.messages, (Facts("volume", 4, 6), Facts("area", 2, 1)), strict=True):
        assert facts(message)
    caplog.clear()
    assert splines.strength(normal, penalty, 2.0) == pytest.approx(1e8)
    assert not caplog.messages
