"""Norms of a metric over gestational weeks: location, scale and skewness as smooth
curves.

The LMS method of Cole and Green (1992, doi 10.1002/sim.4780111005), as in the growth
standards of the WHO, with the scale by restricted likelihood. Scores of new subjects
allow for the errors of the curves.
"""

import logging
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats
from scipy.linalg import block_diag

from .. import splines
from ..geometry.triangles import Floats

log = logging.getLogger(__name__)
INTERVAL_Z = 1.645
"""Half the width of a 90 % interval in standard errors."""

# the following were chosen on cohorts of `benchmarks/centiles.py`
LOCATION_FREEDOM, SUBJECTS_PER_LOCATION = (3.25, 7.5), 15
"""Degrees of freedom of the curve of location, without subjects and at most, and
subjects for each further one."""
SCALE_FREEDOM, SUBJECTS_PER_SCALE = (1.7, 4.5), 13
"""The same of the curve of scale."""
MIN_WEEKS_FOR_SPLINES = 8
INTERVALS = 6
"""Intervals between the knots of the splines."""
HALF_CHANGE_SD = 1.5
"""Standard deviation of the prior of half the change of ln S over all weeks, around
0."""
MIN_SUBJECTS_FOR_SKEWNESS = 100
"""With fewer subjects, the skewness is not known and is `SKEWNESS`."""
SKEWNESS, SKEWNESS_SD = 0.2, 1.0
"""Mean and standard deviation of the prior of the skewness: 0 is the lognormal
distribution, 1 the normal one."""
SHAPE_WEIGHT = 0.6
"""Weight of the error of ln S at a week, relative to that of its mean, in the degrees
of freedom of Student's distribution.

Such errors are nearer to normal than those of the mean, and make fewer extreme
scores."""
MAX_LEVERAGE = 0.9
MIN_SCATTER = 1e-9
ROUNDS, MAX_STEP = 60, 1.0
STEP_TOL, POOR_STEP = 1e-3, 0.05
"""Largest shift, in scales, at which a fit ends, and at which it is good enough after
all rounds."""
DAMPED_STEP, ROUNDS_UNTIL_DAMPED = 0.5, 15
"""Factor of the steps after so many rounds: few subjects at an end can make the scale
swing."""


