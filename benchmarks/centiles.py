"""Measure how many new normal subjects norms call extreme, in cohorts drawn from known
curves.

Of new subjects in the first, an inner and the last week of a norm, 5 % should be below
the 5th centile, 5 % above the 95th and 1 % below the 1st. Prints these shares in per
cent by case and number of subjects, then one line of JSON. Of norms that say that they
are skewed, the first two shares are those beyond the 10th and 90th centile, in a row of
their own with the number of cohorts. Of a case with outliers: the share of these that
`outlying_brains` names, and of cohorts of which it names another subject.

--members scores the subjects of the norms themselves instead, as `measured_scores`
does: each against the others. Their thirds of the weeks take the place of the three
weeks.
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import stats

from gyriflow.geometry.triangles import Floats
from gyriflow.metrics.lms import fit_norm
from gyriflow.metrics.norms import cohort_norms, measured_scores, outlying_brains
from gyriflow.settings.terms import OBSERVED

FIRST, LAST = 21.0, 37.0
SIZES = (10, 15, 20, 29, 30, 60, 100, 200, 500)
LIMITS = stats.norm.ppf([0.05, 0.95, 0.01])
SKEWED_LIMITS = stats.norm.ppf([0.1, 0.9, 0.01])
SUBJECT_Z = stats.norm.ppf((np.arange(1000) + 0.5) / 1000)
"""z of the new subjects of a week, evenly spread over their distribution."""
PLACES = {"first": 0.0, "inner": 0.5, "last": 1.0}


def volume(weeks: Floats) -> Floats:
    """Return a mean volume in mL that grows by Gompertz' law, by 17 % in the first week
    and 3 % in the last."""
    return 400 * np.exp(-np.exp((25 - weeks) / 9))


def sigmoid(weeks: Floats) -> Floats:
    """Return a rise from 0.02 to 0.98 over the weeks."""
    return 1 / (1 + np.exp(-(weeks - 29) / 2))


def any_week(random: np.random.Generator, subjects: int) -> Floats:
    """Return weeks of subjects, spread evenly."""
    return random.uniform(FIRST, LAST, subjects)


def whole_weeks(random: np.random.Generator, subjects: int) -> Floats:
    """Return whole weeks of subjects."""
    return random.integers(FIRST, LAST + 1, subjects).astype(float)


def uneven_weeks(random: np.random.Generator, subjects: int) -> Floats:
    """Return weeks of subjects, half of them in the last quarter."""
    return FIRST + (LAST - FIRST) * random.beta(2.0, 1.0, subjects)


@dataclass(frozen=True)
class Case:
    """Values of subjects by week and z, their weeks, and the smallest number of
    subjects that is asked for.

    `outliers` is the share of subjects of the cohort whose value is six tenths.
    """

    values: Callable[[Floats, Floats], Floats]
    weeks: Callable[[np.random.Generator, int], Floats] = any_week
    is_positive: bool = True
    scans: int = 1
    min_subjects: int = 10
    outliers: float = 0.0


def _constant_cv(weeks: Floats, z: Floats) -> Floats:
    return volume(weeks) * (1 + 0.08 * z)


CASES = {
    "constant CV": Case(_constant_cv),
    "constant SD": Case(lambda weeks, z: volume(weeks) + 8 * z),
    "spread grows tenfold": Case(
        lambda weeks, z: (
            1.02 + 0.5 * sigmoid(weeks) + (0.005 + 0.045 * sigmoid(weeks)) * z
        ),
        min_subjects=30,
    ),
    "skewed": Case(lambda weeks, z: volume(weeks) * np.exp(0.25 * z)),
    "signed": Case(
        lambda weeks, z: 0.1 * (weeks - 29) + (0.5 + 0.05 * (weeks - FIRST)) * z,
        is_positive=False,
    ),
    "strongly skewed": Case(lambda weeks, z: volume(weeks) * np.exp(0.5 * z)),
    "skewed left": Case(
        lambda weeks, z: volume(weeks) * (1.1 - 0.1 * np.exp(-0.5 * z)),
        min_subjects=30,
    ),
    "signed and skewed": Case(
        lambda weeks, z: (
            0.1 * (weeks - 29) + (0.5 + 0.05 * (weeks - FIRST)) * (np.exp(0.5 * z) - 1)
        ),
        is_positive=False,
        min_subjects=30,
    ),
    "5 % outliers": Case(_constant_cv, outliers=0.05, min_subjects=60),
    "whole weeks": Case(_constant_cv, whole_weeks),
    "uneven weeks": Case(_constant_cv, uneven_weeks),
    "two scans": Case(_constant_cv, scans=2),
}
"""The cases. Of two scans of a subject, one is any time after the other, and z
correlates by 0.8."""


def drawn(
    case: Case, subjects: int, random: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Return the weeks, the values and the subjects' numbers of the scans of a
    cohort."""
    weeks = np.concatenate([case.weeks(random, subjects) for _ in range(case.scans)])
    own = random.standard_normal((2, subjects))
    scan = random.standard_normal(len(weeks))
    z = (
        np.sqrt(0.8) * np.tile(own[0], case.scans) + np.sqrt(0.2) * scan
        if case.scans > 1
        else own[0]
    )
    values = case.values(weeks, z)
    values[: round(case.outliers * len(values))] *= 0.6
    return weeks, values, np.tile(np.arange(subjects), case.scans)


def shares(z: Floats, limits: Floats = LIMITS) -> Floats:
    """Return the shares of scores in per cent below the first limit, above the second
    and below the third."""
    z = z[np.isfinite(z)]
    low, high, lowest = limits
    return 100 * np.array([(z <= low).mean(), (z >= high).mean(), (z <= lowest).mean()])


