"""Which week of the reference brains a brain looks like, by each metric and by all of them together."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ..errors import InputError
from .age_curve import AgeCurve, AgeEstimate, age_curve, estimated_age, leave_one_week_out
from .age_metrics import BRAIN, comparable_metrics

LEAST_WEEKS = 5
"""Weeks of reference brains that a profile needs: when one is left out, of four others two have neighbours."""

TOGETHER = {"all": None, "all without size": False, "size alone": True}
"""The combinations of metrics: which of those of size (True) and free of size (False) each takes, None for both."""

SPREAD = (0.16, 0.84)
"""The shares of the weight of metrics between which the range of a combination lies; as ± one standard deviation."""

NO_SIGNAL, NOT_MEASURED, DISAGREE, INSIDE = "no age signal", "not measured", "metrics disagree", "ok"

WIDE = 0.5
"""A combination whose range spans more than this share of the reference's weeks is flagged."""


def age_profile(metrics: pd.DataFrame, spectra: pd.DataFrame, reference: Sequence[str]) -> pd.DataFrame:
    """Returns the ages that all brains but the reference look like.

    Per metric and hemisphere, a monotone curve is put through the reference brains (`age_curve.age_curve`) and read
    backwards. Together they give the median of the metrics' ages, weighted by what each has shown to know about age
    on reference weeks left out one at a time (`age_curve.LeftOut.weight`).

    Parameters
    ----------
    metrics : columns subject, run, week, hemisphere, metric, value, unit
    spectra : columns subject, run, week, hemisphere, band, complete, resolved
    reference
        The measured brains (subject, of run "real") that curves are put through, of five or more weeks.

    Returns
    -------
    DataFrame
        subject, run, week, hemisphere, metric (one of `TOGETHER` for combinations), kind (size, size-free or together),
        estimated_week, low, high (GW; a metric's noise, or the spread of the metrics), weight (share of the weight of
        all metrics; of a combination, the share of its weight that could be measured), flag (such as "younger than
        21", "older than 29"; "no age signal", "not measured"; "metrics disagree" where their spread spans over half
        of the reference's weeks; else "ok").

    InputError where there are too few reference brains.
    """
    values = comparable_metrics(metrics, spectra, reference)
    known = values[values["reference"]]
    _check(known)
    return _profile(known, values[~values["reference"]])


def age_profile_check(metrics: pd.DataFrame, spectra: pd.DataFrame, reference: Sequence[str]) -> pd.DataFrame:
    """Returns the profiles of the reference brains, each made with all brains of its week left out.

    Curves, noise and weights are all found anew without that week, so nothing of a brain's own week is in its age.

    Parameters
    ----------
    metrics, spectra, reference
        As for `age_profile`.

    Returns
    -------
    DataFrame
        As of `age_profile`, and error (estimated_week − week, GW), inside (whether there are younger and older
        reference brains; without them a brain's age can only be that of the nearest end), mean_absolute_error (GW) of
        the metric over brains inside, guess_error (GW), that of the guess that each is of the middle week.
    """
    values = comparable_metrics(metrics, spectra, reference)
    known = values[values["reference"]]
    _check(known)
    weeks = np.sort(known["week"].unique())
    table = pd.concat(
        [_profile(known[known["week"] != week], known[known["week"] == week]) for week in weeks], ignore_index=True
    )
    table["error"] = table["estimated_week"] - table["week"]
    table["inside"] = table["week"].between(weeks[0], weeks[-1], inclusive="neither")
    inside = table[table["inside"]]
    inside = inside.assign(
        mean_absolute_error=inside["error"].abs(), guess_error=(inside["week"] - weeks[[0, -1]].mean()).abs()
    )
    means = inside.groupby(["hemisphere", "metric"])[["mean_absolute_error", "guess_error"]].mean()
    return table.join(means, on=["hemisphere", "metric"])


def _check(known: pd.DataFrame) -> None:
    weeks = sorted(known["week"].unique())
    if len(weeks) < LEAST_WEEKS:
        raise InputError(
            "too few reference brains for an age profile",
            found=f"weeks {', '.join(f'{week:g}' for week in weeks) or 'none'}",
            expected=f"{LEAST_WEEKS} weeks or more",
        )