@dataclass(frozen=True, eq=False)
class WeeklyNorm:
    """The distribution of a metric by week, from `first` to `last`.

    A value y is z = ((y/M)^L − 1)/(L S) scales from the location M, with scale S and
    skewness L, if the metric is positive, and z = (y − M)/S if it may have either sign.
    ln M (or M) and ln S are linear in `location` and `scale`, which are coefficients of
    `splines`, or of powers of the week if there are few weeks. The covariance is that
    of location, scale and skewness, the last only if it was estimated. `freedom` are
    the degrees of freedom that are left for the mean of the scale.
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
    freedom: float

    def _bases(self, weeks: ArrayLike) -> tuple[Floats, Floats]:
        at = np.atleast_1d(np.asarray(weeks, dtype=float))
        sizes = (len(self.location), len(self.scale))
        location, scale = (
            _basis(at, self.first, self.last, size, self.is_spline) for size in sizes
        )
        return location, scale

    def _errors(self, locations: Floats, scales: Floats) -> tuple[Floats, Floats]:
        """Return the variances of the location, in squared scales, and of ln S at
        weeks."""
        size = len(self.location)
        end = size + len(self.scale)
        location = self.covariance[:size, :size]
        scale = self.covariance[size:end, size:end]
        squared_scales = np.exp(2 * (scales @ self.scale))
        leverage = _squares(locations, location) / squared_scales
        return leverage, _squares(scales, scale)

    def _student(self, locations: Floats, scales: Floats) -> tuple[Floats, Floats]:
        """Return the degrees of freedom and the spread of Student's distribution of new
        subjects, in scales."""
        leverage, log_scale = self._errors(locations, scales)
        by_shape = 2 * log_scale
        by_count = 1 / self.freedom
        inverse = SHAPE_WEIGHT * by_shape + (1 - SHAPE_WEIGHT) * by_count
        return 1 / inverse, np.sqrt(1 + leverage)

    def scores(self, weeks: ArrayLike, values: ArrayLike) -> tuple[Floats, Floats]:
        """Return z (n,) of new subjects with values at weeks, and its 90 % interval (2,
        n).

        A normal new subject is below the 5th centile by z with a chance of 5 %: z is
        that of Student's distribution, with the errors of location and scale. The
        interval is that of the z which the value has in the population.
        """
        locations, scales = self._bases(weeks)
        at = np.atleast_1d(np.asarray(values, dtype=float))
        terms = _terms(
            locations @ self.location,
            scales @ self.scale,
            self.skewness,
            at,
            self.is_positive,
        )
        slopes = np.hstack(
            [terms.by_location[:, None] * locations, -terms.z[:, None] * scales]
        )
        if len(self.covariance) > slopes.shape[1]:
            slopes = np.hstack([slopes, terms.by_skewness[:, None]])
        error = np.sqrt(np.maximum(_squares(slopes, self.covariance), 0.0))
        freedom, spread = self._student(locations, scales)
        # the smaller tail does not round to 1
        z = -np.sign(terms.z) * stats.norm.ppf(
            stats.t.cdf(-np.abs(terms.z) / spread, freedom)
        )
        return z, terms.z + INTERVAL_Z * np.stack([-error, error])

    def values(self, weeks: ArrayLike, z: float) -> Floats:
        """Return the values with a z at weeks (n,): the inverse of `scores`."""
        locations, scales = self._bases(weeks)
        freedom, spread = self._student(locations, scales)
        distance = (
            np.exp(scales @ self.scale)
            * spread
            * stats.t.ppf(stats.norm.cdf(z), freedom)
        )
        if not self.is_positive:
            return locations @ self.location + distance
        power = np.maximum(1.0 + self.skewness * distance, 1e-9)
        logs = distance if abs(self.skewness) < 1e-6 else np.log(power) / self.skewness
        return np.exp(locations @ self.location + logs)

    def median_interval(self, weeks: ArrayLike) -> Floats:
        """Return the 90 % interval (2, n) of the median at weeks."""
        locations, scales = self._bases(weeks)
        error = (
            INTERVAL_Z
            * np.exp(scales @ self.scale)
            * np.sqrt(self._errors(locations, scales)[0])
        )
        both = locations @ self.location + np.stack([-error, error])
        return np.exp(both) if self.is_positive else both

    def without(self, week: float, value: float) -> "WeeklyNorm":
        """Return the norm without the only scan of a subject, by one Newton step from
        the whole."""
        (locations, scales), values = self._bases(week), np.array([value])
        terms = _terms(
            locations @ self.location,
            scales @ self.scale,
            self.skewness,
            values,
            self.is_positive,
        )
        left = 1 - np.minimum(self._errors(locations, scales)[0], MAX_LEVERAGE)
        slope = _slope(terms, locations, scales, np.ones(1), left)
        step, size = self.covariance @ slope[: len(self.covariance)], len(self.location)
        location = self.location - step[:size]
        scale = self.scale - step[size : size + len(self.scale)]
        skewness = self.skewness - float(step[size + len(self.scale) :].sum())
        return replace(
            self,
            location=location,
            scale=scale,
            skewness=skewness,
            subjects=self.subjects - 1,
        )

    @property
    def plain(self) -> dict[str, Any]:
        """The fields as plain values for JSON."""
        return {key: np.asarray(part).tolist() for key, part in asdict(self).items()}


def norm_from_plain(plain: Mapping[str, Any]) -> WeeklyNorm:
    """Return the norm that `WeeklyNorm.plain` gives as plain values."""
    arrays = {
        key: np.array(plain[key], dtype=float)
        for key in ("location", "scale", "covariance")
    }
    return WeeklyNorm(**{**plain, **arrays})


def fit_norm(
    weeks: Floats, values: Floats, people: ArrayLike, *, is_positive: bool
) -> WeeklyNorm:
    """Fit a norm to values (n,) at weeks (n,) of people (n,) by penalised likelihood,
    restricted for the scale.

    The scans of a subject together have the weight of one; errors are by the
    correlation of their z. Curves are splines, or of fewer than eight weeks a quadratic
    of the location and a line of the scale. Fewer than four weeks have a line, one week
    a constant. The skewness is estimated from `MIN_SUBJECTS_FOR_SKEWNESS` on.
    """
    scans = _Scans.of(people)
    weights, subjects = scans.weights, int(scans.person.max()) + 1
    first, last, count = float(weeks.min()), float(weeks.max()), len(np.unique(weeks))
    is_spline = count >= MIN_WEEKS_FOR_SPLINES
    powers = 3 if count > 3 else 2 if count > 1 else 1
    size, scale_size = (INTERVALS + 3,) * 2 if is_spline else (powers, min(powers, 2))
    rows, scale_rows = (
        _basis(weeks, first, last, each, is_spline) for each in (size, scale_size)
    )
    start = np.log(values) if is_positive else values
    normal, freedom = (rows.T * weights) @ rows, float(size)
    location_penalty: Floats = np.zeros((size, size))
    ends = _basis(np.array([first, last]), first, last, scale_size, is_spline)
    half_change = 0.5 * np.diff(ends, axis=0) / HALF_CHANGE_SD
    scale_penalty = half_change.T @ half_change
    if is_spline:
        freedom = min(
            LOCATION_FREEDOM[0] + subjects / SUBJECTS_PER_LOCATION,
            LOCATION_FREEDOM[1],
            count - 1.0,
        )
        location_penalty = splines.penalty(first, last, INTERVALS, order=2)
        location_penalty *= splines.strength(
            normal, location_penalty, freedom, "location of the norm"
        )
        scale_freedom = min(
            SCALE_FREEDOM[0] + subjects / SUBJECTS_PER_SCALE, SCALE_FREEDOM[1]
        )
        roughness = splines.penalty(first, last, INTERVALS, order=1)
        # the information of an observation on ln S is 2
        scale_penalty += (
            2.0
            * splines.strength(normal, roughness, scale_freedom, "scale of the norm")
            * roughness
        )
    location = np.linalg.solve(normal + location_penalty, rows.T @ (weights * start))
    variance = float(weights @ (start - rows @ location) ** 2) / max(
        subjects - freedom, 1.0
    )
    has_scatter = variance > MIN_SCATTER**2
    unit = max(float(np.sqrt(variance)), MIN_SCATTER)
    with_skewness = is_positive and subjects >= MIN_SUBJECTS_FOR_SKEWNESS
    mean = np.zeros(size + scale_size + with_skewness)
    mean[size + scale_size :] = SKEWNESS
    # the location is fitted in units of the scatter: then the information of an
    # observation on it is about 1
    rows = unit * rows
    penalty = block_diag(
        location_penalty, scale_penalty, *[[[SKEWNESS_SD**-2]]] * with_skewness
    )
    fit: Floats = mean.copy()
    fit[:size], fit[size] = location / unit, np.log(unit)
    for number in range(ROUNDS):
        log_scale = scale_rows @ fit[size : size + scale_size]
        skewness = _skewness(fit, with_skewness, is_positive)
        terms = _terms(rows @ fit[:size], log_scale, skewness, values, is_positive)
        scans = scans.correlated(terms.z)
        information, left = _information(
            rows, scale_rows, log_scale, skewness, scans, penalty
        )
        slope = _slope(terms, rows, scale_rows, weights, left)[: len(fit)] - penalty @ (
            fit - mean
        )
        information = information[: len(fit), : len(fit)] + penalty
        step = np.linalg.solve(information, slope)
        shifts = np.abs(
            [
                rows @ step[:size] * np.exp(-log_scale),
                scale_rows @ step[size : size + scale_size],
            ]
        )
        if not has_scatter or shifts.max() < STEP_TOL:
            break
        fit += (
            step
            * min(1.0, MAX_STEP / shifts.max())
            * (1.0 if number < ROUNDS_UNTIL_DAMPED else DAMPED_STEP)
        )
    if has_scatter and shifts.max() > POOR_STEP:
        log.warning(
            "the norm of %d subjects at weeks %g to %g has not converged",
            subjects,
            first,
            last,
        )
    skewness = _skewness(fit, with_skewness, is_positive)
    inverse = np.linalg.inv(information)
    if scans.correlation is not None:
        # the scatter of the slopes with correlated scans
        scatter = information.copy()
        parts = (slice(0, size), slice(size, size + scale_size))
        scaled_rows = (
            rows * np.exp(-log_scale)[:, None],
            np.sqrt(2 * left)[:, None] * scale_rows,
        )
        for part, part_rows, power in zip(parts, scaled_rows, (1, 2), strict=True):
            scatter[part, part] = penalty[part, part] + part_rows.T @ scans.spread(
                part_rows, power
            )
        inverse = inverse @ scatter @ inverse
    units = np.ones(len(fit))
    units[:size] = unit
    fit, covariance = fit * units, inverse * np.outer(units, units)
    free = (
        float(weights @ left)
        * subjects
        / float(scans.spread(np.ones((len(weights), 1)), 2).sum())
    )
    curves = fit[:size], fit[size : size + scale_size]
    return WeeklyNorm(
        first,
        last,
        is_positive,
        *curves,
        skewness,
        covariance,
        subjects,
        is_spline,
        free,
    )


@dataclass(frozen=True, eq=False)
class _Scans:
    """The persons of scans by number, the scans' weights, and the correlation of a
    person's z, None of single scans."""

    person: NDArray[np.int64]
    weights: Floats
    correlation: float | None

    @classmethod
    def of(cls, people: ArrayLike) -> "_Scans":
        _, person, counts = np.unique(
            np.asarray(people), return_inverse=True, return_counts=True
        )
        return cls(person, 1.0 / counts[person], 1.0 if counts.max() > 1 else None)

    def correlated(self, z: Floats) -> "_Scans":
        """Return them with the correlation that z (n,) have."""
        if self.correlation is None:
            return self
        counts, sums = (
            np.bincount(self.person, values) for values in (np.ones(len(z)), z)
        )
        products = sums**2 - np.bincount(self.person, z**2)
        several = counts > 1
        mean = np.mean(products[several] / (counts * (counts - 1))[several])
        return replace(
            self,
            correlation=float(
                np.clip(mean / (self.weights @ z**2) * len(counts), 0.0, 1.0)
            ),
        )

    def spread(self, rows: Floats, power: int = 1) -> Floats:
        """Return the product (n, k) of rows with the weights, and the powers of the
        correlations, between scans."""
        weighted = self.weights[:, None] * rows
        if self.correlation is None:
            return weighted
        both = np.zeros((self.person.max() + 1, rows.shape[1]))
        np.add.at(both, self.person, weighted)
        shared = self.correlation**power
        return self.weights[:, None] * (
            shared * both[self.person] + (1 - shared) * weighted
        )


