"""Norms of a metric over gestational weeks: location, scale and skewness as smooth curves.

The LMS method of Cole and Green (1992, doi 10.1002/sim.4780111005), as in the growth standards of the WHO.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats
from scipy.interpolate import BSpline
from scipy.linalg import solve
from scipy.optimize import brentq, minimize

from ..geometry.triangles import Floats

MIN_SUBJECTS_FOR_CURVES = 30
"""With fewer subjects the relative scatter is the same at all weeks, and centiles are cut at `FEW_CENTILES`."""
FEW_CENTILES = (5.0, 95.0)
INTERVAL_Z = 1.645
"""Half the width of a 90 % interval in standard errors."""
LOCATION_FREEDOM, SCALE_FREEDOM = (5.0, 7.5), 3.0
"""Degrees of freedom of the curve of location, for few and for many subjects, and of the curve of scale. With 5 for 200
subjects whose volumes scatter by 8 %, the median is wrong by up to 5 centiles."""
SUBJECTS_PER_FREEDOM = 20
"""Subjects for each degree of freedom of the location, between these bounds."""
MIN_WEEKS_FOR_SPLINES = 8
INTERVALS = 6
"""Intervals between the knots of the splines."""
SKEWNESS_SD = 3.0
"""Standard deviation of the prior of the skewness around 1, the normal distribution."""


@dataclass(frozen=True, eq=False)
class WeeklyNorm:
    """The distribution of a metric by week, from `first` to `last`.

    A value y has z = ((y/M)^L − 1)/(L S) with location M, scale S and skewness L if the metric is positive, and
    z = (y − M)/S if it may have either sign. ln M (or M) and ln S are linear in `location` and `scale`, which are
    coefficients of cubic splines, or of powers of the week if there are few weeks or subjects. The covariance is that
    of location, scale and skewness, the last only if it was estimated. `freedom` are the degrees of freedom of the
    scale if it is that of few subjects, else None.
    """

    first: float
    last: float
    is_positive: bool
    location: Floats
    scale: Floats
    skewness: float
    covariance: Floats
    subjects: int
    is_spline: bool
    freedom: float | None

    def _bases(self, weeks: ArrayLike) -> tuple[Floats, Floats]:
        at, sizes = np.atleast_1d(np.asarray(weeks, dtype=float)), (len(self.location), len(self.scale))
        location, scale = (_basis(at, self.first, self.last, size, self.is_spline) for size in sizes)
        return location, scale

    def _student(self, locations: Floats, by_location: Floats) -> Floats:
        """Return √(1 + leverage) at weeks, by which the scatter of a new subject exceeds the scale."""
        size = len(self.location)
        leverage = np.einsum("ij,jk,ik->i", locations, self.covariance[:size, :size], locations) * by_location**2
        return np.asarray(np.sqrt(1 + leverage))

    def scores(self, weeks: ArrayLike, values: ArrayLike) -> tuple[Floats, Floats]:
        """Return z and its standard error for values at weeks; of few subjects, z is that of Student's distribution."""
        locations, scales = self._bases(weeks)
        at = np.atleast_1d(np.asarray(values, dtype=float))
        terms = _terms(locations @ self.location, scales @ self.scale, self.skewness, at, self.is_positive)
        slopes = np.hstack([terms.by_location[:, None] * locations, terms.by_scale[:, None] * scales])
        if len(self.covariance) > slopes.shape[1]:
            slopes = np.hstack([slopes, terms.by_skewness[:, None]])
        error = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, self.covariance, slopes), 0.0))
        if self.freedom is None:
            return terms.z, error
        student = terms.z / self._student(locations, terms.by_location)
        return stats.norm.ppf(stats.t.cdf(student, self.freedom)), error

    def values(self, weeks: ArrayLike, z: float) -> Floats:
        """Return the values with a z at weeks (n,): the inverse of `scores`."""
        locations, scales = self._bases(weeks)
        scale = np.exp(scales @ self.scale)
        own: Floats | float = z
        if self.freedom is not None:
            own = stats.t.ppf(stats.norm.cdf(z), self.freedom) * self._student(locations, 1 / scale)
        if not self.is_positive:
            return locations @ self.location + scale * own
        power = np.maximum(1.0 + self.skewness * scale * own, 1e-9)
        logs = scale * own if abs(self.skewness) < 1e-6 else np.log(power) / self.skewness
        return np.exp(locations @ self.location + logs)

    def without(self, weeks: Floats, values: Floats, weights: Floats) -> "WeeklyNorm":
        """Return the norm without one of its subjects, by one Newton step from the whole."""
        locations, scales = self._bases(weeks)
        terms = _terms(locations @ self.location, scales @ self.scale, self.skewness, values, self.is_positive)
        slope = [locations.T @ (weights * terms.slope_location), scales.T @ (weights * terms.slope_scale)]
        slope += [np.array([weights @ terms.slope_skewness])] * (len(self.covariance) > sum(map(len, slope)))
        step, size = self.covariance @ np.concatenate(slope), len(self.location)
        location, scale = self.location - step[:size], self.scale - step[size : size + len(self.scale)]
        skewness = self.skewness - float(step[size + len(self.scale) :].sum())
        return replace(self, location=location, scale=scale, skewness=skewness, subjects=self.subjects - 1)

    @property
    def plain(self) -> dict[str, Any]:
        """The fields as plain values for JSON."""
        return {key: np.asarray(part).tolist() for key, part in asdict(self).items() if part is not None}


def norm_from_plain(plain: Mapping[str, Any]) -> WeeklyNorm:
    """Return the norm that `WeeklyNorm.plain` gives as plain values."""
    arrays = {key: np.array(plain[key], dtype=float) for key in ("location", "scale", "covariance")}
    return WeeklyNorm(**{"freedom": None, **plain, **arrays})


