"""Curves over the weeks as penalised splines (P-splines, Eilers and Marx 1996, doi 10.1214/ss/1038425655).

A curve has coefficients (k,): its value at the first week, and those of its rate of change, a quadratic spline. Beyond
its ends the rate is held.
"""

import logging

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.optimize import brentq

log = logging.getLogger(__name__)
type Floats = NDArray[np.float64]

STRENGTHS = (-8.0, 8.0)
"""The range of the logarithm of the penalty's strength."""
FREEDOM_TOL = 0.05
"""Degrees of freedom may miss the wanted ones by this without a warning."""


def design(weeks: Floats, first: float, last: float, intervals: int) -> Floats:
    """Return the matrix (n, k) that gives a curve's values at weeks (n,) from its coefficients."""
    rates = BSpline(_knots(first, last, intervals), np.eye(intervals + 2), 2, extrapolate=False)
    integral, inside = rates.antiderivative(), np.clip(weeks, first, last)
    beyond = (weeks - inside)[:, None] * rates(inside)
    return np.column_stack([np.ones(len(weeks)), integral(inside) - integral(first) + beyond])


def penalty(first: float, last: float, intervals: int, order: int) -> Floats:
    """Return the penalty (k, k) on differences of the rate, of first order (0 for lines) or second (for quadratics).

    The end knots coincide, so differences are divided by the distances between the middles of the splines.
    """
    knots = _knots(first, last, intervals)
    middles = 0.5 * (knots[1:-2] + knots[2:-1])
    slopes = np.diff(np.eye(len(middles)), axis=0) / np.diff(middles)[:, None]
    if order == 2:
        slopes = np.diff(slopes, axis=0) / (0.5 * (middles[2:] - middles[:-2]))[:, None]
    return np.pad(slopes.T @ slopes, ((1, 0), (1, 0)))


def strength(normal: Floats, penalty: Floats, freedom: float, name: str = "curve") -> float:
    """Return the factor of a penalty with which a fit has the degrees of freedom, by its normal matrix (k, k).

    Where no factor gives them, it is the end of the range that comes nearest, with a warning.
    """
    # the ridge keeps the matrix regular if there are fewer weeks than splines
    ridge = 1e-10 * np.trace(normal) * np.eye(len(normal))

    def excess(exponent: float) -> float:
        return float(np.trace(np.linalg.solve(normal + 10**exponent * penalty + ridge, normal))) - freedom

    for end, sign in zip(STRENGTHS, (1, -1), strict=True):
        if sign * (found := excess(end)) <= 0:
            if abs(found) > FREEDOM_TOL:
                log.warning(
                    "%s: has %.3g degrees of freedom instead of %.3g: there are too few weeks, or it needs more knots",
                    *(name, found + freedom, freedom),
                )
            return float(10**end)
    return float(10 ** brentq(excess, *STRENGTHS))


def _knots(first: float, last: float, intervals: int) -> Floats:
    return np.concatenate([[first] * 2, np.linspace(first, last, intervals + 1), [last] * 2])
