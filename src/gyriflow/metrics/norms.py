"""Norms of published curves and of measured brains over gestational weeks, and the
scores of brains against them."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import ndtr, ndtri

from ..geometry.triangles import Floats
from ..quantities import METRICS
from ..settings.schemes import LabelScheme
from ..settings.terms import OBSERVED, SIDES, SPREAD_UNKNOWN, Side, min_norm_subjects
from .lms import WeeklyNorm, fit_norm
from .tables import BRAIN

QUANTILES = {
    "q05": 0.05,
    "q25": 0.25,
    "q50": 0.5,
    "q75": 0.75,
    "q95": 0.95,
}
"""The quantiles that norms give, by the names of their columns."""
WINDOW_GW = 0.5
"""Brains are scored up to this long before the norm's first week and after its last."""
FEW_SUBJECTS, FEW_CENTILES = 30, (5.0, 95.0)
"""With fewer subjects, centiles end at these, and norms without one of them are fitted
again."""
SKEWED_CENTILES = (10.0, 90.0)
"""Ends of the centiles of skewed norms, whose subjects are too few to know how much."""
SUSPECT_Z, OUTLIER_Z = 3.0, 5.0
"""Distances of a reference brain from the norm, in robust standard deviations: from
which the norm is fitted again without it, and from which it is warned of then."""
MAX_ONE_STEP_Z = 1.5
"""Other norms are fitted again without a subject that is beyond this z or has several
scans; else it is removed by one Newton step."""
MIN_SPREAD = 1e-6
"""Smallest spread of a norm over its values for which there are scores."""
CURVE_POINTS = 41
"""Number of points of a norm's curve."""
OTHER_SIDES = "other hemispheres"
"""Flag of a brain whose hemispheres are not those of the reference brains."""
SCORES = (
    "expected",
    "sd",
    "z",
    "z_low",
    "z_high",
    "centile",
    "centile_low",
    "centile_high",
    "brains",
    "flag",
)
"""Columns of `measured_scores` that follow the value and its unit."""


@dataclass(frozen=True)
class PublishedNorm:
    """A published curve: mean and standard deviation as polynomials of the week,
    highest power first.

    It is valid from the first to the last of `weeks`. The volumes are those of `labels`
    of a label `scheme`, in `subjects` brains (None if the source does not give their
    number). `tissue` is the closest field of `LabelScheme` for brains of other schemes
    ("" if no field is close); `side` is the structure's hemisphere, None if it is in
    both.
    """

    mean: Sequence[float]
    sd: Sequence[float]
    weeks: Sequence[float]
    labels: Sequence[int]
    unit: str
    subjects: int | None
    scheme: str = ""
    tissue: str = ""
    side: Side | None = None


def published_norms(data: Mapping[str, Any]) -> dict[str, PublishedNorm]:
    """Return the norms of a file of `norms/`, by structure."""
    shared = {
        key: data[key] for key in ("weeks", "unit", "subjects", "scheme") if key in data
    }
    return {
        name: PublishedNorm(**shared, **entry)
        for name, entry in data["structures"].items()
    }


@dataclass(frozen=True)
class LabelledBrain:
    """A measured brain, the volume in mL of each of its labels, and the label
    scheme."""

    subject: str
    week: float
    sides: Sequence[Side]
    scheme: LabelScheme
    volumes: Mapping[int, float]


def _published_scores(
    brain: LabelledBrain, norms: Mapping[str, PublishedNorm]
) -> pd.DataFrame:
    rows = []
    for name, norm in norms.items():
        is_same = norm.scheme == brain.scheme.name
        labels = (
            norm.labels
            if is_same
            else getattr(
                brain.scheme,
                norm.tissue,
                (),
            )
        )
        value = sum(brain.volumes.get(label, 0.0) for label in labels)
        if value <= 0:
            continue
        flag = "ok" if is_same else "other labels"
        if len(brain.sides) < len(SIDES) and norm.side not in brain.sides:
            flag = "one hemisphere"
        elif not norm.weeks[0] <= brain.week <= norm.weeks[1]:
            flag = "outside the norm's weeks"
        row = {
            "structure": name,
            "value": value,
            "unit": norm.unit,
            "brains": norm.subjects,
            "flag": flag,
        }
        if flag in {"ok", "other labels"}:
            expected, sd = (
                float(np.polyval(np.array(curve), brain.week))
                for curve in (norm.mean, norm.sd)
            )
            z = (value - expected) / sd
            row |= {
                "expected": expected,
                "sd": sd,
                "z": z,
                "centile": 100 * ndtr(z),
            }
        rows.append(row)
    columns = [
        "structure",
        "week",
        "value",
        "unit",
        "expected",
        "sd",
        "z",
        "centile",
        "brains",
        "flag",
    ]
    table = pd.DataFrame(rows, columns=["subject", *columns]).astype({"brains": float})
    return table.assign(subject=brain.subject, week=brain.week)