def _skewness(fit: Floats, is_estimated: bool, is_positive: bool) -> float:
    return float(fit[-1]) if is_estimated else SKEWNESS if is_positive else 0.0


def _information(
    rows: Floats,
    scale_rows: Floats,
    log_scale: Floats,
    skewness: float,
    scans: "_Scans",
    penalty: Floats,
) -> tuple[Floats, Floats]:
    """Return the expected information on all parameters, and what the location leaves
    of each observation's scatter.

    It is that of Rigby and Stasinopoulos (2005, doi 10.1111/j.1467-9876.2005.00510.x),
    for small S, by logarithms.
    """
    size, squared, weights = rows.shape[1], np.exp(2 * log_scale), scans.weights
    each = (1 + 2 * skewness**2 * squared) / squared
    location = (rows.T * (weights * each)) @ rows
    own = np.sqrt(each)[:, None] * rows
    leverage = (
        np.einsum(
            "ij,ij->i",
            own @ np.linalg.inv(location + penalty[:size, :size]),
            scans.spread(own),
        )
        / weights
    )
    left = 1 - np.minimum(leverage, MAX_LEVERAGE)
    scale = 2 * (scale_rows.T * (weights * left)) @ scale_rows
    both = 2 * skewness * (rows.T * weights) @ scale_rows
    location_skewness = -0.5 * rows.T @ weights[:, None]
    scale_skewness = -skewness * scale_rows.T @ (weights * squared)[:, None]
    last = [
        location_skewness.T,
        scale_skewness.T,
        np.array([[7 / 4 * (weights @ squared)]]),
    ]
    return (
        np.block(
            [[location, both, location_skewness], [both.T, scale, scale_skewness], last]
        ),
        left,
    )


