"""Norms of a metric over gestational weeks: location, scale and skewness as smooth curves.

The LMS method of Cole and Green (1992, doi 10.1002/sim.4780111005), as the growth standards of the WHO have it.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats
from scipy.interpolate import BSpline
from scipy.linalg import solve
from scipy.optimize import brentq, minimize

from ..geometry.triangles import Floats

MIN_SUBJECTS = 10
"""With fewer subjects there are no centiles."""
MIN_SUBJECTS_OF_CURVES = 30
"""With fewer subjects the relative scatter is the same at all weeks, and centiles end at `FEW_CENTILES`."""
FEW_CENTILES = (5.0, 95.0)
INTERVAL_Z = 1.645
"""Half the width of a 90 % interval in standard errors."""
LOCATION_FREEDOM, SCALE_FREEDOM = (5.0, 7.5), 3.0
"""Degrees of freedom of the curve of location, for few and for many subjects, and of that of scale. With 5 for 200
subjects of 8 % scatter, the curve of a volume is off by up to 5 centiles in the middle."""
SUBJECTS_PER_FREEDOM = 20
"""Subjects for each degree of freedom of the location, between these bounds."""
INTERVALS = 6
"""Intervals between the knots of the splines."""
SKEWNESS_SD = 3.0
"""Standard deviation of the prior of the skewness around 1, the normal distribution."""


@dataclass(frozen=True, eq=False)
class WeeklyNorm:
    """The distribution of a metric by week, from `first` to `last`.

    A value y has z = ((y/M)^L − 1)/(L S) with location M, scale S and skewness L if the metric is positive, and
    z = (y − M)/S if it may have either sign. ln M (or M) and ln S are linear in the `location` and `scale` (k,), which
    are coefficients of cubic splines, or of powers of the week if there are few weeks or subjects. The covariance is
    that of location, scale and skewness, the last only if it was estimated. `freedom` are the degrees of freedom of
    the scale if it is that of few subjects, else None.
    """

    first: float
    last: float
    is_positive: bool
    location: Floats
    scale: Floats
    skewness: float
    covariance: Floats
    subjects: int
    freedom: float | None

    @property
    def is_spline(self) -> bool:
        return len(self.scale) > 1

    def scores(self, weeks: ArrayLike, values: ArrayLike) -> tuple[Floats, Floats]:
        """Return z and its standard error for values at weeks; of few subjects, z is that of Student's distribution."""
        weeks, values = np.atleast_1d(weeks).astype(float), np.atleast_1d(values).astype(float)
        rows = _basis(weeks, self.first, self.last, len(self.location), self.is_spline)
        scales = rows if self.is_spline else np.ones((len(weeks), 1))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            terms = _terms(rows @ self.location, scales @ self.scale, self.skewness, values, self.is_positive)
        slopes = np.hstack([terms.by_location[:, None] * rows, terms.by_scale[:, None] * scales])
        if len(self.covariance) > slopes.shape[1]:
            slopes = np.hstack([slopes, terms.by_skewness[:, None]])
        error = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, self.covariance, slopes), 0.0))
        if self.freedom is None:
            return terms.z, error
        size = len(self.location)
        leverage = np.einsum("ij,jk,ik->i", rows, self.covariance[:size, :size], rows) * terms.by_location**2
        return stats.norm.ppf(stats.t.cdf(terms.z / np.sqrt(1 + leverage), self.freedom)), error

    def values(self, weeks: ArrayLike, z: float) -> Floats:
        """Return the values with a z at weeks (n,)."""
        rows = _basis(np.asarray(weeks, dtype=float), self.first, self.last, len(self.location), self.is_spline)
        scale = np.exp(rows @ self.scale if self.is_spline else self.scale[0])
        if not self.is_positive:
            return rows @ self.location + scale * z
        power = np.maximum(1.0 + self.skewness * scale * z, 1e-9)
        logs = scale * z if abs(self.skewness) < 1e-6 else np.log(power) / self.skewness
        return np.exp(rows @ self.location + logs)

    def without(self, weeks: Floats, values: Floats, weights: Floats) -> "WeeklyNorm":
        """Return the norm without one of its subjects, by one Newton step from the whole."""
        rows = _basis(weeks, self.first, self.last, len(self.location), self.is_spline)
        terms = _terms(rows @ self.location, rows @ self.scale, self.skewness, values, self.is_positive)
        slope = np.concatenate([rows.T @ (weights * terms.slope_location), rows.T @ (weights * terms.slope_scale)])
        if len(self.covariance) > len(slope):
            slope = np.append(slope, weights @ terms.slope_skewness)
        step, size = self.covariance @ slope, len(self.location)
        skewness = self.skewness - (step[2 * size] if len(step) > 2 * size else 0.0)
        moved = {"location": self.location - step[:size], "scale": self.scale - step[size : 2 * size]}
        return WeeklyNorm(**{**self.__dict__, **moved, "skewness": skewness, "subjects": self.subjects - 1})

    @property
    def plain(self) -> dict[str, Any]:
        """Its fields as plain values for JSON."""
        return {key: np.asarray(part).tolist() for key, part in asdict(self).items() if part is not None}


