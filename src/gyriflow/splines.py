"""Curves over the weeks as penalised splines (P-splines, Eilers and Marx 1996, doi
10.1214/ss/1038425655).

A curve has coefficients (k,): its value at the first week, and those of its rate of
change, a quadratic spline. Beyond its ends the rate is held.
"""

import logging

import numpy as np
import scipy  # submodules load lazily, which keeps steps without them fast
from numpy.typing import NDArray

log = logging.getLogger(__name__)
type Floats = NDArray[np.float64]

STRENGTHS = (-8.0, 8.0)
"""The range of the logarithm of a penalty's strength, relative to the traces of the
normal matrix and the penalty."""
FREEDOM_TOL = 0.01
"""Degrees of freedom this near to those of an end of the range are that end's; farther
beyond it they are warned of.

Near its ends the range is flat, so that a search there would end where rounding, and
thus the processor, lets it.
"""
RIDGE = 1e-13
"""Added to matrices with diagonals of 1 to keep them regular."""


def design(
    weeks: Floats,
    first: float,
    last: float,
    intervals: int,
) -> Floats:
    """Return the matrix (n, k) that gives a curve's values at weeks (n,) from its
    coefficients."""
    knots = _knots(first, last, intervals)
    rates = scipy.interpolate.BSpline(
        knots,
        np.eye(intervals + 2),
        2,
        extrapolate=False,
    )
    integral = rates.antiderivative()
    inside = np.clip(weeks, first, last)
    beyond = (weeks - inside)[:, None] * rates(inside)
    changes = integral(inside) - integral(first)
    changes += beyond
    first_value = np.ones(len(weeks))
    return np.column_stack([first_value, changes])


def penalty(
    first: float,
    last: float,
    intervals: int,
    order: int,
) -> Floats:
    """Return the penalty (k, k) on differences of the rate, of first order (0 for
    lines) or second (for quadratics).

    The end knots coincide, so differences are divided by the distances between the
    middles of the splines.
    """
    knots = _knots(first, last, intervals)
    middles = 0.5 * (knots[1:-2] + knots[2:-1])
    distances = np.diff(middles)
    slopes = np.diff(
        np.eye(len(middles)),
        axis=0,
    )
    slopes /= distances[:, None]
    if order == 2:
        distances = 0.5 * (middles[2:] - middles[:-2])
        slopes = np.diff(slopes, axis=0)
        slopes /= distances[:, None]
    rate_penalty = slopes.T @ slopes
    # the value at the first week has no penalty
    return np.pad(
        rate_penalty,
        ((1, 0), (1, 0)),
    )


def strength(
    normal: Floats,
    penalty: Floats,
    freedom: float,
    name: str = "curve",
) -> float:
    """Return the factor of a penalty with which a fit has the degrees of freedom, by
    its normal matrix (k, k).

    Where no factor gives them within `FREEDOM_TOL`, it is the end of the range that
    comes nearest, with a warning; where both ends give them, the strongest.
    """
    unit = np.trace(normal) / np.trace(penalty)
    data_shares = _data_shares(normal, unit * penalty)

    weakest, strongest = STRENGTHS
    highest = _freedom(data_shares, weakest)
    lowest = _freedom(data_shares, strongest)
    if freedom > highest + FREEDOM_TOL or freedom < lowest - FREEDOM_TOL:
        log.warning(
            "%s: has %.3g degrees of freedom instead of %.3g: there are too few weeks,"
            " or it needs more knots",
            name,
            np.clip(freedom, lowest, highest),
            freedom,
        )
    # first the strongest: two weeks have two degrees of freedom with any penalty, and
    # the smoothest curve is a line
    if freedom <= lowest + FREEDOM_TOL:
        exponent = strongest
    elif freedom >= highest - FREEDOM_TOL:
        exponent = weakest
    else:
        exponent = scipy.optimize.brentq(
            lambda x: _freedom(data_shares, x) - freedom, weakest, strongest
        )
    return float(unit * 10**exponent)


def _freedom(data_shares: Floats, exponent: float) -> float:
    """Return the degrees of freedom with a strength of the penalty."""
    penalty_shares = 10**exponent * (1 - data_shares)
    return float((data_shares / (data_shares + penalty_shares)).sum())


def _data_shares(normal: Floats, penalty: Floats) -> Floats:
    """Return what data (k, k) decide, from 0 to 1, of each of the k directions that
    neither term mixes with others.

    With another factor of the penalty the directions stay the same (Demmler and Reinsch
    1975, doi 10.1007/BF01437407), so that no matrix with very large and very small
    terms is solved.
    """
    both = normal + penalty
    # diagonals of 1, so that the numbers depend neither on the unit of time nor on the
    # distances of the weeks
    factors = 1 / np.sqrt(np.diag(both))
    scales = np.outer(factors, factors)
    # directions that neither decides, of weeks that nearly coincide, count as decided
    # by data
    ridge = RIDGE * np.eye(len(both))
    shares = scipy.linalg.eigh(
        scales * normal + ridge,
        scales * both + ridge,
        eigvals_only=True,
    )
    return np.clip(shares, 0.0, 1.0)


def _knots(
    first: float,
    last: float,
    intervals: int,
) -> Floats:
    inner = np.linspace(first, last, intervals + 1)
    return np.concatenate(
        [
            [first, first],
            inner,
            [last, last],
        ]
    )
