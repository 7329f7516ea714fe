"""Which week of the reference brains a brain looks like, by each metric and by all of them together."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ..errors import InputError
from .age_curve import AgeCurve, AgeEstimate, age_curve, estimate_age, leave_one_week_out, weights
from .age_metrics import BRAIN, comparable_metrics, family

LEAST_WEEKS = 5
"""Weeks of reference brains that a profile needs: when one is left out, of four others two have neighbours."""

TOGETHER = {"all": None, "all without size": False, "size alone": True}
"""The combinations of metrics: which of those of size (True) and free of size (False) each takes, None for both."""

SPREAD = (0.16, 0.84)
"""The shares of the weight of metrics between which the spread of a combination lies; as ± one standard deviation."""

NO_SIGNAL, NOT_MEASURED, DISAGREE, INSIDE = "no age signal", "not measured", "metrics disagree", "ok"
FOLLOWED, CLIPPED = "growth follows it", "range cut at the end"

WIDE = 0.5
"""A combination whose spread spans more than this share of the reference's weeks is flagged."""

Followed = Mapping[str, Sequence[str]]


def age_profile(
    metrics: pd.DataFrame,
    spectra: pd.DataFrame,
    reference: Sequence[str],
    check: pd.DataFrame,
    *,
    followed: Followed | None = None,
) -> pd.DataFrame:
    """Returns the ages that all brains but the reference look like.

    Per metric and hemisphere, a monotone curve is put through the reference brains (`age_curve.age_curve`) and read
    backwards. Together they give the median of the metrics' ages, weighted by what each has shown to know about age
    on reference weeks left out one at a time (`age_curve.weights`); metrics of one family share its weight, since
    they say much the same.

    Parameters
    ----------
    metrics : columns subject, run, week, hemisphere, metric, value, unit
    spectra : columns subject, run, week, hemisphere, band, complete, resolved
    reference
        The measured brains (subject, of run "real") that curves are put through, of five or more weeks.
    check
        What `age_profile_check` has found of the same reference: how far the combinations are off.
    followed
        By run the metrics that its growth was made to follow, such as area and volume. They say of the run's age what
        was put in, and so do they divided by lengths; they take no part in its combinations.

    Returns
    -------
    DataFrame
        subject, run, week, hemisphere, metric (one of `TOGETHER` for combinations), kind (size, size-free or together),
        estimated_week, low, high (GW; of a metric its noise, of a combination ± its root mean square error on reference
        brains left out), spread_low, spread_high (GW; of a combination, between which the middle 68 % of the weight
        lies), weight (share of the weight of all metrics; of a combination, the share of its weight that could be
        measured), flag (such as "younger than 21", "older than 29"; "range cut at the end" where age or range reach
        an end of the reference; "no age signal", "not measured", "growth follows it"; "metrics disagree" where their
        spread spans over half of the reference's weeks; else "ok"), brains_per_week (reference brains: with 1, nothing
        is known of how brains of one age differ, and no range holds for a single fetus).

    InputError where there are too few reference brains.
    """
    values = comparable_metrics(metrics, spectra, reference)
    known = values[values["reference"]]
    _check(known)
    table = _profile(known, values[~values["reference"]], followed or {})
    inside = check[check["inside"] & (check["kind"] == "together")]
    errors = inside.groupby(["hemisphere", "metric"])["error"].agg(lambda error: float(np.sqrt(np.mean(error**2))))
    error = table[["hemisphere", "metric"]].join(errors, on=["hemisphere", "metric"])["error"]
    together = table["kind"] == "together"
    table.loc[together, "low"] = table["estimated_week"] - error
    table.loc[together, "high"] = table["estimated_week"] + error
    return table


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
        As of `age_profile`, but low and high of a combination are its spread; and error (estimated_week − week, GW),
        inside (whether there are younger and older reference brains; without them a brain's age can only be that of
        the nearest end), mean_absolute_error (GW) of the metric over brains inside, guess_error (GW), that of the
        guess that each is of the middle week.
    """
    values = comparable_metrics(metrics, spectra, reference)
    known = values[values["reference"]]
    _check(known)
    weeks = np.sort(known["week"].unique())
    table = pd.concat(
        [_profile(known[known["week"] != week], known[known["week"] == week], {}) for week in weeks],
        ignore_index=True,
    )
    table["error"] = table["estimated_week"] - table["week"]
    table["inside"] = table["week"].between(weeks[0], weeks[-1], inclusive="neither")
    inside = table[table["inside"]]
    inside = inside.assign(
        mean_absolute_error=inside["error"].abs(), guess_error=(inside["week"] - weeks[[0, -1]].mean()).abs()
    )
    means = inside.groupby(["hemisphere", "metric"])[["mean_absolute_error", "guess_error"]].mean()
    return table.join(means, on=["hemisphere", "metric"])


def week_similarity(
    metrics: pd.DataFrame, spectra: pd.DataFrame, reference: Sequence[str], *, followed: Followed | None = None
) -> pd.DataFrame:
    """Returns how similar each brain is to the reference at each of its weeks, between 0 and 1.

    The similarity is the mean of exp(−z²/2) over the metrics that predict age, families weighted alike, with z the
    difference from the metric's curve at that week over its noise: the form of FetoMorph's GASP
    (github.com/SaeedZarzor/FetoMorph, `compute_similarity_scores`, "gaussian"), which has the mean and the standard
    deviation of many brains of a week in place of curve and noise. Unlike an age, it says when a brain looks like no
    week at all.

    Parameters
    ----------
    metrics, spectra, reference, followed
        As for `age_profile`. Reference brains are compared with curves through all of them, themselves included.

    Returns
    -------
    DataFrame
        subject, run, week, hemisphere, reference_week, similarity, metrics (their number).
    """
    values = comparable_metrics(metrics, spectra, reference)
    known = values[values["reference"]]
    _check(known)
    weeks = np.sort(known["week"].unique())
    rows = []
    for hemisphere, brains in values.groupby("hemisphere", sort=False):
        calibrations = [c for c in _calibrations(known[known["hemisphere"] == hemisphere]) if c.weight]
        for brain, measured in brains.groupby(BRAIN, sort=False):
            found = measured.set_index("metric")["value"]
            used = [
                c
                for c in calibrations
                if c.metric in found.index and not _is_followed(c.metric, (followed or {}).get(str(brain[1]), ()))
            ]
            shares = pd.Series([family(c.metric) for c in used], dtype=object)
            share = 1.0 / shares.map(shares.value_counts()).to_numpy(dtype=float)
            for week in weeks:
                z = [(float(found[c.metric]) - c.at(week)) / (c.noise or 1.0) for c in used]
                similar = np.average(np.exp(-0.5 * np.square(z)), weights=share) if used else np.nan
                rows.append((*brain, hemisphere, week, float(similar), len(used)))
    return pd.DataFrame(rows, columns=[*BRAIN, "hemisphere", "reference_week", "similarity", "metrics"])


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

    def at(self, week: float) -> float:
        """Returns the value of the curve at a week."""
        return float(self.curve.sign * np.interp(week, self.curve.weeks, self.curve.values))


def _is_followed(metric: str, followed: Sequence[str]) -> bool:
    return metric.removesuffix("_scaled") in followed


def _profile(known: pd.DataFrame, brains: pd.DataFrame, followed: Followed) -> pd.DataFrame:
    """Returns the ages that brains look like by the known ones, with the columns of `age_profile`."""
    ends = float(known["week"].min()), float(known["week"].max())
    calibrated = {str(hemisphere): _calibrations(rows) for hemisphere, rows in known.groupby("hemisphere", sort=False)}
    rows = [
        (*side, *row)
        for side, measured in brains.groupby([*BRAIN, "hemisphere"], sort=False)
        for row in _ages(
            calibrated[str(side[-1])], measured.set_index("metric")["value"], ends, followed.get(str(side[1]), ())
        )
    ]
    columns = [*BRAIN, "hemisphere", "metric", "kind", "estimated_week", "low", "high"]
    columns += ["spread_low", "spread_high", "weight", "flag"]
    number = int(known.groupby("week")["subject"].nunique().min())
    return pd.DataFrame(rows, columns=columns).assign(brains_per_week=number)


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
    weight = pd.Series(weights(list(skills.values())), index=list(skills))
    families = pd.Series([family(metric) for metric in weight.index], index=weight.index)
    # a family has the mean weight of its metrics that predict age, however many there are
    weight /= weight.gt(0).groupby(families).transform("sum").clip(lower=1)
    weight /= weight.sum() or 1.0
    return [
        _Calibration(metric, of_size, age_curve(weeks, values), skills[metric].noise, float(weight[metric]))
        for metric, (weeks, values, of_size) in series.items()
    ]


def _ages(
    calibrations: list[_Calibration], measured: pd.Series, ends: tuple[float, float], followed: Sequence[str]
) -> Iterator[tuple[str, str, float, float, float, float, float, float, str]]:
    """Yields a row of `age_profile` from metric on, for the metrics and for combinations of them."""
    said = {"younger": f"younger than {ends[0]:g}", "older": f"older than {ends[1]:g}", "": INSIDE}
    ages = [(c, estimate_age(c.curve, float(measured.get(c.metric, np.nan)), c.noise)) for c in calibrations]
    for metric, age in ages:
        flag = NO_SIGNAL if not metric.weight else CLIPPED if age.clipped and not age.outside else said[age.outside]
        flag = FOLLOWED if _is_followed(metric.metric, followed) else NOT_MEASURED if np.isnan(age.week) else flag
        kind = "size" if metric.of_size else "size-free"
        yield metric.metric, kind, age.week, age.low, age.high, np.nan, np.nan, metric.weight, flag
    for name, wanted in TOGETHER.items():
        chosen = [
            (age, metric.weight)
            for metric, age in ages
            if wanted in (None, metric.of_size) and metric.weight and not _is_followed(metric.metric, followed)
        ]
        together, share = _together([pair for pair in chosen if not np.isnan(pair[0].week)])
        flag = said[together.outside] if share else NOT_MEASURED if chosen else NO_SIGNAL
        if flag == INSIDE and together.clipped:
            flag = CLIPPED
        if flag in (INSIDE, CLIPPED) and together.high - together.low > WIDE * (ends[1] - ends[0]):
            flag = DISAGREE
        full = sum(weight for _, weight in chosen)
        low, high = together.low, together.high
        yield name, "together", together.week, low, high, low, high, share / full if full else 0.0, flag


def _together(ages: list[tuple[AgeEstimate, float]]) -> tuple[AgeEstimate, float]:
    """Returns the weighted median of ages with their spread, and the sum of the weights.

    A median, since of ages outside the reference only the side is known. It is outside where over half the weight is,
    and clipped where over half the weight is outside or clipped.
    """
    if not ages:
        return AgeEstimate(np.nan, np.nan, np.nan, "", False), 0.0
    ages = sorted(ages, key=lambda pair: pair[0].week)
    shares = np.array([weight for _, weight in ages])
    middle = (np.cumsum(shares) - 0.5 * shares) / shares.sum()
    low, week, high = np.interp([SPREAD[0], 0.5, SPREAD[1]], middle, [age.week for age, _ in ages])
    clipped = sum(weight for age, weight in ages if age.clipped) > 0.5 * shares.sum()
    for side in ("younger", "older"):
        if sum(weight for age, weight in ages if age.outside == side) > 0.5 * shares.sum():
            return AgeEstimate(week, low, high, side, True), float(shares.sum())
    return AgeEstimate(week, low, high, "", bool(clipped)), float(shares.sum())
