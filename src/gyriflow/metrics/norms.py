"""Norms of published curves and of measured brains over gestational weeks, and the scores of brains against them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from ..errors import InputError
from ..geometry.triangles import Floats
from ..quantities import METRICS
from ..settings.schemes import LabelScheme
from ..settings.terms import MEASURED, SIDES, SPREAD_UNKNOWN, Side
from .tables import BRAIN

QUANTILES = {"q05": 0.05, "q25": 0.25, "q50": 0.5, "q75": 0.75, "q95": 0.95}
"""The quantiles that norms give, by the names of their columns."""

MIN_BRAINS = 5
"""Smallest number of subjects near a week for which quantiles are computed."""

MIN_FREEDOM = 3
"""Degrees of freedom below which the scatter around a curve is unknown."""

WINDOW_GW = 0.5
"""Brains at most this far from a week are of that week."""

CURVE_POINTS = 41
"""Number of weeks at which a curve is given, from the reference's first to its last."""

OTHER_SIDES = "other hemispheres"
"""The flag of a brain that has other hemispheres than those it would be compared with."""


@dataclass(frozen=True)
class PublishedNorm:
    """A published curve: mean and standard deviation as polynomials of the week, highest power first.

    It is valid from the first to the last of `weeks`. The volumes are those of `labels` of a label `scheme`, in
    `subjects` brains (None if the source does not give their number). `tissue` is the closest field of `LabelScheme`
    for brains of other schemes ("" if no field is close); `side` is the structure's hemisphere, None if it is in
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
    """Return the norms of a file of `norms/`, by structure; InputError where a standard deviation is not positive."""
    norms = {}
    shared = {key: data[key] for key in ("weeks", "unit", "subjects", "scheme") if key in data}
    for name, entry in data["structures"].items():
        norm = PublishedNorm(**shared, **entry)
        lowest = float(np.polyval(norm.sd, np.linspace(norm.weeks[0], norm.weeks[1], 201)).min())
        if lowest <= 0:
            raise InputError(f"the norm of {name} has no standard deviation", found=f"{lowest:.3g}", expected="above 0")
        norms[name] = norm
    return norms


def structure_volumes(
    volumes: Mapping[int, float], scheme: LabelScheme, norms: Mapping[str, PublishedNorm]
) -> tuple[dict[str, float], list[str]]:
    """Return the volumes of the structures of published norms, and the structures measured with another label scheme.

    `volumes` are by label, in the norms' unit. With another scheme than the norm's, a structure is the scheme's tissue
    that is closest to it, such as the cortex. A structure without voxels, or without labels in the scheme, is left out.
    """
    structures, substitutes = {}, []
    for name, norm in norms.items():
        same = norm.scheme == scheme.name
        labels = norm.labels if same else getattr(scheme, norm.tissue, ())
        total = sum(volumes.get(label, 0.0) for label in labels)
        if total > 0:
            structures[name] = total
            substitutes += [] if same else [name]
    return structures, substitutes


def published_scores(
    volumes: Mapping[str, float],
    week: float,
    norms: Mapping[str, PublishedNorm],
    substitutes: Sequence[str] = (),
    sides: Sequence[Side] = SIDES,
) -> pd.DataFrame:
    """Return the scores of the volumes of a brain against published norms.

    `volumes` are by structure, in the norms' unit; structures without a norm are left out. `substitutes` are the
    structures measured with another label scheme than the norm's, `sides` the hemispheres of the brain.

    Columns structure, week, value, unit, expected, sd, z = (value − expected)/sd, centile (of the normal distribution,
    0 to 100), brains (in the norm; NaN if its source does not give their number), flag ("ok"; "other labels": the norm
    was measured with another label scheme; "outside the norm's weeks"; "one hemisphere" if the brain lacks a hemisphere
    of the norm). Expected, z and centile are NaN with the last two flags.
    """
    rows = []
    for name, value in volumes.items():
        if name not in norms:
            continue
        norm = norms[name]
        inside = norm.weeks[0] <= week <= norm.weeks[1]
        is_present = len(sides) == len(SIDES) or norm.side in sides
        scored = inside and is_present
        mean, sd = (float(np.polyval(curve, week)) if scored else np.nan for curve in (norm.mean, norm.sd))
        z = (value - mean) / sd
        brains = np.nan if norm.subjects is None else norm.subjects
        flag = "other labels" if name in substitutes else "ok"
        if not scored:
            flag = "outside the norm's weeks" if is_present else "one hemisphere"
        rows.append((name, week, value, norm.unit, mean, sd, z, 100 * float(stats.norm.cdf(z)), brains, flag))
    columns = ["structure", "week", "value", "unit", "expected", "sd", "z", "centile", "brains", "flag"]
    return pd.DataFrame(rows, columns=columns)


@dataclass(frozen=True)
class LabelledBrain:
    """A measured brain, the volume in mL of each of its labels, and the label scheme."""

    subject: str
    week: float
    sides: Sequence[Side]
    scheme: LabelScheme
    volumes: Mapping[int, float]


def volume_tables(
    brains: Sequence[LabelledBrain], norms: Mapping[str, PublishedNorm]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the volumes of all labels of brains, and their scores against published norms.

    Columns subject, run ("real"), week, label, tissue, volume_mL; subject and those of `published_scores`.
    """
    rows, scores = [], []
    for brain in brains:
        columns = brain.subject, MEASURED, brain.week
        rows += [(*columns, label, brain.scheme.labels.get(label, ""), ml) for label, ml in brain.volumes.items()]
        found, substitutes = structure_volumes(brain.volumes, brain.scheme, norms)
        scored = published_scores(found, brain.week, norms, substitutes, brain.sides)
        scores.append(scored.assign(subject=brain.subject)[["subject", *scored.columns]])
    volumes = pd.DataFrame(rows, columns=[*BRAIN, "label", "tissue", "volume_mL"])
    return volumes, pd.concat(scores, ignore_index=True)


