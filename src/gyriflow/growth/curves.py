"""Smooth curves of area and volume over gestational weeks: fitted to series
of brains, or given as a table.

Runs follow them, or are compared with them.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import scipy  # submodules load lazily, which keeps steps without them fast
from numpy.typing import ArrayLike

from .. import splines
from ..errors import InputError
from ..geometry.triangles import Floats, Mask
from ..settings.growth import SIZES

log = logging.getLogger(__name__)

DEGREES_OF_FREEDOM = 4.0
"""Degrees of freedom of a fitted curve: a size, a growth rate, its change, and a little
more."""
SPACING_WEEKS = 0.1
"""Spacing of the points at which a fitted curve is stored."""
MIN_SCATTER = 0.005
"""Relative scatter of measured sizes that is never taken for an outlier."""
TUKEY = 4.685
"""Residual over scatter beyond which a week has no weight (Beaton and Tukey 1974)."""
MIN_WEEKS_PER_DEGREE = 2.0
"""Weeks per degree of freedom that are needed to detect outliers."""
ROUNDS = 50
KNOT_INTERVALS = 12
Z_95 = 1.96
SPACING_GW = 0.25
"""Spacing of the weeks at which a run stores a curve."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A positive quantity over the weeks.

    Its logarithm is a monotone cubic (Fritsch and Butland 1984) through the points at
    ascending weeks (k,), and is extrapolated with the growth rate at the ends. Values
    (k,) are in any unit; `sd` (k,) is the standard deviation of the logarithm, NaN if
    it is unknown, 0 for a given table.
    """

    weeks: Floats
    values: Floats
    sd: Floats


@dataclass(frozen=True, eq=False)
class CurveFit:
    """A curve, the (n,) weeks and measured values that it was fitted to, and their
    weights: 0 for an outlier."""

    curve: Curve
    weeks: Floats
    measured: Floats
    weights: Floats


def value(curve: Curve, week: ArrayLike) -> Floats:
    """Return the values of a curve at weeks, in the curve's unit."""
    logs, _ = _log_and_rate(curve, week)
    return np.exp(logs)


def rate(curve: Curve, week: ArrayLike) -> Floats:
    """Return the rate of growth d(ln y)/dt at weeks, in 1/week."""
    _, rates = _log_and_rate(curve, week)
    return rates


def _interval(curve: Curve, week: ArrayLike) -> tuple[Floats, Floats]:
    """Return the bounds of the 95 % interval of a curve at weeks. Its width is constant
    beyond the ends."""
    at = np.asarray(week, dtype=float)
    sd = np.interp(at, curve.weeks, curve.sd)
    middle = value(curve, week)
    below = np.exp(-Z_95 * sd)
    above = np.exp(Z_95 * sd)
    return middle * below, middle * above


def _tabulated(
    weeks: Sequence[float],
    values: Sequence[float],
    *,
    name: str = "curve",
    may_shrink: bool = False,
) -> Curve:
    """Return the curve through a given table, such as a norm; InputError if a value is
    invalid or decreases."""
    weeks_, values_ = _checked(weeks, values, name)
    shrinks = np.diff(values_) < 0
    if not may_shrink and shrinks.any():
        _refuse_shrinking(name, weeks_[1:][shrinks])
    return Curve(weeks_, values_, np.zeros(len(weeks_)))


