"""Norms of a metric over gestational weeks: location, scale and skewness as smooth
curves.

Positive metrics by the LMS method of Cole and Green (1992, doi 10.1002/sim.4780111005),
as in the growth standards of the WHO; metrics of either sign by a smooth form of the
split normal distribution (Wallis 2014, doi 10.1214/13-STS417). The scale is fitted by
restricted likelihood. Scores of new subjects allow for the errors of the curves.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag
from scipy.special import ndtr, ndtri, stdtr, stdtrit

from .. import splines
from ..geometry.triangles import Floats

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
"""With fewer subjects, the skewness is not known and is the mean of its prior."""
SKEWNESS, SKEWNESS_SD = 0.2, 1.0
"""Mean and standard deviation of the prior of the skewness of positive metrics: 0 is
the lognormal distribution, 1 the normal one."""
SKEWNESS_BY_SCALE = 0.25
"""Standard deviation of that prior, times the scale, where the scale is small: the
skewness of the values is about 3 (1 − L) S."""
SIGNED_SKEWNESS, SIGNED_SKEWNESS_SD = 0.0, 1.0
"""The same of metrics of either sign: 0 is the normal distribution."""
SKEWED_SD = 1.5
"""Skewness of the residuals, in its standard deviations for normal ones, from which a
norm of few subjects is skewed."""
SKEWED_SCALE = 0.18
"""Scale of positive metrics from which the skewness that a norm of few subjects does
not know moves the 5th centile by a quarter of a standard deviation."""
MAX_SKEWNESS_STEP = 0.5
SHAPE_WEIGHT = 0.6
"""Weight of the error of ln S at a week, relative to that of its mean, in the degrees
of freedom of Student's distribution.