@dataclass(frozen=True, eq=False)
class _Calibration:
    """What the reference brains say of one metric of one hemisphere; the weight is a share of that of all metrics."""

    metric: str
    of_size: bool
    curve: AgeCurve
    noise: float
    weight: float


def _profile(known: pd.DataFrame, brains: pd.DataFrame) -> pd.DataFrame:
    """Returns the ages that brains look like by the known ones, with the columns of `age_profile`."""
    ends = float(known["week"].min()), float(known["week"].max())
    calibrated = {str(hemisphere): _calibrations(rows) for hemisphere, rows in known.groupby("hemisphere", sort=False)}
    rows = [
        (*side, *row)
        for side, measured in brains.groupby([*BRAIN, "hemisphere"], sort=False)
        for row in _ages(calibrated[str(side[-1])], measured.set_index("metric")["value"], ends)
    ]
    columns = [*BRAIN, "hemisphere", "metric", "kind", "estimated_week", "low", "high", "weight", "flag"]
    return pd.DataFrame(rows, columns=columns)


def _calibrations(known: pd.DataFrame) -> list[_Calibration]:
    series = {
        str(metric): (
            rows["week"].to_numpy(dtype=float),
            rows["value"].to_numpy(dtype=float),
            bool(rows["size"].iloc[0]),
        )
        for metric, rows in known.groupby("metric", sort=False)
    }
    skills = {metric: leave_one_week_out(weeks, values) for metric, (weeks, values, _) in series.items()}
    total = sum(skill.weight for skill in skills.values()) or 1.0
    return [
        _Calibration(metric, of_size, age_curve(weeks, values), skills[metric].noise, skills[metric].weight / total)
        for metric, (weeks, values, of_size) in series.items()
    ]


def _ages(
    calibrations: list[_Calibration], measured: pd.Series, ends: tuple[float, float]
) -> Iterator[tuple[str, str, float, float, float, float, str]]:
    """Yields metric, kind, estimated_week, low, high, weight and flag, for the metrics and for combinations of them."""
    said = {"younger": f"younger than {ends[0]:g}", "older": f"older than {ends[1]:g}", "": INSIDE}
    ages = [(c, estimated_age(c.curve, float(measured.get(c.metric, np.nan)), c.noise)) for c in calibrations]
    for metric, age in ages:
        flag = NOT_MEASURED if np.isnan(age.week) else said[age.outside] if metric.weight else NO_SIGNAL
        yield metric.metric, "size" if metric.of_size else "size-free", age.week, age.low, age.high, metric.weight, flag
    for name, wanted in TOGETHER.items():
        chosen = [(age, metric.weight) for metric, age in ages if wanted in (None, metric.of_size) and metric.weight]
        together, share = _together([pair for pair in chosen if not np.isnan(pair[0].week)])
        flag = said[together.outside] if share else NOT_MEASURED if chosen else NO_SIGNAL
        if flag == INSIDE and together.high - together.low > WIDE * (ends[1] - ends[0]):
            flag = DISAGREE
        full = sum(weight for _, weight in chosen)
        yield name, "together", together.week, together.low, together.high, share / full if full else 0.0, flag


def _together(ages: list[tuple[AgeEstimate, float]]) -> tuple[AgeEstimate, float]:
    """Returns the weighted median of ages with their spread, and the sum of the weights.

    A median, since of ages outside the reference only the side is known. It is outside where over half the weight is.
    """
    if not ages:
        return AgeEstimate(np.nan, np.nan, np.nan, ""), 0.0
    ages = sorted(ages, key=lambda pair: pair[0].week)
    weights = np.array([weight for _, weight in ages])
    middle = (np.cumsum(weights) - 0.5 * weights) / weights.sum()
    low, week, high = np.interp([SPREAD[0], 0.5, SPREAD[1]], middle, [age.week for age, _ in ages])
    for side in ("younger", "older"):
        if sum(weight for age, weight in ages if age.outside == side) > 0.5 * weights.sum():
            return AgeEstimate(week, low, high, side), float(weights.sum())
    return AgeEstimate(week, low, high, ""), float(weights.sum())