def norm_from(plain: Mapping[str, Any]) -> WeeklyNorm:
    """Return the norm of plain values as of `WeeklyNorm.plain`."""
    arrays = {key: np.array(plain[key], dtype=float) for key in ("location", "scale", "covariance")}
    return WeeklyNorm(**{"freedom": None, **plain, **arrays})


def fit_norm(weeks: Floats, values: Floats, weights: Floats, subjects: int, *, is_positive: bool) -> WeeklyNorm:
    """Fit a norm to values (n,) at weeks (n,), by penalised maximum likelihood.

    The weights of a subject's scans add up to 1. Of fewer subjects than `MIN_SUBJECTS_OF_CURVES`, or at fewer than
    eight weeks, a quadratic (a line, a constant, for fewer than four and two weeks) is fitted to the values or their
    logarithms, with one scatter.
    """
    first, last, count = float(weeks.min()), float(weeks.max()), len(np.unique(weeks))
    start = np.log(values) if is_positive else values
    if subjects < MIN_SUBJECTS_OF_CURVES or count < 8:
        size = 3 if count > 3 else 2 if count > 1 else 1
        rows = _basis(weeks, first, last, size, False)
        normal = (rows.T * weights) @ rows
        location = solve(normal, rows.T @ (weights * start))
        freedom = max(subjects - size, 1)
        scatter = max(float(np.sqrt(weights @ (start - rows @ location) ** 2 / freedom)), 1e-12)
        covariance = np.zeros((size + 1, size + 1))
        covariance[:size, :size] = scatter**2 * np.linalg.inv(normal)
        covariance[size, size] = 0.5 / freedom
        scale = np.array([np.log(scatter)])
        return WeeklyNorm(first, last, is_positive, location, scale, 0.0, covariance, subjects, float(freedom))
    rows = _basis(weeks, first, last, INTERVALS + 3, True)
    size = rows.shape[1]
    differences = np.diff(np.eye(size), 2, axis=0)
    penalty = differences.T @ differences
    normal = (rows.T * weights) @ rows
    location_freedom = float(np.clip(subjects / SUBJECTS_PER_FREEDOM, *LOCATION_FREEDOM))
    strengths = [_strength(normal, penalty, each) for each in (location_freedom, SCALE_FREEDOM)]
    location = solve(normal + strengths[0] * penalty, rows.T @ (weights * start))
    variance = float(weights @ (start - rows @ location) ** 2) / (subjects - location_freedom)
    penalties = np.zeros((2 * size, 2 * size))
    # the information of an observation is 1/S² on the location and 2 on ln S
    penalties[:size, :size] = strengths[0] / variance * penalty
    penalties[size:, size:] = 2.0 * strengths[1] * penalty
    first_guess = np.concatenate([location, np.full(size, 0.5 * np.log(variance)), [1.0] * is_positive])

    def loss(parameters: Floats) -> tuple[float, Floats]:
        curves, skewness = parameters[: 2 * size], parameters[-1] if is_positive else 0.0
        terms = _terms(rows @ curves[:size], rows @ curves[size:], skewness, values, is_positive)
        slope = -np.concatenate([rows.T @ (weights * terms.slope_location), rows.T @ (weights * terms.slope_scale)])
        total = -float(weights @ terms.likelihood) + 0.5 * float(curves @ penalties @ curves)
        slope += penalties @ curves
        if is_positive:
            total += 0.5 * ((skewness - 1.0) / SKEWNESS_SD) ** 2
            slope = np.append(slope, -weights @ terms.slope_skewness + (skewness - 1.0) / SKEWNESS_SD**2)
        return total, slope

    fit = minimize(loss, first_guess, jac=True, method="BFGS", options={"gtol": 1e-4 * np.sqrt(subjects)}).x
    steps = 1e-4 * np.eye(len(fit))
    hessian = np.array([(loss(fit + step)[1] - loss(fit - step)[1]) / 2e-4 for step in steps])
    covariance = np.linalg.pinv(0.5 * (hessian + hessian.T), hermitian=True)
    skewness = float(fit[-1]) if is_positive else 0.0
    return WeeklyNorm(first, last, is_positive, fit[:size], fit[size : 2 * size], skewness, covariance, subjects, None)


