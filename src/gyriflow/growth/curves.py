"""Smooth curves of area, volume and thickness over gestational weeks, through measured weeks or from a table."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, PchipInterpolator
from scipy.linalg import solve
from scipy.optimize import brentq, lsq_linear

from ..errors import InputError
from ..geometry.triangles import Floats

log = logging.getLogger(__name__)

DEGREES_OF_FREEDOM = 4.0
"""Of a fitted curve: a size, a rate of growth, how that rate changes, and a little more."""

SPACING_WEEKS = 0.1
"""Of the points that a fitted curve is kept at."""

LEAST_SCATTER = 0.005
"""Scatter of measured sizes, as a fraction, that is not taken for a leap."""

TUKEY = 4.685
"""Residual over scatter beyond which a week does not count (Beaton and Tukey 1974)."""

TELLING = 2.0
"""Weeks per degree of freedom from which on the others tell that one leaps."""

ROUNDS = 50
KNOT_INTERVALS = 12
CERTAIN = 1.96


@dataclass(frozen=True, eq=False)
class Curve:
    """A positive quantity over the weeks.

    Between its points, at ascending weeks (k,), the logarithm is a monotone cubic (Fritsch and Butland 1984); beyond
    them the rate of growth of the end goes on. Values (k,) are in any unit; `sd` (k,) is the standard deviation of the
    logarithm, NaN where the data do not tell, 0 for a given table.
    """

    weeks: Floats
    values: Floats
    sd: Floats


@dataclass(frozen=True, eq=False)
class Fit:
    """A curve, the (n,) weeks and measured values that it was fitted to, and their weights: 0 for a week that leaps."""

    curve: Curve
    weeks: Floats
    measured: Floats
    weights: Floats


def value(curve: Curve, week: ArrayLike) -> Floats:
    """Return the quantity at weeks, in the curve's unit."""
    return np.exp(_log_and_rate(curve, week)[0])


def rate(curve: Curve, week: ArrayLike) -> Floats:
    """Return the rate of growth d(ln y)/dt at weeks, in 1/week."""
    return _log_and_rate(curve, week)[1]


def interval(curve: Curve, week: ArrayLike) -> tuple[Floats, Floats]:
    """Return the bounds of the 95 % interval of the curve at weeks; beyond its ends as wide as there."""
    sd = np.interp(np.asarray(week, dtype=float), curve.weeks, curve.sd)
    middle = value(curve, week)
    return middle * np.exp(-CERTAIN * sd), middle * np.exp(CERTAIN * sd)


def tabulated(
    weeks: Sequence[float], values: Sequence[float], *, name: str = "curve", may_shrink: bool = False
) -> Curve:
    """Return the curve of a given table, such as a norm; InputError where it is no table or shrinks unnamed."""
    weeks_, values_ = _checked(weeks, values, name)
    if len(np.unique(weeks_)) < len(weeks_):
        raise InputError(f"a week of the {name} is there twice", found=weeks_.tolist(), expected="one value a week")
    if not may_shrink and (np.diff(values_) < 0).any():
        _refuse_shrinking(name, weeks_[1:][np.diff(values_) < 0])
    return Curve(weeks_, values_, np.zeros(len(weeks_)))