def _slope(
    terms: "_Terms", rows: Floats, scale_rows: Floats, weights: Floats, left: Floats
) -> Floats:
    """Return the slope of the restricted log-likelihood by location, ln scale and
    skewness."""
    parts = (
        (weights * terms.slope_location) @ rows,
        (weights * (terms.z**2 - left)) @ scale_rows,
    )
    return np.concatenate([*parts, [weights @ terms.slope_skewness]])


def _squares(rows: Floats, covariance: Floats) -> Floats:
    return np.einsum("ij,jk,ik->i", rows, covariance, rows)


@dataclass(frozen=True, eq=False)
class _Terms:
    """z of values, its slopes by location and skewness (by ln scale it is −z), and two
    slopes of the log-likelihood."""

    z: Floats
    by_location: Floats
    by_skewness: Floats
    slope_location: Floats
    slope_skewness: Floats


def _terms(
    location: Floats,
    log_scale: Floats,
    skewness: float,
    values: Floats,
    is_positive: bool,
) -> _Terms:
    scale = np.exp(log_scale)
    if not is_positive:
        z, zero = (values - location) / scale, np.zeros(len(values))
        return _Terms(z, -1 / scale, zero, z / scale, zero)
    logs = np.log(values) - location
    power = np.exp(skewness * logs)
    # the limits for small skewness
    is_small = abs(skewness) < 1e-4
    scaled_z = logs + 0.5 * skewness * logs**2 if is_small else (power - 1) / skewness
    by_skewness = 0.5 * logs**2 if is_small else (logs * power - scaled_z) / skewness
    z = scaled_z / scale
    return _Terms(
        z=z,
        by_location=-power / scale,
        by_skewness=by_skewness / scale,
        slope_location=z * power / scale - skewness,
        slope_skewness=logs - z * by_skewness / scale,
    )


def _basis(
    weeks: Floats, first: float, last: float, size: int, is_spline: bool
) -> Floats:
    """Return the (n, size) values of the splines, or of the powers of the week, at
    weeks (n,)."""
    if is_spline:
        return splines.design(weeks, first, last, size - 3)
    return np.vander(
        (weeks - 0.5 * (first + last)) / max(0.5 * (last - first), 1e-9),
        size,
        increasing=True,
    )