@dataclass(frozen=True, eq=False)
class _Terms:
    """z and log-likelihood of values, with their slopes by location, ln scale and skewness."""

    z: Floats
    likelihood: Floats
    by_location: Floats
    by_scale: Floats
    by_skewness: Floats
    slope_location: Floats
    slope_scale: Floats
    slope_skewness: Floats


def _terms(location: Floats, log_scale: Floats, skewness: float, values: Floats, is_positive: bool) -> _Terms:
    scale = np.exp(log_scale)
    if not is_positive:
        z, zero = (values - location) / scale, np.zeros(len(values))
        return _Terms(z, -log_scale - 0.5 * z**2, -1 / scale, -z, zero, z / scale, z**2 - 1, zero)
    logs = np.log(values) - location
    power = np.exp(skewness * logs)
    # the limits for small skewness
    near = abs(skewness) < 1e-4
    moved = logs + 0.5 * skewness * logs**2 if near else (power - 1) / skewness
    by_skewness = 0.5 * logs**2 if near else (logs * power - moved) / skewness
    z = moved / scale
    slope = z * power / scale - skewness
    return _Terms(
        z=z,
        likelihood=skewness * logs - log_scale - 0.5 * z**2,
        by_location=-power / scale,
        by_scale=-z,
        by_skewness=by_skewness / scale,
        slope_location=slope,
        slope_scale=z**2 - 1,
        slope_skewness=logs - z * by_skewness / scale,
    )


def _basis(weeks: Floats, first: float, last: float, size: int, is_spline: bool) -> Floats:
    inside = np.clip(weeks, first, last)
    if not is_spline:
        return np.vander((weeks - 0.5 * (first + last)) / max(0.5 * (last - first), 1e-9), size, increasing=True)
    knots = np.concatenate([[first] * 3, np.linspace(first, last, size - 2), [last] * 3])
    return np.asarray(BSpline.design_matrix(inside, knots, 3).toarray())


def _strength(normal: Floats, penalty: Floats, freedom: float) -> float:
    ridge = 1e-10 * np.trace(normal) * np.eye(len(normal))

    def excess(exponent: float) -> float:
        return float(np.trace(solve(normal + 10**exponent * penalty + ridge, normal, assume_a="pos"))) - freedom

    return float(10 ** brentq(excess, -8.0, 8.0)) if excess(-8.0) > 0 > excess(8.0) else 1.0