def fitted(
    weeks: Sequence[float],
    values: Sequence[float],
    *,
    name: str = "curve",
    degrees_of_freedom: float = DEGREES_OF_FREEDOM,
    may_shrink: bool = False,
) -> Fit:
    """Return a smooth curve through measured weeks that does not follow a single week that leaps.

    The rate of growth of the logarithm is a quadratic spline with a penalty on its second differences (on its first
    ones below three degrees of freedom, P-splines of Eilers and Marx 1996), not negative unless `may_shrink`. The
    penalty is that which leaves `degrees_of_freedom`, at most one less than there are weeks. Where there are twice as
    many weeks, those far from the curve lose their weight (Tukey's biweight, begun from least absolute deviations).
    The standard deviation is Bayesian (Wahba 1983), with the scatter of the weeks about the curve.

    Gestational weeks are at least two different ones, and sizes positive; several brains may share a week. InputError
    for other values, and where the sizes shrink and that is not allowed.
    """
    weeks_, values_ = _checked(weeks, values, name)
    count = len(np.unique(weeks_))
    degrees = min(degrees_of_freedom, max(count - 1.0, 2.0))
    ends = weeks_[0], weeks_[-1]
    design, logs = _design(weeks_, *ends), np.log(values_)
    penalty = _penalty(*ends, order=2 if degrees >= 3 else 1)
    strength = _strength(design, penalty, degrees)
    weights = _robust_weights(design, logs, penalty, strength, degrees, may_shrink)
    coefficients = _solved(design, logs, weights, strength * penalty, may_shrink)
    if not may_shrink and coefficients[1:].max() < 1e-6:
        _refuse_shrinking(name, weeks_)
    left = weights.sum() - degrees
    squares = (weights * (logs - design @ coefficients) ** 2).sum()
    spread = np.sqrt(squares / left) if left > 0.5 else np.nan
    at = np.linspace(*ends, max(2, round((ends[1] - ends[0]) / SPACING_WEEKS) + 1))
    rows = _design(at, *ends)
    free = np.ones(len(coefficients), dtype=bool)
    free[1:] = may_shrink | (coefficients[1:] > 1e-8)
    normal = (design.T * weights) @ design + strength * penalty
    covariance = np.linalg.pinv(normal[np.ix_(free, free)])
    sd = spread * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", rows[:, free], covariance, rows[:, free]), 0.0))
    leaping = weeks_[weights < 0.5]
    if len(leaping):
        log.warning("%s: weeks %s lie apart from the curve", name, ", ".join(f"{week:g}" for week in leaping))
    return Fit(Curve(at, np.exp(rows @ coefficients), sd), weeks_, values_, weights)


def errors(fits: Mapping[str, Fit]) -> pd.DataFrame:
    """Return how far curves are from the weeks that they were fitted to, a row per quantity and measured value.

    Columns quantity, week, measured, curve, low, high (95 % interval), error (the curve's, as a fraction of what was
    measured), weight.
    """
    tables = []
    for name, fit in fits.items():
        low, high = interval(fit.curve, fit.weeks)
        middle = value(fit.curve, fit.weeks)
        columns = {"week": fit.weeks, "measured": fit.measured, "curve": middle, "low": low, "high": high}
        columns |= {"error": middle / fit.measured - 1, "weight": fit.weights}
        tables.append(pd.DataFrame({"quantity": name} | columns))
    return pd.concat(tables, ignore_index=True)


def curve_table(curves: Mapping[str, Curve]) -> pd.DataFrame:
    """Return curves as a table: quantity, week, value, low, high (95 % interval), rate_per_week."""
    tables = []
    for name, curve in curves.items():
        low, high = interval(curve, curve.weeks)
        columns = {"week": curve.weeks, "value": curve.values, "low": low, "high": high}
        tables.append(pd.DataFrame({"quantity": name} | columns | {"rate_per_week": rate(curve, curve.weeks)}))
    return pd.concat(tables, ignore_index=True)


def _design(weeks: Floats, first: float, last: float) -> Floats:
    integral = BSpline(_knots(first, last), np.eye(KNOT_INTERVALS + 2), 2, extrapolate=False).antiderivative()
    return np.column_stack([np.ones(len(weeks)), integral(weeks) - integral(first)])


def _penalty(first: float, last: float, order: int) -> Floats:
    # the end knots lie together, so differences are those of the splines' middles
    knots = _knots(first, last)
    middles = 0.5 * (knots[1:-2] + knots[2:-1])
    slopes = np.diff(np.eye(len(middles)), axis=0) / np.diff(middles)[:, None]
    if order == 2:
        slopes = np.diff(slopes, axis=0) / (0.5 * (middles[2:] - middles[:-2]))[:, None]
    return np.pad(slopes.T @ slopes, ((1, 0), (1, 0)))