def fit_norm(
    weeks: Floats, values: Floats, weights: Floats, subjects: int, *, is_positive: bool, with_curves: bool | None = None
) -> WeeklyNorm:
    """Fit a norm to values (n,) at weeks (n,), by penalised maximum likelihood.

    The weights of a subject's scans add up to 1. Curves are splines, or of fewer than eight weeks a quadratic of the
    location and a line of the scale. Of few subjects (by `with_curves`, or else by their number), a quadratic is fitted
    to the values or their logarithms, with one scatter. Fewer than four weeks have a line, one week a constant.
    """
    first, last, count = float(weeks.min()), float(weeks.max()), len(np.unique(weeks))
    start = np.log(values) if is_positive else values
    size = 3 if count > 3 else 2 if count > 1 else 1
    with_curves = subjects >= MIN_SUBJECTS_FOR_CURVES if with_curves is None else with_curves
    if not with_curves:
        rows = _basis(weeks, first, last, size, False)
        normal = (rows.T * weights) @ rows
        location = solve(normal, rows.T @ (weights * start))
        freedom = max(subjects - size, 1)
        scatter = max(float(np.sqrt(weights @ (start - rows @ location) ** 2 / freedom)), 1e-12)
        covariance = np.zeros((size + 1, size + 1))
        covariance[:size, :size] = scatter**2 * np.linalg.inv(normal)
        covariance[size, size] = 0.5 / freedom
        scale = np.array([np.log(scatter)])
        return WeeklyNorm(first, last, is_positive, location, scale, 0.0, covariance, subjects, False, float(freedom))
    is_spline = count >= MIN_WEEKS_FOR_SPLINES
    sizes = (INTERVALS + 3,) * 2 if is_spline else (size, min(size, 2))
    rows, scale_rows = (_basis(weeks, first, last, each, is_spline) for each in sizes)
    normal = (rows.T * weights) @ rows
    size, total = sizes[0], sum(sizes)
    penalties = np.zeros((total, total))
    location_freedom = float(np.clip(subjects / SUBJECTS_PER_FREEDOM, *LOCATION_FREEDOM)) if is_spline else float(size)
    strength = 0.0
    if is_spline:
        differences = np.diff(np.eye(size), 2, axis=0)
        penalty = differences.T @ differences
        strength = _strength(normal, penalty, location_freedom)
        # the information of an observation on ln S is 2
        penalties[size:, size:] = 2.0 * _strength(normal, penalty, SCALE_FREEDOM) * penalty
        penalties[:size, :size] = strength * penalty
    location = solve(normal + penalties[:size, :size], rows.T @ (weights * start))
    variance = float(weights @ (start - rows @ location) ** 2) / (subjects - location_freedom)
    # the information of an observation on the location is 1/S²
    penalties[:size, :size] /= variance
    scale = np.zeros(sizes[1])
    scale[: 1 if not is_spline else None] = 0.5 * np.log(variance)
    first_guess = np.concatenate([location, scale, [1.0] * is_positive])

    def loss(parameters: Floats) -> tuple[float, Floats]:
        curves, skewness = parameters[:total], parameters[-1] if is_positive else 0.0
        terms = _terms(rows @ curves[:size], scale_rows @ curves[size:], skewness, values, is_positive)
        slope = -np.concatenate(
            [rows.T @ (weights * terms.slope_location), scale_rows.T @ (weights * terms.slope_scale)]
        )
        value = -float(weights @ terms.likelihood) + 0.5 * float(curves @ penalties @ curves)
        slope += penalties @ curves
        if is_positive:
            value += 0.5 * ((skewness - 1.0) / SKEWNESS_SD) ** 2
            slope = np.append(slope, -weights @ terms.slope_skewness + (skewness - 1.0) / SKEWNESS_SD**2)
        return value, slope

    fit = minimize(loss, first_guess, jac=True, method="BFGS", options={"gtol": 1e-4 * np.sqrt(subjects)}).x
    steps = 1e-4 * np.eye(len(fit))
    hessian = np.array([(loss(fit + step)[1] - loss(fit - step)[1]) / 2e-4 for step in steps])
    covariance = np.linalg.pinv(0.5 * (hessian + hessian.T), hermitian=True)
    skewness = float(fit[-1]) if is_positive else 0.0
    location, scale = fit[:size], fit[size:total]
    return WeeklyNorm(first, last, is_positive, location, scale, skewness, covariance, subjects, is_spline, None)


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
    is_small = abs(skewness) < 1e-4
    scaled_z = logs + 0.5 * skewness * logs**2 if is_small else (power - 1) / skewness
    by_skewness = 0.5 * logs**2 if is_small else (logs * power - scaled_z) / skewness
    z = scaled_z / scale
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
    """Return the (n, size) values of the splines, or of the powers of the week, at weeks (n,)."""
    inside = np.clip(weeks, first, last)
    if not is_spline:
        return np.vander((weeks - 0.5 * (first + last)) / max(0.5 * (last - first), 1e-9), size, increasing=True)
    knots = np.concatenate([[first] * 3, np.linspace(first, last, size - 2), [last] * 3])
    return np.asarray(BSpline.design_matrix(inside, knots, 3).toarray())


def _strength(normal: Floats, penalty: Floats, freedom: float) -> float:
    """Return the factor of the penalty with which a penalised fit has the degrees of freedom."""
    ridge = 1e-10 * np.trace(normal) * np.eye(len(normal))

    def excess(exponent: float) -> float:
        return float(np.trace(solve(normal + 10**exponent * penalty + ridge, normal, assume_a="pos"))) - freedom

    return float(10 ** brentq(excess, -8.0, 8.0)) if excess(-8.0) > 0 > excess(8.0) else 1.0