def volume_tables(
    brains: Sequence[LabelledBrain], norms: Mapping[str, PublishedNorm]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the volumes of all labels of brains, and the scores of their structures'
    volumes against published norms.

    With another label scheme than the norm's, a structure is the scheme's tissue that
    is closest to it, such as the cortex. A structure without voxels, or without labels
    in the scheme, is left out.

    Columns of volumes: subject, run ("observed"), week, label, tissue, volume_mL; of
    scores: subject, structure, week, value, unit, expected, sd, z = (value −
    expected)/sd, centile (of the normal distribution, 0 to 100), brains (in the norm;
    NaN if its source does not give their number), flag ("ok"; "other labels": the norm
    was measured with another label scheme; "outside the norm's weeks"; "one hemisphere"
    if the brain lacks a hemisphere of the norm). Expected, z and centile are NaN with
    the last two flags.
    """
    rows = []
    for brain in brains:
        labels = (brain.subject, OBSERVED, brain.week)
        for label, volume in brain.volumes.items():
            tissue = brain.scheme.labels.get(label, "")
            rows.append((*labels, label, tissue, volume))
    scores = pd.concat(
        [_published_scores(brain, norms) for brain in brains], ignore_index=True
    )
    return pd.DataFrame(
        rows,
        columns=[*BRAIN, "label", "tissue", "volume_mL"],
    ), scores


@dataclass(frozen=True)
class CohortNorms:
    """The norms of a cohort by hemisphere and metric, with their units.

    `made_with` are the settings that the numbers depend on. If the brains are not
    `individuals` but averages, as in an atlas, their scatter is not that of
    individuals.
    """

    norms: Mapping[tuple[str, str], tuple[str, WeeklyNorm]]
    individuals: bool
    made_with: Mapping[str, Any]

    def volumes_by_week(self, weeks: Sequence[float] | Floats) -> dict[float, float]:
        """Return the median volumes of whole brains in mL at those of some weeks that
        the norm has."""
        if ("whole", "volume") not in self.norms:
            return {}
        _, norm = self.norms["whole", "volume"]
        wanted = np.asarray(weeks, dtype=float)
        is_known = (norm.first <= wanted) & (wanted <= norm.last)
        known = wanted[is_known]
        medians = norm.values(known, 0.0)
        return dict(
            zip(
                known.tolist(),
                medians.tolist(),
                strict=True,
            )
        )

    @property
    def plain(self) -> dict[str, Any]:
        """The norms as plain values for JSON."""
        rows = []
        for (hemisphere, metric), (unit, norm) in self.norms.items():
            row = {"hemisphere": hemisphere, "metric": metric, "unit": unit}
            for key, value in asdict(norm).items():
                row[key] = np.asarray(value).tolist()
            rows.append(row)
        subjects = max((norm.subjects for _, norm in self.norms.values()), default=0)
        method = "LMS (Cole and Green 1992); sex and site are ignored"
        facts = {
            "subjects": subjects,
            "individuals": self.individuals,
            "method": method,
        }
        return {**facts, "made_with": dict(self.made_with), "norms": rows}


def cohort_from_plain(content: Mapping[str, Any]) -> CohortNorms:
    """Return the norms that `CohortNorms.plain` gives as plain values."""
    norms = {}
    for row in content["norms"]:
        fields = dict(row)
        name = fields.pop("hemisphere"), fields.pop("metric")
        unit = fields.pop("unit")
        for key in ("location", "scale", "covariance"):
            fields[key] = np.array(fields[key], dtype=float)
        norms[name] = unit, WeeklyNorm(**fields)
    return CohortNorms(norms, content["individuals"], content["made_with"])


def cohort_norms(
    metrics: pd.DataFrame,
    reference: Sequence[str],
    *,
    individuals: bool = True,
    made_with: Mapping[str, Any] | None = None,
) -> CohortNorms:
    """Fit norms to the metrics of reference brains.

    `metrics` has the columns subject (the brain), run, week, hemisphere, metric, value,
    unit, and person (the subject scanned; may be absent if no one was scanned twice).
    All scans of a subject together have the weight of one. Metrics with fewer subjects
    than `min_norm_subjects` have no norm.
    """
    norms = {}
    for name, brains in _by_metric(metrics, reference):
        if brains["person"].nunique() >= min_norm_subjects(individuals=individuals):
            norms[name] = (str(brains["unit"].iloc[0]), _fit(brains, name[1]))
    return CohortNorms(norms, individuals, made_with or {})


def outlying_brains(
    metrics: pd.DataFrame,
    reference: Sequence[str],
    cohort: CohortNorms,
) -> dict[str, list[str]]:
    """Return the reference brains that are far from the norms that were fitted to them,
    and the hemispheres and metrics in which they are.

    They make norms too wide, and others seem usual. Averages are not looked at.
    """
    outlying = defaultdict(list)
    for name, brains in _by_metric(metrics, reference):
        if name not in cohort.norms or not cohort.individuals:
            continue
        _, norm = cohort.norms[name]
        places = brains["week"], brains["value"]
        is_near = np.abs(norm.robust_scores(*places)) < SUSPECT_Z
        if not is_near.all():
            # outliers draw the norm towards themselves
            norm = _fit(brains[is_near], name[1])
        z = norm.robust_scores(*places)
        for brain in brains["subject"][np.abs(z) > OUTLIER_Z]:
            outlying[brain].append(" ".join(name))
    return dict(outlying)


def _fit(brains: pd.DataFrame, metric: str) -> WeeklyNorm:
    values = brains["value"].to_numpy(dtype=float)
    is_positive = not METRICS[metric].is_signed and bool((values > 0).all())
    return fit_norm(
        brains["week"].to_numpy(float),
        values,
        brains["person"],
        is_positive=is_positive,
    )


def measured_scores(
    metrics: pd.DataFrame,
    reference: Sequence[str],
    cohort: CohortNorms,
) -> pd.DataFrame:
    """Return the scores of brains against the norms of reference brains, at each
    brain's own week.

    A brain of the reference is compared with the other subjects. `reference` is empty
    for norms from a file.

    Columns subject, run, week, hemisphere, metric, value, unit, expected (median), sd
    (half the distance between z = −1 and 1), z and centile (0 to 100) as those of a new
    subject with the uncertainty of the norm, z_low, z_high, centile_low, centile_high
    (90 % intervals of those in the population), brains (subjects of the norm), flag:
    "ok"; "few brains" (centiles end at 5 and 95); "skewed" (they end at 10 and 90);
    "not converged" (the fit of the norm); `SPREAD_UNKNOWN` (only expected is
    given); "outside the reference's weeks", "too few brains", "other hemispheres" (than
    the reference), "not positive" (as all values of the norm are) or "no spread" (of
    the norm), whose scores are NaN.
    """
    names = [*BRAIN, "hemisphere", "metric", "value", "unit"]
    by_metric = dict(_by_metric(metrics, reference))
    # the whole of a brain with one hemisphere is that hemisphere: it has half of the
    # volume and area of others
    sides = metrics.groupby(BRAIN)["hemisphere"].transform(
        lambda names: " ".join(sorted(set(names)))
    )
    is_reference = (metrics["run"] == OBSERVED) & metrics["subject"].isin(reference)
    expected = (
        sides[is_reference]
        if len(reference)
        else [" ".join(sorted({side for side, _ in cohort.norms}))]
    )
    table = _with_norm(metrics.assign(is_comparable=sides.isin(expected)))
    rows = []
    for row in table.to_dict("records"):
        key = row["hemisphere"], row["metric"]
        brains = by_metric.get(key)
        if brains is None and key not in cohort.norms:
            continue
        is_own = (
            row["run"] == OBSERVED
            and brains is not None
            and (brains["person"] == row["person"]).any()
        )
        score = {"brains": 0, "flag": OTHER_SIDES}
        if row["is_comparable"]:
            score = _score(
                key,
                row["week"],
                row["value"],
                cohort,
                brains if is_own else None,
                row["person"],
            )
        rows.append(row | score)
    return pd.DataFrame(rows, columns=[*names, *SCORES])


def _score(
    key: tuple[str, str],
    week: float,
    value: float,
    cohort: CohortNorms,
    brains: pd.DataFrame | None,
    person: str,
) -> dict[str, Any]:
    """Return the `SCORES` of a value; `brains` are those of the norm if the person is
    one of its subjects."""
    if key not in cohort.norms:
        return {
            "brains": 0 if brains is None else brains["person"].nunique(),
            "flag": "too few brains",
        }
    norm = cohort.norms[key][1]
    is_small = norm.subjects < FEW_SUBJECTS
    if brains is not None:
        is_own = brains["person"] == person
        own, others = brains[is_own], brains[~is_own]
        if (subjects := others["person"].nunique()) < min_norm_subjects(
            individuals=cohort.individuals
        ):
            return {"brains": subjects, "flag": "too few brains"}
        is_single = len(brains) == norm.subjects
        scan = (float(own["week"].iloc[0]), float(own["value"].iloc[0]))
        if (
            is_single
            and not is_small
            and abs(norm.scores(*scan)[0][0]) <= MAX_ONE_STEP_Z
        ):
            norm = norm.without(*scan)
        else:
            norm = _fit(others, key[1])
    score: dict[str, Any] = {"brains": norm.subjects}
    if not norm.first - WINDOW_GW <= week <= norm.last + WINDOW_GW:
        return score | {"flag": "outside the reference's weeks"}
    if not cohort.individuals:
        return score | {
            "flag": SPREAD_UNKNOWN,
            "expected": float(norm.values([week], 0.0)[0]),
        }
    if norm.is_positive and value <= 0:
        return score | {"flag": "not positive"}
    low, expected, high = (float(norm.values([week], z)[0]) for z in (-1.0, 0.0, 1.0))
    z, interval = norm.scores([week], [value])
    centiles, flag = (0.0, 100.0), "ok"
    if is_small:
        centiles, flag = FEW_CENTILES, "few brains"
    if norm.is_skewed:
        centiles, flag = SKEWED_CENTILES, "skewed"
    if not norm.has_converged:
        flag = "not converged"
    ends = np.array(centiles) / 100
    scores = np.clip(
        np.append(z, interval),
        *ndtri(ends),
    )
    numbers = (
        expected,
        0.5 * (high - low),
        *scores,
        *100 * ndtr(scores),
    )
    score |= dict(zip(SCORES, numbers, strict=False))
    if score["sd"] <= MIN_SPREAD * abs(score["expected"]):
        return {"brains": norm.subjects, "flag": "no spread"}
    return score | {"flag": flag}


def _with_norm(metrics: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with a value of a metric that has norms, with the column
    person."""
    with_norm = [name for name, metric in METRICS.items() if metric.has_norm]
    is_scored = metrics["metric"].isin(with_norm) & metrics["value"].notna()
    rows = metrics[is_scored]
    if "person" in rows:
        return rows
    return rows.assign(person=rows["subject"])


def _by_metric(
    metrics: pd.DataFrame, reference: Sequence[str]
) -> list[tuple[Any, pd.DataFrame]]:
    rows = _with_norm(
        metrics[(metrics["run"] == OBSERVED) & metrics["subject"].isin(reference)]
    )
    return list(rows.groupby(["hemisphere", "metric"], sort=False))


def norm_curves(cohort: CohortNorms) -> pd.DataFrame:
    """Return the curve of each metric over the weeks of its norm.

    Columns hemisphere, metric, unit, week, brains, expected (median), expected_low,
    expected_high (its 90 % interval), sd and the quantiles q05, q25, q50, q75, q95 of
    individuals. Those of averages are NaN.
    """
    columns = [
        "hemisphere",
        "metric",
        "unit",
        "week",
        "brains",
        "expected",
        "expected_low",
        "expected_high",
        "sd",
    ]
    parts = [pd.DataFrame(columns=[*columns, *QUANTILES])]
    for (hemisphere, metric), (unit, norm) in cohort.norms.items():
        weeks = np.linspace(
            norm.first, norm.last, CURVE_POINTS if norm.last > norm.first else 1
        )
        low, expected, high = (norm.values(weeks, z) for z in (-1.0, 0.0, 1.0))
        band = {
            "hemisphere": hemisphere,
            "metric": metric,
            "unit": unit,
            "week": weeks,
            "brains": norm.subjects,
        }
        first, last = norm.median_interval(weeks)
        band |= {"expected": expected, "expected_low": first, "expected_high": last}
        spread = {
            name: norm.values(
                weeks,
                float(ndtri(q)),
            )
            for name, q in QUANTILES.items()
        }
        spread |= {"sd": 0.5 * (high - low)}
        parts.append(
            pd.DataFrame(
                band | (spread if cohort.individuals else dict.fromkeys(spread, np.nan))
            )
        )
    return pd.concat(parts[1:] or parts, ignore_index=True)[[*columns, *QUANTILES]]