def fitted(
    weeks: Sequence[float],
    values: Sequence[float],
    *,
    name: str = "curve",
    degrees_of_freedom: float = DEGREES_OF_FREEDOM,
    keeps_first: bool = False,
    sources: Sequence[int] | None = None,
) -> CurveFit:
    """Fit a smooth curve to measured weeks, robust against single outliers.

    The growth rate (derivative of the logarithm) is a quadratic spline, not negative,
    with a penalty on its second differences (on its first ones below three degrees of
    freedom; P-splines, Eilers and Marx 1996). The penalty leaves
    `degrees_of_freedom`, at most one less than the number of weeks. With at least twice
    as many weeks, outliers lose their weight (Tukey's biweight, started from least
    absolute deviations), but with `keeps_first` not those of the first week, the
    reference of all growth. The standard deviation is Bayesian (Wahba 1983), from the
    scatter of the weeks about the curve.

    With `sources` (n,), from 0, the values are of several populations, each with a
    level of its own and all with one growth (a mixed model with fixed levels). The
    curve has the level of source 0.

    At least two different weeks and positive sizes are needed; several brains may share
    a week. InputError for other values, and if the sizes decrease.
    """
    weeks_, values_ = _checked(weeks, values, name)
    source = np.zeros(len(weeks_), int)
    if sources is not None:
        source = np.asarray(sources)[np.argsort(weeks, kind="stable")]
    n_levels = int(source.max())
    count = len(np.unique(weeks_))
    degrees = min(degrees_of_freedom, max(count - 1.0, 2.0))
    ends = weeks_[0], weeks_[-1]
    logs = np.log(values_)
    design = splines.design(weeks_, *ends, KNOT_INTERVALS)
    penalty = splines.penalty(
        *ends,
        KNOT_INTERVALS,
        order=2 if degrees >= 3 else 1,
    )
    strength = splines.strength(design.T @ design, penalty, degrees, name)
    # columns of the levels of the other sources, which are not penalised
    levels = source[:, None] == np.arange(1, n_levels + 1)
    design = np.column_stack([design, levels])
    penalty = np.pad(penalty, (0, n_levels))
    degrees += n_levels
    weights = _robust_weights(
        design, logs, penalty, strength, degrees, source == 0, n_levels
    )
    if keeps_first:
        weights[weeks_ == weeks_[0]] = 1.0
    coefficients = _solve(design, logs, weights, strength * penalty, n_levels)
    rates = slice(1, len(coefficients) - n_levels)
    if coefficients[rates].max() < 1e-6:
        _refuse_shrinking(name, weeks_)
    residual_degrees = weights.sum() - degrees
    squares = (weights * (logs - design @ coefficients) ** 2).sum()
    spread = np.sqrt(squares / residual_degrees) if residual_degrees > 0.5 else np.nan
    count = round((weeks_[-1] - weeks_[0]) / SPACING_WEEKS) + 1
    at = np.linspace(*ends, max(2, count))
    rows = splines.design(at, *ends, KNOT_INTERVALS)
    rows = np.pad(rows, ((0, 0), (0, n_levels)))
    # rates at their bound of 0 are not free
    free = np.ones(len(coefficients), dtype=bool)
    free[rates] = coefficients[rates] > 1e-8
    normal = (design.T * weights) @ design + strength * penalty
    covariance = np.linalg.pinv(normal[np.ix_(free, free)])
    free_rows = rows[:, free]
    variance = np.einsum("ij,jk,ik->i", free_rows, covariance, free_rows)
    sd = spread * np.sqrt(np.maximum(variance, 0.0))
    outliers = weeks_[(weights < 0.5) & (source == 0)]
    if len(outliers):
        log.warning("%s: weeks %s are outliers of the curve", name, _listed(outliers))
    curve = Curve(at, np.exp(rows @ coefficients), sd)
    return CurveFit(curve, weeks_, values_, weights)


def _listed(weeks: Floats) -> str:
    return ", ".join(f"{week:g}" for week in weeks)


def errors(fits: Mapping[str, CurveFit]) -> pd.DataFrame:
    """Return the errors of curves at the weeks that they were fitted to, a row per
    quantity and measured value.

    Columns are quantity, week, measured, curve, low, high (95 % interval), error (curve
    over measured value, minus 1) and weight.
    """
    tables = []
    for name, fit in fits.items():
        low, high = _interval(fit.curve, fit.weeks)
        middle = value(fit.curve, fit.weeks)
        columns = {
            "week": fit.weeks,
            "measured": fit.measured,
            "curve": middle,
            "low": low,
            "high": high,
            "error": middle / fit.measured - 1,
            "weight": fit.weights,
        }
        tables.append(pd.DataFrame({"quantity": name, **columns}))
    return pd.concat(tables, ignore_index=True)


