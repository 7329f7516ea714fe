"""Penalised splines: what their penalties leave free, their degrees of freedom, and
their ends."""

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
    free = coefficients(3.0 - 2 * (x - 22) ** power)
    bent = coefficients((x - 22) ** (power + 1))
    assert free @ penalty @ free == pytest.approx(0.0, abs=1e-8)
    assert bent @ penalty @ bent > 0.01


def test_beyond_its_ends_a_curve_is_a_line() -> None:
    curve = coefficients((np.linspace(21, 31, 200) - 22) ** 3)
    before, after = (
        splines.design(np.array(weeks), *ENDS) @ curve
        for weeks in ([20.0, 20.5, 21.0], [31.0, 31.5, 32.0])
    )
    # slopes 3·1² and 3·9²
    assert np.diff(before) == pytest.approx([1.5, 1.5], rel=1e-3)
    assert np.diff(after) == pytest.approx([121.5, 121.5], rel=1e-3)


def matrices(weeks: np.ndarray, order: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal matrix and the penalty of a fit to weeks (n,), with knots from
    the first to the last."""
    ends = weeks[0], weeks[-1], 5
    rows = splines.design(weeks, *ends)
    return rows.T @ rows, splines.penalty(*ends, order)


def range_of_strengths(normal: np.ndarray, penalty: np.ndarray) -> list[float]:
    unit = np.trace(normal) / np.trace(penalty)
    return [unit * 10**end for end in splines.STRENGTHS]


@pytest.mark.parametrize("freedom", [2.5, 4.0, 6.0])
def test_the_strength_gives_the_degrees_of_freedom(freedom: float) -> None:
    normal, penalty = matrices(WEEKS)
    found = normal + splines.strength(normal, penalty, freedom) * penalty
    assert np.trace(np.linalg.solve(found, normal)) == pytest.approx(freedom, abs=0.001)


def test_freedom_that_no_penalty_gives_is_warned_of(caplog) -> None:
    normal, penalty = matrices(WEEKS[:4])
    weakest, strongest = range_of_strengths(normal, penalty)
    # four weeks have four degrees of freedom, a line has two
    assert splines.strength(normal, penalty, 6.0, "volume") == pytest.approx(weakest)
    assert splines.strength(normal, penalty, 1.0, "area") == pytest.approx(strongest)
    for message, facts in zip(
        caplog.messages, (Facts("volume", 4, 6), Facts("area", 2, 1)), strict=True
    ):
        assert facts(message)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("missing", [-0.009, 0.009])
def test_near_an_end_of_the_range_the_strength_is_that_end(
    order: int, missing: float, caplog
) -> None:
    normal, penalty = matrices(WEEKS[:5], order)
    weakest, strongest = range_of_strengths(normal, penalty)
    assert splines.strength(normal, penalty, 5.0 + missing) == pytest.approx(weakest)
    least = splines.strength(normal, penalty, order + 1 + missing)
    assert least == pytest.approx(strongest)
    assert not caplog.messages


def test_weeks_that_coincide_or_nearly_so_have_a_strength() -> None:
    # two weeks have two degrees of freedom with any penalty: the strongest
    normal, penalty = matrices(np.array([21.0, 21.0, 24.0]))
    _, strongest = range_of_strengths(normal, penalty)
    assert splines.strength(normal, penalty, 2.0) == pytest.approx(strongest)
    weeks = np.array([21.0, 21.0 + 1e-9, 21.0 + 2e-9, 24.0])
    assert splines.strength(*matrices(weeks, order=2), 3.0) > 0


@pytest.mark.parametrize("span", [0.2, 10.0])
@pytest.mark.parametrize("freedom", [3.02, 4.5, 6.0])
def test_rounding_does_not_decide_the_strength(span: float, freedom: float) -> None:
    normal, penalty = matrices(21 + span * (WEEKS - 21) / 10, order=2)
    expected = splines.strength(normal, penalty, freedom)
    random = np.random.default_rng(3)
    for _ in range(20):
        noise = 1e-15 * random.uniform(-1, 1, normal.shape)
        noisy_normal = normal * (1 + noise + noise.T)
        assert splines.strength(noisy_normal, penalty, freedom) == pytest.approx(
            expected, rel=1e-4
        )


@pytest.mark.parametrize("freedom", [2.5, 4.0])
def test_the_unit_of_time_does_not_matter(freedom: float) -> None:
    in_weeks = splines.strength(*matrices(WEEKS), freedom)
    in_days = splines.strength(*matrices(7 * WEEKS), freedom)
    # the penalty is on the square of a change of rate, 1/week², the data on a value
    assert in_days / in_weeks == pytest.approx(7.0**4, rel=1e-6)