Such errors are nearer to normal than those of the mean, and make fewer extreme
scores."""
QUADRATURE_POINTS = 40
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
    skewness L, if the metric is positive. If it may have either sign, z = u − κ(√(1 +
    u²) − 1) with u = (y − M)/S and κ = tanh L: far above M the scale is S/(1 − κ), far
    below it S/(1 + κ). ln M (or M) and ln S are linear in `location` and `scale`, which
    are coefficients of `splines`, or of powers of the week if there are few weeks. The
    covariance is that of location, scale and skewness, the last only if it was
    estimated. `freedom` are the degrees of freedom that are left for the mean of the
    scale.

    If it `is_skewed`, its subjects are too few to know how much, and centiles beyond
    the 10th and 90th do not hold. The fit may not have converged.
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
    is_skewed: bool
    has_converged: bool

    def _bases(self, weeks: ArrayLike) -> tuple[Floats, Floats]:
        at = np.atleast_1d(np.asarray(weeks, dtype=float))
        sizes = (len(self.location), len(self.scale))
        location, scale = (
            _basis(
                at,
                self.first,
                self.last,
                size,
                self.is_spline,
            )
            for size in sizes
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
        terms = self._terms_at(locations, scales, values)
        slopes = np.hstack(
            [
                terms.by_location[:, None] * locations,
                terms.by_scale[:, None] * scales,
            ]
        )
        if len(self.covariance) > slopes.shape[1]:
            slopes = np.hstack([slopes, terms.by_skewness[:, None]])
        error = np.sqrt(
            np.maximum(
                _squares(slopes, self.covariance),
                0.0,
            )
        )
        freedom, spread = self._student(locations, scales)
        # the smaller tail does not round to 1
        tail = stdtr(freedom, -np.abs(terms.z) / spread)
        z = -np.sign(terms.z) * ndtri(tail)
        return z, terms.z + INTERVAL_Z * np.stack([-error, error])

    def _terms_at(
        self,
        locations: Floats,
        scales: Floats,
        values: ArrayLike,
    ) -> "_Terms":
        return _terms(
            locations @ self.location,
            scales @ self.scale,
            self.skewness,
            np.atleast_1d(np.asarray(values, dtype=float)),
            self.is_positive,
        )

    def robust_scores(self, weeks: ArrayLike, values: ArrayLike) -> Floats:
        """Return z (n,) of the norm's own values at weeks over their median absolute
        deviation, of positive metrics with the skewness of the prior: so outliers do
        not hide themselves by a large scale or skewness."""
        norm = self
        if self.is_positive:
            norm = replace(self, skewness=SKEWNESS)
        locations, scales = norm._bases(weeks)
        z = norm._terms_at(locations, scales, values).z
        deviation = np.median(np.abs(z - np.median(z))) / ndtri(0.75)
        return z / max(float(deviation), MIN_SCATTER)

    def values(self, weeks: ArrayLike, z: float) -> Floats:
        """Return the values with a z at weeks (n,): the inverse of `scores`."""
        locations, scales = self._bases(weeks)
        freedom, spread = self._student(locations, scales)
        new_z = spread * stdtrit(freedom, ndtr(z))
        scale = np.exp(scales @ self.scale)
        if not self.is_positive:
            return locations @ self.location + scale * _signed_distance(
                new_z, self.skewness
            )
        distance = scale * new_z
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
        locations, scales = self._bases(week)
        terms = self._terms_at(locations, scales, value)
        leverage, _ = self._errors(locations, scales)
        remaining = 1 - np.minimum(leverage, MAX_LEVERAGE)
        slope = _slope(
            terms,
            locations,
            scales,
            np.ones(1),
            remaining,
        )
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


def fit_norm(
    weeks: Floats,
    values: Floats,
    people: ArrayLike,
    *,
    is_positive: bool,
) -> WeeklyNorm:
    """Fit a norm to values (n,) at weeks (n,) of people (n,) by penalised likelihood,
    restricted for the scale.

    The scans of a subject together have the weight of one; errors are by the
    correlation of their z. Curves are splines, or of fewer than eight weeks a quadratic
    of the location and a line of the scale. Fewer than four weeks have a line, one week
    a constant. The skewness is estimated from `MIN_SUBJECTS_FOR_SKEWNESS` on.
    """
    scans = _scans(people)
    subjects = int(scans.person.max()) + 1
    has_skewness = subjects >= MIN_SUBJECTS_FOR_SKEWNESS
    start = np.log(values) if is_positive else values
    model = _model(
        weeks,
        start,
        scans.weights,
        subjects,
        is_positive,
        has_skewness,
    )
    size = model.rows.shape[1]
    unit = model.scatter
    has_scatter = unit > MIN_SCATTER
    # the location is fitted in units of the scatter: then the information of an
    # observation on it is about 1
    rows = unit * model.rows
    fit: Floats = model.mean.copy()
    fit[:size] = model.location / unit
    fit[size] = np.log(unit)
    shift = 0.0
    for number in range(ROUNDS):
        state = _state(model, rows, fit, values, scans)
        scans = state.scans
        step = np.linalg.solve(state.information, state.slope)
        shifts = [
            rows @ step[:size] * np.exp(-state.log_scale),
            model.scale_rows @ step[size : size + model.scale_rows.shape[1]],
        ]
        shift = float(np.abs(shifts).max())
        if not has_scatter or shift < STEP_TOL:
            break
        factor = min(1.0, MAX_STEP / shift)
        if has_skewness:
            factor = min(
                factor,
                MAX_SKEWNESS_STEP / max(abs(step[-1]), MIN_SCATTER),
            )
        if number >= ROUNDS_UNTIL_DAMPED:
            factor *= DAMPED_STEP
        fit += factor * step
    units = np.ones(len(fit))
    units[:size] = unit
    covariance = _covariance(model, rows, state) * np.outer(units, units)
    fit *= units
    scale = fit[size : size + model.scale_rows.shape[1]]
    shared = _spread(
        scans,
        np.ones((len(values), 1)),
        2,
    ).sum()
    is_wide = is_positive and np.exp(model.scale_rows @ scale).max() > SKEWED_SCALE
    is_few = not has_skewness
    return WeeklyNorm(
        model.first,
        model.last,
        is_positive,
        fit[:size],
        scale,
        _skewness(model, fit),
        covariance,
        subjects,
        model.is_spline,
        freedom=float(scans.weights @ state.remaining) * subjects / float(shared),
        is_skewed=bool(is_few and (is_wide or _are_skewed(state.terms.z))),
        has_converged=bool(not has_scatter or shift <= POOR_STEP),
    )


def _are_skewed(z: Floats) -> bool:
    """Return whether residuals are more skewed than normal ones usually are."""
    expected_sd = np.sqrt(6 / len(z))
    centred = z - z.mean()
    third_moment = (centred**3).mean()
    scale = (centred**2).mean() ** 1.5
    return bool(abs(third_moment) > SKEWED_SD * expected_sd * scale)


@dataclass(frozen=True, eq=False)
class _Model:
    """The bases of location and scale at the weeks of the values, and the prior.

    `mean` (k,) is that of location, scale and, if it is estimated, skewness; `penalty`
    (k, k) is the inverse of their covariance. `location` are its first coefficients, by
    least squares, and `scatter` is the scale of all values around it, on which the
    prior of the skewness depends.
    """

    first: float
    last: float
    is_spline: bool
    is_positive: bool
    has_skewness: bool
    rows: Floats
    scale_rows: Floats
    location: Floats
    scatter: float
    mean: Floats
    penalty: Floats


def _model(
    weeks: Floats,
    values: Floats,
    weights: Floats,
    subjects: int,
    is_positive: bool,
    has_skewness: bool,
) -> _Model:
    first, last = float(weeks.min()), float(weeks.max())
    count = len(np.unique(weeks))
    is_spline = count >= MIN_WEEKS_FOR_SPLINES
    size = scale_size = INTERVALS + 3
    if not is_spline:
        size = 3 if count > 3 else min(count, 2)
        scale_size = min(size, 2)
    rows = _basis(weeks, first, last, size, is_spline)
    scale_rows = _basis(weeks, first, last, scale_size, is_spline)
    freedom = float(size)
    location_penalty: Floats = np.zeros((size, size))
    ends = _basis(
        np.array([first, last]),
        first,
        last,
        scale_size,
        is_spline,
    )
    half_change = 0.5 * np.diff(ends, axis=0) / HALF_CHANGE_SD
    scale_penalty = half_change.T @ half_change
    normal = (rows.T * weights) @ rows
    if is_spline:
        lowest, highest = LOCATION_FREEDOM
        freedom = lowest + subjects / SUBJECTS_PER_LOCATION
        freedom = min(freedom, highest, count - 1.0)
        bending = splines.penalty(first, last, INTERVALS, order=2)
        location_penalty = bending * splines.strength(
            normal, bending, freedom, "location of the norm"
        )
        lowest, highest = SCALE_FREEDOM
        scale_freedom = min(lowest + subjects / SUBJECTS_PER_SCALE, highest)
        roughness = splines.penalty(first, last, INTERVALS, order=1)
        strength = splines.strength(
            normal, roughness, scale_freedom, "scale of the norm"
        )
        # the information of an observation on ln S is 2
        scale_penalty += 2.0 * strength * roughness
    location = np.linalg.solve(normal + location_penalty, rows.T @ (weights * values))
    squares = float(weights @ (values - rows @ location) ** 2)
    scatter = float(np.sqrt(squares / max(subjects - freedom, 1.0)))
    scatter = max(scatter, MIN_SCATTER)
    mean = np.zeros(size + scale_size)
    penalties = [location_penalty, scale_penalty]
    if has_skewness:
        sd = SIGNED_SKEWNESS_SD
        if is_positive:
            sd = max(SKEWNESS_SD, SKEWNESS_BY_SCALE / scatter)
        mean = np.append(mean, _usual_skewness(is_positive))
        penalties.append(np.array([[sd**-2]]))
    return _Model(
        first,
        last,
        is_spline,
        is_positive,
        has_skewness,
        rows,
        scale_rows,
        location,
        scatter,
        mean,
        penalty=block_diag(*penalties),
    )


def _usual_skewness(is_positive: bool) -> float:
    """Return the mean of the prior of the skewness."""
    return SKEWNESS if is_positive else SIGNED_SKEWNESS


def _skewness(model: _Model, fit: Floats) -> float:
    """Return the skewness of parameters (k,)."""
    if model.has_skewness:
        return float(fit[-1])
    return _usual_skewness(model.is_positive)


def _state(
    model: _Model,
    rows: Floats,
    fit: Floats,
    values: Floats,
    scans: "_Scans",
) -> "_State":
    """Return slope and information of the likelihood of values (n,) at parameters
    (k,), of which the location has the basis `rows`."""
    size = rows.shape[1]
    log_scale = model.scale_rows @ fit[size : size + model.scale_rows.shape[1]]
    skewness = _skewness(model, fit)
    terms = _terms(
        rows @ fit[:size],
        log_scale,
        skewness,
        values,
        model.is_positive,
    )
    scans = _correlated(scans, terms.z)
    expected = _expected(log_scale, skewness, model.is_positive)
    information, remaining = _information(
        rows, model.scale_rows, expected, scans, model.penalty
    )
    count = len(fit)
    slope = _slope(
        terms,
        rows,
        model.scale_rows,
        scans.weights,
        remaining,
    )[:count]
    return _State(
        terms,
        log_scale,
        expected,
        remaining,
        slope - model.penalty @ (fit - model.mean),
        information[:count, :count] + model.penalty,
        scans,
    )


def _covariance(model: _Model, rows: Floats, state: "_State") -> Floats:
    """Return the covariance (k, k) of the parameters.

    It is the inverse I⁻¹ of the information or, if subjects have several scans, I⁻¹
    B I⁻¹ with the covariance B of the slopes, to which the prior adds its penalty.
    """
    inverse = np.linalg.inv(state.information)
    scans = state.scans
    if scans.correlation is None:
        return inverse
    size, count = rows.shape[1], len(inverse)
    scale_end = size + model.scale_rows.shape[1]
    # no column if skewness is not estimated
    ones = np.ones((len(rows), count - scale_end))
    parts = [
        (slice(0, size), rows),
        (slice(size, scale_end), model.scale_rows),
        (slice(scale_end, count), ones),
    ]
    e = state.expected
    expected = [
        [e.location, e.location_scale, e.location_skewness],
        [e.location_scale, e.scale * state.remaining, e.scale_skewness],
        [e.location_skewness, e.scale_skewness, e.skewness],
    ]
    # slopes are about Hermite polynomials of z, of degree 1 for location, 2 for
    # scale, 1 and 3 for skewness. Those of two scans correlate as the correlation
    # of z to the power of the degree that they share
    powers = [[1, 2, 1], [2, 2, 2], [1, 2, 3]]
    scatter = model.penalty.copy()
    for i, (here, own) in enumerate(parts):
        for j, (there, other) in enumerate(parts):
            each = expected[i][j][:, None] * other
            scatter[here, there] += own.T @ _spread(scans, each, powers[i][j])
    # each product took the expectation at one of its two scans
    scatter = 0.5 * (scatter + scatter.T)
    return inverse @ scatter @ inverse


@dataclass(frozen=True, eq=False)
class _State:
    """A step of a fit: slope (k,) and information (k, k) of the penalised likelihood,
    and what the location leaves of each observation's scatter."""

    terms: "_Terms"
    log_scale: Floats
    expected: "_Expected"
    remaining: Floats
    slope: Floats
    information: Floats
    scans: "_Scans"