def curve_table(curves: Mapping[str, Curve]) -> pd.DataFrame:
    """Return curves as a table: quantity, week, value, low, high (95 % interval),
    rate_per_week."""
    tables = []
    for name, curve in curves.items():
        low, high = _interval(curve, curve.weeks)
        columns = {
            "week": curve.weeks,
            "value": curve.values,
            "low": low,
            "high": high,
            "rate_per_week": rate(curve, curve.weeks),
        }
        tables.append(pd.DataFrame({"quantity": name, **columns}))
    return pd.concat(tables, ignore_index=True)


def _solve(
    design: Floats,
    logs: Floats,
    weights: Floats,
    penalty: Floats,
    n_levels: int,
) -> Floats:
    """Return the coefficients of a first value, rates that are not negative, and
    levels."""
    # eigenvalues of a strong penalty that should be 0 are not, because of round-off
    sizes, directions = np.linalg.eigh(penalty)
    sizes = np.clip(sizes, 1e-10, None)
    root = (directions * np.sqrt(sizes)).T
    factors = np.sqrt(weights)
    weighted = factors[:, None] * design
    rows = np.concatenate([weighted, root])
    no_rates = np.zeros(len(root))
    right = np.concatenate([factors * logs, no_rates])
    lowest = np.zeros(design.shape[1])
    lowest[0] = -np.inf
    lowest[len(lowest) - n_levels :] = -np.inf
    found = scipy.optimize.lsq_linear(
        rows,
        right,
        bounds=(lowest, np.inf),
        method="bvls",
    )
    return np.asarray(found.x)


def _robust_weights(
    design: Floats,
    logs: Floats,
    penalty: Floats,
    strength: float,
    degrees: float,
    is_first: Mask,
    n_levels: int,
) -> Floats:
    count = len(logs)
    weights = np.ones(count)
    if count < MIN_WEEKS_PER_DEGREE * degrees:
        return weights
    for _ in range(ROUNDS):
        coefficients = _solve(design, logs, weights, strength * penalty, n_levels)
        residuals = logs - design @ coefficients
        weights = 1.0 / np.maximum(np.abs(residuals), MIN_SCATTER)
        weights *= count / weights.sum()
    for _ in range(ROUNDS):
        # of the first source: a smooth norm has none, and would make outliers of it
        scatter = 1.4826 * float(np.median(np.abs(residuals[is_first])))
        scatter *= np.sqrt(count / (count - degrees))
        scale = TUKEY * max(scatter, MIN_SCATTER)
        weights = np.maximum(1 - (residuals / scale) ** 2, 0) ** 2
        coefficients = _solve(design, logs, weights, strength * penalty, n_levels)
        residuals = logs - design @ coefficients
    return weights


def _log_and_rate(curve: Curve, week: ArrayLike) -> tuple[Floats, Floats]:
    """Return the logarithm of a curve at weeks, straight beyond the ends, and its rate
    there."""
    at = np.asarray(week, dtype=float)
    first = curve.weeks[0]
    last = curve.weeks[-1]
    inside = np.clip(at, first, last)
    log_curve = scipy.interpolate.PchipInterpolator(curve.weeks, np.log(curve.values))
    rates = log_curve.derivative()(inside)
    logs = log_curve(inside) + rates * (at - inside)
    return logs, rates


def _checked(
    weeks: Sequence[float],
    values: Sequence[float],
    name: str,
) -> tuple[Floats, Floats]:
    weeks_ = np.asarray(weeks, dtype=float)
    values_ = np.asarray(values, dtype=float)
    is_valid = (
        weeks_.shape == values_.shape
        and np.isfinite([*weeks_, *values_]).all()
        and (values_ > 0).all()
    )
    if not is_valid or len(np.unique(weeks_)) < 2:
        raise InputError(
            f"the {name} cannot be fitted to these weeks",
            found=f"weeks {weeks_.tolist()}, values {values_.tolist()}",
            expected="positive values at two or more weeks",
        )
    order = np.argsort(weeks_, kind="stable")
    return weeks_[order], values_[order]