def measured_norms(metrics: pd.DataFrame, reference: Sequence[str]) -> pd.DataFrame:
    """Return mean, standard deviation and quantiles of the metrics of reference brains at each of their weeks.

    `metrics` has the columns subject (the brain), run, week, hemisphere, metric, value, unit, and person (the subject
    scanned; may be absent if no one was scanned twice). `reference` are ids of brains. Columns of the result:
    hemisphere, metric, unit, week, brains (number of persons with a scan at most half a week away; several scans of one
    person are averaged), mean, sd (NaN for one person), q05, q25, q50, q75, q95 (NaN for fewer than five).
    """
    rows = []
    for names, brains in _by_metric(metrics, reference):
        for week in np.unique(brains["week"]):
            near = brains[(brains["week"] - week).abs() <= WINDOW_GW].groupby("person")["value"].mean()
            sufficient = near if len(near) >= MIN_BRAINS else near.iloc[:0]
            quantiles = sufficient.quantile(list(QUANTILES.values()))
            rows.append((*names, brains["unit"].iloc[0], week, len(near), near.mean(), near.std(), *quantiles))
    columns = ["hemisphere", "metric", "unit", "week", "brains", "mean", "sd", *QUANTILES]
    return pd.DataFrame(rows, columns=columns)


def measured_scores(metrics: pd.DataFrame, reference: Sequence[str], *, individuals: bool = True) -> pd.DataFrame:
    """Return the scores of brains against the reference brains, at each brain's own week.

    A quadratic in the week (a line for three weeks, the mean for fewer) is fitted to the reference brains by least
    squares; all scans of a subject together have the weight of one. The centile is that of a new observation under
    Student's t distribution: t = (x − expected)/(s √(1 + h)), where s is the residual standard deviation and h the
    leverage of the week. All brains of the table are scored; a brain of the reference is compared with those of other
    subjects. If the reference brains are not `individuals` but averages, as in an atlas, their scatter is not that of
    individuals: the expected value is given without sd, z and centile.

    Columns subject, run, week, hemisphere, metric, value, unit, expected, sd (s), z = (value − expected)/s, centile
    (0 to 100), brains (subjects of the reference), brains_of_week, flag: "ok"; `SPREAD_UNKNOWN`; "outside the
    reference's weeks", "too few brains" or "other hemispheres" (than the reference), whose scores are NaN.
    """
    by_metric = dict(_by_metric(metrics, reference))
    names = [*BRAIN, "hemisphere", "metric", "value", "unit"]
    table = _with_people(metrics).assign(alike=same_sides(metrics, reference)).dropna(subset=["value"])
    rows = []
    for row, is_comparable, person in zip(
        table[names].to_dict("records"), table["alike"], table["person"], strict=True
    ):
        norm = by_metric.get((row["hemisphere"], row["metric"]))
        if norm is None:
            continue
        # the norm of an observed brain excludes all scans of its own subject
        norm = norm[is_comparable & ((row["run"] != MEASURED) | (norm["person"] != person))]
        *score, flag = _score(row["week"], row["value"], norm, individuals)
        rows.append((*row.values(), *score, flag if is_comparable else OTHER_SIDES))
    columns = [*names, "expected", "sd", "z", "centile", "brains", "brains_of_week", "flag"]
    return pd.DataFrame(rows, columns=columns)