@dataclass(frozen=True, eq=False)
class _Scans:
    """The persons of scans by number, the scans' weights, and the correlation of a
    person's z, None of single scans."""

    person: NDArray[np.int64]
    weights: Floats
    correlation: float | None


def _scans(people: ArrayLike) -> _Scans:
    _, person, counts = np.unique(
        np.asarray(people), return_inverse=True, return_counts=True
    )
    return _Scans(
        person,
        1.0 / counts[person],
        1.0 if counts.max() > 1 else None,
    )


def _correlated(scans: _Scans, z: Floats) -> _Scans:
    """Return scans with the correlation that z (n,) have."""
    if scans.correlation is None:
        return scans
    counts, sums = (
        np.bincount(scans.person, values) for values in (np.ones(len(z)), z)
    )
    products = sums**2 - np.bincount(scans.person, z**2)
    several = counts > 1
    mean = np.mean(products[several] / (counts * (counts - 1))[several])
    correlation = np.clip(
        mean / (scans.weights @ z**2) * len(counts),
        0.0,
        1.0,
    )
    return replace(scans, correlation=float(correlation))


def _spread(scans: _Scans, rows: Floats, power: int = 1) -> Floats:
    """Return the product (n, k) of rows with the weights, and the powers of the
    correlations, between scans."""
    weighted = scans.weights[:, None] * rows
    if scans.correlation is None:
        return weighted
    both = np.zeros((scans.person.max() + 1, rows.shape[1]))
    np.add.at(both, scans.person, weighted)
    shared = scans.correlation**power
    return scans.weights[:, None] * (
        shared * both[scans.person] + (1 - shared) * weighted
    )