def _knots(first: float, last: float) -> Floats:
    return np.concatenate([[first] * 2, np.linspace(first, last, KNOT_INTERVALS + 1), [last] * 2])


def _strength(design: Floats, penalty: Floats, degrees: float) -> float:
    # a trace of ridge keeps the matrix regular where weeks are fewer than splines
    ridge = 1e-10 * np.eye(len(penalty))

    def excess(exponent: float) -> float:
        normal = design.T @ design
        return float(np.trace(solve(normal + 10**exponent * penalty + ridge, normal, assume_a="pos"))) - degrees

    for end, sign in ((-8.0, 1), (8.0, -1)):
        if sign * excess(end) <= 0:
            return float(10**end)
    return float(10 ** brentq(excess, -8.0, 8.0))


def _solved(design: Floats, logs: Floats, weights: Floats, penalty: Floats, may_shrink: bool) -> Floats:
    # a strong penalty has eigenvalues that should be 0 and by round-off are not
    sizes, directions = np.linalg.eigh(penalty)
    root = (directions * np.sqrt(np.clip(sizes, 1e-10, None))).T
    rows = np.concatenate([np.sqrt(weights)[:, None] * design, root])
    right = np.concatenate([np.sqrt(weights) * logs, np.zeros(len(root))])
    if may_shrink:
        return np.linalg.lstsq(rows, right, rcond=None)[0]
    lowest = np.append(-np.inf, np.zeros(design.shape[1] - 1))
    return np.asarray(lsq_linear(rows, right, bounds=(lowest, np.inf), method="bvls").x)


def _robust_weights(
    design: Floats, logs: Floats, penalty: Floats, strength: float, degrees: float, may_shrink: bool
) -> Floats:
    count = len(logs)
    weights = np.ones(count)
    if count < TELLING * degrees:
        return weights
    for _ in range(ROUNDS):
        residuals = logs - design @ _solved(design, logs, weights, strength * penalty, may_shrink)
        weights = 1.0 / np.maximum(np.abs(residuals), LEAST_SCATTER)
        weights *= count / weights.sum()
    for _ in range(ROUNDS):
        scale = max(1.4826 * float(np.median(np.abs(residuals))) * np.sqrt(count / (count - degrees)), LEAST_SCATTER)
        weights = np.clip(1 - (residuals / (TUKEY * scale)) ** 2, 0, None) ** 2
        residuals = logs - design @ _solved(design, logs, weights, strength * penalty, may_shrink)
    return weights


def _log_and_rate(curve: Curve, week: ArrayLike) -> tuple[Floats, Floats]:
    at = np.asarray(week, dtype=float)
    inside = np.clip(at, curve.weeks[0], curve.weeks[-1])
    logs = PchipInterpolator(curve.weeks, np.log(curve.values))
    rates = logs.derivative()(inside)
    return logs(inside) + rates * (at - inside), rates


def _checked(weeks: Sequence[float], values: Sequence[float], name: str) -> tuple[Floats, Floats]:
    weeks_, values_ = np.asarray(weeks, dtype=float), np.asarray(values, dtype=float)
    good = weeks_.shape == values_.shape and np.isfinite([*weeks_, *values_]).all() and (values_ > 0).all()
    if not good or len(np.unique(weeks_)) < 2:
        raise InputError(
            f"no {name} goes through these weeks",
            found=f"weeks {weeks_.tolist()}, values {values_.tolist()}",
            expected="positive values at two or more weeks",
        )
    order = np.argsort(weeks_, kind="stable")
    return weeks_[order], values_[order]


def _refuse_shrinking(name: str, weeks: Floats) -> None:
    raise InputError(
        f"the {name} shrinks",
        found=f"at weeks {', '.join(f'{week:g}' for week in weeks)}",
        expected="growth",
        remedy="Leave out the brains that do not fit, or correct the table.",
    )