def same_sides(metrics: pd.DataFrame, reference: Sequence[str]) -> pd.Series:
    """Return for each row of a table of metrics whether its brain has the hemispheres of a reference's brains.

    The whole of a brain with one hemisphere is that hemisphere: its volume and area are half of what others have.
    """
    sides = metrics.groupby(BRAIN)["hemisphere"].transform(lambda names: " ".join(sorted(set(names))))
    is_reference = (metrics["run"] == MEASURED) & metrics["subject"].isin(reference)
    return sides.isin(sides[is_reference])


def _with_people(metrics: pd.DataFrame) -> pd.DataFrame:
    return metrics if "person" in metrics else metrics.assign(person=metrics["subject"])


def _by_metric(metrics: pd.DataFrame, reference: Sequence[str]) -> list[tuple[Any, pd.DataFrame]]:
    rows = metrics[(metrics["run"] == MEASURED) & metrics["subject"].isin(reference)].dropna(subset=["value"])
    rows = _with_people(rows)
    with_norm = rows["metric"].map(lambda name: METRICS[name].has_norm).astype(bool)
    return list(rows[with_norm].groupby(["hemisphere", "metric"], sort=False))


class _Curve(NamedTuple):
    """The curve through reference brains at k weeks, and the scatter around it with its degrees of freedom."""

    expected: Floats
    leverage: Floats
    sd: float
    freedom: int


def _curve(brains: pd.DataFrame, at: Floats) -> _Curve | None:
    weeks, values = brains["week"].to_numpy(dtype=float), brains["value"].to_numpy(dtype=float)
    # the scans of one subject are not independent
    weights = 1.0 / brains.groupby("person")["value"].transform("size").to_numpy(dtype=float)
    distinct = len(np.unique(weeks))
    degree = 2 if distinct > 3 else 1 if distinct == 3 else 0
    freedom = brains["person"].nunique() - degree - 1
    if freedom < MIN_FREEDOM:
        return None
    centre = float(weeks.mean())
    powers, here = (np.vander(x - centre, degree + 1) for x in (weeks, at))
    factors, *_ = np.linalg.lstsq(powers * np.sqrt(weights)[:, None], values * np.sqrt(weights), rcond=None)
    sd = float(np.sqrt(weights @ (values - powers @ factors) ** 2 / freedom))
    leverage = np.einsum("ij,jk,ik->i", here, np.linalg.inv(powers.T @ (weights[:, None] * powers)), here)
    return _Curve(here @ factors, leverage, sd, freedom)


def norm_curves(metrics: pd.DataFrame, reference: Sequence[str], *, individuals: bool = True) -> pd.DataFrame:
    """Return the fitted curve of each metric over the reference's weeks; no rows for metrics with too few brains.

    Columns hemisphere, metric, unit, week, expected, low, high. 90 % of new brains are expected between low and high,
    by Student's t distribution; both are NaN if the reference brains are not `individuals`.
    """
    columns = ["hemisphere", "metric", "unit", "week", "expected", "low", "high"]
    parts = [pd.DataFrame(columns=columns)]
    for (hemisphere, metric), brains in _by_metric(metrics, reference):
        weeks = brains["week"].to_numpy(dtype=float)
        at = np.linspace(weeks.min(), weeks.max(), CURVE_POINTS if np.ptp(weeks) else 1)
        if (curve := _curve(brains, at)) is not None:
            sd = curve.sd if individuals else np.nan
            half = float(stats.t.ppf(0.95, curve.freedom)) * sd * np.sqrt(1 + curve.leverage)
            band = {"week": at, "expected": curve.expected, "low": curve.expected - half, "high": curve.expected + half}
            names = {"hemisphere": hemisphere, "metric": metric, "unit": brains["unit"].iloc[0]}
            parts.append(pd.DataFrame(band).assign(**names)[columns])
    return pd.concat(parts[1:] or parts, ignore_index=True)


def _score(
    week: float, value: float, brains: pd.DataFrame, individuals: bool
) -> tuple[float, float, float, float, int, int, str]:
    weeks = brains["week"].to_numpy(dtype=float)
    counts = brains["person"].nunique(), brains.loc[np.abs(weeks - week) <= WINDOW_GW, "person"].nunique()
    curve = _curve(brains, np.array([week])) if len(brains) else None
    if curve is None or not weeks.min() - WINDOW_GW <= week <= weeks.max() + WINDOW_GW:
        why = "too few brains" if curve is None else "outside the reference's weeks"
        return np.nan, np.nan, np.nan, np.nan, *counts, why
    expected = float(curve.expected[0])
    if not individuals:
        return expected, np.nan, np.nan, np.nan, *counts, SPREAD_UNKNOWN
    if curve.sd == 0:
        return expected, curve.sd, np.nan, np.nan, *counts, "too few brains"
    z = (value - expected) / curve.sd
    centile = 100 * float(stats.t.cdf(z / np.sqrt(1 + curve.leverage[0]), curve.freedom))
    return expected, curve.sd, z, centile, *counts, "ok"
