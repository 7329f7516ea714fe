"""Age from one metric: a monotone curve over gestational weeks, and the week at which it takes a value."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import nnls
from scipy.special import polygamma

from ..geometry.triangles import Floats

GRID_GW = 0.01
"""Spacing of the weeks at which a curve is kept."""

WEEKS_PER_KNOT = 5
"""A curve has one more inner knot for this many further weeks with brains."""

ROUNDING = 1e-9
"""Values that differ by less, relative to their size, are equal."""

LEAST_ERROR_GW = 0.1
"""Least error of an apparent age: no metric counts as more accurate than this."""


@dataclass(frozen=True, eq=False)
class AgeCurve:
    """A metric over gestational weeks, monotone.

    Attributes
    ----------
    weeks : (g,) float
        Ascending, from the youngest to the oldest brain, in GW.
    values : (g,) float
        The metric times `sign`, never falling.
    sign : float
        −1 where the metric falls with age, else 1.
    """

    weeks: Floats
    values: Floats
    sign: float


@dataclass(frozen=True)
class AgeEstimate:
    """An apparent age in GW, read from a curve.

    Attributes
    ----------
    week, low, high
        The age and its range in GW, none beyond the curve's ends.
    outside
        "younger" or "older" where the value lies beyond an end of the curve by more than the noise, else empty.
    clipped
        Whether the age or its range would go on beyond an end: the range is then too short.
    """

    week: float
    low: float
    high: float
    outside: str
    clipped: bool


@dataclass(frozen=True, eq=False)
class LeftOut:
    """How well a metric gives the age of brains whose week was left out of its curve.

    Attributes
    ----------
    error_gw : float
        Root mean square error over brains with younger and older ones beside them, at least `LEAST_ERROR_GW`.
    guess_gw : float
        The same for the middle of the other brains' weeks, a guess without any metric.
    noise : float
        Root mean square difference between these brains' values and the curves without them.
    number : int
        How many brains that is.
    """

    error_gw: float
    guess_gw: float
    noise: float
    number: int

    @property
    def tells_age(self) -> bool:
        """Whether the metric gives the age better than guessing does."""
        return self.error_gw < self.guess_gw


def weights(skills: Sequence[LeftOut]) -> Floats:
    """Returns the (n,) weights of metrics in GW⁻²: the precision beyond guessing, of errors that are shrunk.

    An error from a few brains is mostly luck. Over metrics of equal skill, its logarithm has the variance ψ′(d/2) of
    that of χ² over its d degrees of freedom. Logarithms of squared errors are drawn to their mean by the share of their
    variance that this explains, all of it where they scatter no more than luck would (moderated variances: Smyth 2004,
    Stat. Appl. Genet. Mol. Biol. 3, 3). Metrics that are no better than the guess have no weight.
    """
    found = np.zeros(len(skills))
    telling = [i for i, skill in enumerate(skills) if skill.tells_age]
    if not telling:
        return found
    logs = np.log([skills[i].error_gw ** 2 for i in telling])
    luck = float(polygamma(1, 0.5 * np.mean([skills[i].number for i in telling])))
    real = max(0.0, 1.0 - luck / logs.var(ddof=1)) if len(logs) > 1 and logs.var() > 0 else 0.0
    squares = np.exp(logs.mean() + real * (logs - logs.mean()))
    for i, square in zip(telling, squares, strict=True):
        found[i] = max(0.0, 1.0 / square - skills[i].guess_gw ** -2)
    return found


def age_curve(weeks: Floats, values: Floats) -> AgeCurve:
    """Returns the monotone curve through (n,) values of brains of two or more weeks, by least squares.

    It is a quadratic spline with coefficients that never fall, which makes it monotone (Ramsay 1988, "Monotone
    regression splines in action"), straight for fewer than four weeks; one knot inside for every five weeks beyond
    five. Values that differ by rounding only are level.
    """
    distinct = np.unique(weeks)
    degree = 2 if len(distinct) > 3 else 1
    inner = np.quantile(distinct, np.linspace(0, 1, (len(distinct) - 1) // WEEKS_PER_KNOT + 1)[1:-1])
    knots = np.concatenate([[distinct[0]] * (degree + 1), inner, [distinct[-1]] * (degree + 1)])
    centred = values - values.mean()
    scale = float(np.abs(centred).max())
    if scale <= ROUNDING * np.abs(values).max():
        centred, scale = np.zeros_like(values), 1.0
    sign = -1.0 if float(centred @ (weeks - weeks.mean())) < 0 else 1.0
    rises, _ = nnls(_rising(weeks, knots, degree), sign * centred / scale)
    number = max(2, round((distinct[-1] - distinct[0]) / GRID_GW) + 1)
    grid = np.linspace(distinct[0], distinct[-1], number)
    fitted = _rising(grid, knots, degree) @ rises * scale + sign * values.mean()
    return AgeCurve(grid, np.maximum.accumulate(fitted), sign)


def _rising(weeks: Floats, knots: Floats, degree: int) -> Floats:
    """Returns functions whose sums with non-negative factors never fall: ± a constant, and sums of B-splines."""
    splines = BSpline.design_matrix(weeks, knots, degree).toarray()
    steps = np.cumsum(splines[:, :0:-1], axis=1)
    return np.column_stack([np.ones(len(weeks)), -np.ones(len(weeks)), steps])


def estimate_age(curve: AgeCurve, value: float, noise: float) -> AgeEstimate:
    """Returns the week at which the curve has the value, between those at which it has value ∓ noise.

    Where the curve is level the middle of that part is taken. A value beyond an end by more than the noise is outside;
    its week is that of the end. A NaN value gives NaN.
    """
    if np.isnan(value):
        return AgeEstimate(np.nan, np.nan, np.nan, "", False)
    risen = curve.sign * value
    low, _ = _level_part(curve, risen - noise)
    first, last = _level_part(curve, risen)
    _, high = _level_part(curve, risen + noise)
    below, above = risen < curve.values[0] - noise, risen > curve.values[-1] + noise
    slack = ROUNDING * float(np.abs(curve.values).max())
    clipped = risen - noise < curve.values[0] - slack or risen + noise > curve.values[-1] + slack
    outside = "younger" if below else "older" if above else ""
    return AgeEstimate(0.5 * (first + last), low, high, outside, bool(clipped))


def _level_part(curve: AgeCurve, risen: float) -> tuple[float, float]:
    """Returns the first and the last week at which the curve has a value (times its sign), or the nearest end twice."""
    slack = ROUNDING * float(np.abs(curve.values).max())
    end = len(curve.weeks) - 1
    first = min(int(np.searchsorted(curve.values, risen - slack, side="left")), end)
    last = max(int(np.searchsorted(curve.values, risen + slack, side="right")) - 1, 0)
    # between two points of the grid `last` is the one before `first`
    a, b = sorted((float(curve.weeks[first]), float(curve.weeks[last])))
    return a, b


def leave_one_week_out(weeks: Floats, values: Floats) -> LeftOut:
    """Returns how well a metric gives the age of brains of three weeks or more, each week left out in turn."""
    errors, guesses, differences = [], [], []
    for week in np.unique(weeks)[1:-1]:
        out = weeks == week
        curve = age_curve(weeks[~out], values[~out])
        expected = curve.sign * np.interp(week, curve.weeks, curve.values)
        for value in values[out]:
            errors.append(estimate_age(curve, value, 0.0).week - week)
            guesses.append(0.5 * (curve.weeks[0] + curve.weeks[-1]) - week)
            differences.append(value - expected)
    return LeftOut(
        error_gw=max(float(np.sqrt(np.mean(np.square(errors)))), LEAST_ERROR_GW),
        guess_gw=max(float(np.sqrt(np.mean(np.square(guesses)))), LEAST_ERROR_GW),
        noise=float(np.sqrt(np.mean(np.square(differences)))),
        number=len(errors),
    )