def new_subjects(
    case: Case, subjects: int, cohorts: int, seed: int, beyond: float = 0.0
) -> dict[str, list[float]]:
    """Return the `shares` of new subjects at the places of the norm, mean of cohorts;
    "skewed, PLACE" are those of norms that are skewed.

    With `beyond`, they are so many weeks before the first and after the last week of
    the norm.
    """
    random = np.random.default_rng((seed, subjects))
    found: dict[str, list[Floats]] = {}
    for _ in range(cohorts):
        weeks, values, numbers = drawn(case, subjects, random)
        norm = fit_norm(weeks, values, numbers, is_positive=case.is_positive)
        limits = SKEWED_LIMITS if norm.is_skewed else LIMITS
        for name, place in PLACES.items():
            week = weeks.min() + place * np.ptp(weeks) + beyond * np.sign(place - 0.5)
            at = np.full(len(SUBJECT_Z), week)
            z, _ = norm.scores(at, case.values(at, SUBJECT_Z))
            key = f"skewed, {name}" if norm.is_skewed else name
            found.setdefault(key, []).append(shares(z, limits))
    result = {}
    for key, each in found.items():
        result[key] = [*np.mean(each, axis=0).round(1).tolist(), len(each)]
    return result


def named(case: Case, subjects: int, cohorts: int, seed: int) -> tuple[float, float]:
    """Return the share of a cohort's outliers that are named, in per cent, and that of
    cohorts of which another subject is."""
    random = np.random.default_rng((seed, subjects))
    count = round(case.outliers * subjects)
    n_found = 0
    n_wrong = 0
    for _ in range(cohorts):
        weeks, values, _ = drawn(case, subjects, random)
        table, names = as_table(case, weeks, values)
        found = outlying_brains(table, names, cohort_norms(table, names)).keys()
        n_found += len(found & set(names[:count]))
        n_wrong += bool(found - set(names[:count]))
    return 100 * n_found / max(count * cohorts, 1), 100 * n_wrong / cohorts


def as_table(
    case: Case, weeks: Floats, values: Floats
) -> tuple[pd.DataFrame, list[str]]:
    """Return the table of a metric of scans, and their names."""
    names = [f"s{scan}" for scan in range(len(weeks))]
    metric, unit = ("area", "cm2") if case.is_positive else ("mean_shape_index", "1")
    scans = {"subject": names, "run": OBSERVED, "week": weeks, "hemisphere": "whole"}
    measured = {"metric": metric, "value": values, "unit": unit}
    return pd.DataFrame(scans | measured), names


def members(
    case: Case, subjects: int, cohorts: int, seed: int
) -> dict[str, list[float]]:
    """Return the `shares` of the norms' own subjects, each against the others, by third
    of the weeks."""
    random, found = np.random.default_rng((seed, subjects)), []
    for _ in range(cohorts):
        weeks, values, numbers = drawn(case, subjects, random)
        table, names = as_table(case, weeks, values)
        table = table.assign(person=[f"p{number}" for number in numbers])
        found.append(
            measured_scores(table, names, cohort_norms(table, names))[["week", "z"]]
        )
    scores = pd.concat(found)
    third = ((scores["week"] - FIRST) / (LAST - FIRST) * 3).astype(int).clip(0, 2)
    return {
        name: shares(scores.loc[third == k, "z"].to_numpy()).round(1).tolist()
        for k, name in enumerate(PLACES)
    }


def print_row(
    name: str,
    subjects: int,
    nominal: float,
    found: dict[str, list[float]],
    prefix: str,
) -> None:
    """Print the shares at the places with a prefix, if there are any, with a star for
    each that is half of the nominal one or more away from it."""
    rows = [found[key] for place in PLACES if (key := prefix + place) in found]
    if not rows:
        return
    below, above, lowest, *cohorts = zip(*rows, strict=True)
    wrong = sum(abs(share - nominal) > nominal / 2 for share in (*below, *above))
    wrong += sum(share > 2.5 for share in lowest)
    parts = []
    for part in (below, above, lowest):
        parts.append("  ".join(f"{share:5.1f}" for share in part))
    count = f"  {cohorts[0][0]} cohorts" if cohorts else ""
    print(
        f"{name:28}{subjects:4}  " + "  |".join(parts) + f"{count}  {'*' * wrong}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cohorts", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES, metavar="N")
    parser.add_argument(
        "--cases", nargs="+", default=list(CASES), choices=CASES, metavar="CASE"
    )
    parser.add_argument(
        "--members", action="store_true", help="score the subjects of the norms"
    )
    parser.add_argument(
        "--beyond",
        type=float,
        default=0.0,
        metavar="GW",
        help="weeks before the first and after the last week",
    )
    options = parser.parse_args()
    result: dict[str, dict[int, dict[str, list[float]]]] = {}
    for name in options.cases:
        case = CASES[name]
        for subjects in (size for size in options.sizes if size >= case.min_subjects):
            arguments = (case, subjects, options.cohorts, options.seed)
            found = (
                members(*arguments)
                if options.members
                else new_subjects(*arguments, options.beyond)
            )
            result.setdefault(name, {})[subjects] = found
            print_row(name, subjects, 5.0, found, "")
            print_row(f"… skewed, {name}", subjects, 10.0, found, "skewed, ")
            if case.outliers and not options.members:
                share, wrong = named(*arguments)
                print(f"  outliers named: {share:.0f} %, others in {wrong:.0f} %")
    print(json.dumps({"cohorts": options.cohorts, "shares": result}))


if __name__ == "__main__":
    main()