@dataclass(frozen=True, eq=False)
class _Expected:
    """The expected information (n,) of observations on location, ln scale and skewness,
    and on two of them."""

    location: Floats
    scale: Floats
    skewness: Floats
    location_scale: Floats
    location_skewness: Floats
    scale_skewness: Floats


def _expected(
    log_scale: Floats,
    skewness: float,
    is_positive: bool,
) -> _Expected:
    """Return the expected information of observations.

    That of positive ones is by Rigby and Stasinopoulos (2005, doi
    10.1111/j.1467-9876.2005.00510.x), for small S, by logarithms; that of others is
    integrated.
    """
    scale = np.exp(log_scale)
    one = np.ones(len(scale))
    if is_positive:
        return _Expected(
            location=(1 + 2 * skewness**2 * scale**2) / scale**2,
            scale=2 * one,
            skewness=7 / 4 * scale**2,
            location_scale=2 * skewness * one,
            location_skewness=-0.5 * one,
            scale_skewness=-skewness * scale**2,
        )
    z, weights = np.polynomial.hermite_e.hermegauss(QUADRATURE_POINTS)
    distance = _signed_distance(z, skewness)
    terms = _signed_terms(
        0.0,
        np.zeros(len(z)),
        skewness,
        distance,
    )
    slopes = np.stack(
        [terms.slope_location, terms.slope_scale - 1, terms.slope_skewness]
    )
    found = (slopes * weights / weights.sum()) @ slopes.T
    return _Expected(
        location=found[0, 0] / scale**2,
        scale=found[1, 1] * one,
        skewness=found[2, 2] * one,
        location_scale=found[0, 1] / scale,
        location_skewness=found[0, 2] / scale,
        scale_skewness=found[1, 2] * one,
    )