def _refuse_shrinking(name: str, weeks: Floats) -> None:
    raise InputError(
        f"the {name} shrinks",
        found=f"at weeks {_listed(weeks)}",
        expected="growth",
        remedy="Leave out the brains that do not fit, or correct the table.",
    )


def fits_of_series(areas: pd.DataFrame) -> dict[str, dict[str, CurveFit]]:
    """Fit curves to the measured sizes of each series of brains; return them by series
    and quantity.

    `areas` has the columns series, week, area_cm2 and volume_ml; each series has two
    weeks or more.
    """
    fits: dict[str, dict[str, CurveFit]] = {}
    for name, brains in areas.groupby("series", sort=False):
        weeks = brains["week"].tolist()
        of_series: dict[str, CurveFit] = {}
        for quantity in SIZES:
            sizes = brains[quantity].tolist()
            of_series[quantity] = fitted(weeks, sizes, name=quantity)
        fits[str(name)] = of_series
    return fits


def followed_sizes(
    growth: Mapping[str, Any],
    curves: pd.DataFrame | None,
    series: str | None,
    weeks: Sequence[float],
    shrink: bool,
) -> dict[str, dict[float, float]]:
    """Return the sizes that a run follows, {quantity: {week: value}}, every quarter of
    a week.

    For each of `SIZES` that the run follows, `growth` has `measured`
    or a table of values by week, which may decrease if `shrink`. `curves`, with the
    columns series, quantity, week and value, are needed for `measured`; InputError if
    the start brain's `series` is not in them. `weeks` are the output weeks of the run.
    """
    at = np.arange(
        weeks[0],
        weeks[-1] + 1e-9 + SPACING_GW,
        SPACING_GW,
    )
    tables = {}
    for quantity in SIZES:
        source = growth.get(quantity)
        if source is None:
            continue
        if source == "measured":
            curve = _measured_curve(curves, series, quantity)
        else:
            curve = _tabulated(
                [float(week) for week in source],
                list(source.values()),
                name=quantity,
                may_shrink=shrink,
            )
        by_week = zip(
            at.tolist(),
            value(curve, at).tolist(),
            strict=True,
        )
        tables[quantity] = {round(week, 6): size for week, size in by_week}
    return tables


def sizes_on_curves(
    growth: Mapping[str, Any],
    curves: pd.DataFrame | None,
    series: str | None,
    weeks: Sequence[float],
) -> dict[float, dict[str, float]]:
    """Return by week the `SIZES` that a run should have had, or those of the observed
    brains; empty if unknown.

    `growth` is the section of the run's parameters, with tables of the sizes if it
    followed any. `curves` has the columns series, quantity, week and value; InputError
    where it is given without the start brain's `series`.
    """
    found = {}
    for name in SIZES:
        if SIZES[0] in growth:
            sizes = growth[name]
            found[name] = _tabulated(
                list(sizes),
                list(sizes.values()),
                may_shrink=True,
            )
        elif curves is not None:
            found[name] = _measured_curve(curves, series, name)
    by_week = {}
    for week in weeks:
        sizes = {name: float(value(curve, week)) for name, curve in found.items()}
        by_week[week] = sizes
    return by_week


def _measured_curve(
    curves: pd.DataFrame | None,
    series: str | None,
    quantity: str,
) -> Curve:
    if curves is None:
        curves = pd.DataFrame(columns=["series", "quantity", "week", "value"])
    of_series = curves[curves["series"] == series]
    rows = of_series[of_series["quantity"] == quantity]
    if not len(rows):
        if len(of_series):
            reason = f"its brains have no {quantity} in two weeks or more"
        else:
            reason = "the start brain is in no series of brains of two weeks or more"
        raise InputError(
            f"no measured curve of {quantity} to follow",
            found=reason,
            remedy=(
                "List brains of other weeks, or give growth a table such as"
                " {area_cm2: {21: 99, 30: 252}}"
            ),
        )
    weeks = rows["week"].to_numpy(dtype=float)
    values = rows["value"].to_numpy(dtype=float)
    return Curve(weeks, values, np.zeros(len(rows)))