def _information(
    rows: Floats,
    scale_rows: Floats,
    expected: _Expected,
    scans: "_Scans",
    penalty: Floats,
) -> tuple[Floats, Floats]:
    """Return the expected information (k, k) on location, ln scale and skewness, the
    last also if it is not estimated, and what the location leaves of each observation's
    scatter (n,): 1 − its leverage."""
    weights = scans.weights
    n_location = rows.shape[1]
    location = (rows.T * (weights * expected.location)) @ rows
    covariance = np.linalg.inv(location + penalty[:n_location, :n_location])
    scaled_rows = np.sqrt(expected.location)[:, None] * rows
    spread_rows = _spread(scans, scaled_rows)
    leverage = np.einsum("ij,ij->i", scaled_rows @ covariance, spread_rows) / weights
    remaining = 1 - np.minimum(leverage, MAX_LEVERAGE)
    scale = (scale_rows.T * (weights * expected.scale * remaining)) @ scale_rows
    location_scale = (rows.T * (weights * expected.location_scale)) @ scale_rows
    location_skewness = rows.T @ (weights * expected.location_skewness)[:, None]
    scale_skewness = scale_rows.T @ (weights * expected.scale_skewness)[:, None]
    skewness = np.array([[weights @ expected.skewness]])
    blocks = [
        [location, location_scale, location_skewness],
        [location_scale.T, scale, scale_skewness],
        [location_skewness.T, scale_skewness.T, skewness],
    ]
    return np.block(blocks), remaining


def _slope(
    terms: "_Terms",
    rows: Floats,
    scale_rows: Floats,
    weights: Floats,
    remaining: Floats,
) -> Floats:
    """Return the slope of the restricted log-likelihood by location, ln scale and
    skewness."""
    location = (weights * terms.slope_location) @ rows
    scale = (weights * (terms.slope_scale - remaining)) @ scale_rows
    return np.concatenate(
        [
            location,
            scale,
            [weights @ terms.slope_skewness],
        ]
    )


def _squares(rows: Floats, covariance: Floats) -> Floats:
    return np.einsum("ij,jk,ik->i", rows, covariance, rows)


@dataclass(frozen=True, eq=False)
class _Terms:
    """z of values, and slopes by location, ln scale and skewness, of z and of the
    log-likelihood: that by ln scale is 1 larger, as the restricted one takes less."""

    z: Floats
    by_location: Floats
    by_scale: Floats
    by_skewness: Floats
    slope_location: Floats
    slope_scale: Floats
    slope_skewness: Floats


def _terms(
    location: Floats,
    log_scale: Floats,
    skewness: float,
    values: Floats,
    is_positive: bool,
) -> _Terms:
    if not is_positive:
        return _signed_terms(location, log_scale, skewness, values)
    scale = np.exp(log_scale)
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
        by_scale=-z,
        by_skewness=by_skewness / scale,
        slope_location=z * power / scale - skewness,
        slope_scale=z**2,
        slope_skewness=logs - z * by_skewness / scale,
    )


def _signed_terms(
    location: Floats | float,
    log_scale: Floats,
    skewness: float,
    values: Floats,
) -> _Terms:
    scale = np.exp(log_scale)
    kappa = np.tanh(skewness)
    u = (values - location) / scale
    root = np.sqrt(1 + u**2)
    z = u - kappa * (root - 1)
    slope = 1 - kappa * u / root
    curvature = -kappa / root**3
    # of the log-likelihood by u
    change = z * slope - curvature / slope
    by_skewness = (1 - kappa**2) * (1 - root)
    of_slope = -(1 - kappa**2) * u / root
    return _Terms(
        z=z,
        by_location=-slope / scale,
        by_scale=-u * slope,
        by_skewness=by_skewness,
        slope_location=change / scale,
        slope_scale=u * change,
        slope_skewness=of_slope / slope - z * by_skewness,
    )


def _signed_distance(z: Floats, skewness: float) -> Floats:
    """Return the distances (n,) from the location, in scales, of z of a metric of
    either sign."""
    kappa = np.tanh(skewness)
    shifted = z - kappa
    root = np.sqrt(shifted**2 + 1 - kappa**2)
    return (shifted + kappa * root) / (1 - kappa**2)


def _basis(
    weeks: Floats,
    first: float,
    last: float,
    size: int,
    is_spline: bool,
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
