"""Calibration: choose the parameters of the next runs, score the runs, and find the
best."""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import deepcopy
from typing import Any

import numpy as np
import optuna
import pandas as pd
from optuna.distributions import BaseDistribution, FloatDistribution
from optuna.trial import FrozenTrial, TrialState, create_trial

from ..errors import InputError
from ..geometry.triangles import TriangleMesh
from ..metrics.spangy import spectral_distances
from ..settings.terms import (
    FOLD_BANDS,
    OBSERVED,
    PROXIES,
    SPECTRAL_SCORES,
    Score,
)
from .comparison import Group, ObservedBrain, compare

Bounds = Mapping[str, Sequence[float]]
"""The lowest and the highest value of each parameter."""
DIGITS = 6
"""Significant digits of calibrated values."""
AT_BOUND = 0.01
"""Distance from a bound, as a share of the range, below which a value counts as at the
bound."""


def first_round(
    bounds: Bounds,
    count: int,
    seed: int,
) -> pd.DataFrame:
    """Spread `count` rows of values evenly over the bounds, by a scrambled Sobol
    sequence (Sobol 1967; Owen 1998).

    The same seed gives the same rows.
    """
    # takes a second, which scores need not wait for
    from scipy.stats import qmc

    # the sequence is balanced over powers of two
    at_least_two = max(count, 2)
    power = math.ceil(math.log2(at_least_two))
    random = np.random.default_rng(seed)
    sequence = qmc.Sobol(len(bounds), rng=random)
    points = sequence.random_base2(power)[:count]
    values = pd.DataFrame(points, columns=list(bounds))
    for key, (low, high) in bounds.items():
        values[key] = low + values[key] * (high - low)
    return _rounded(values, bounds)


def next_round(
    runs: pd.DataFrame,
    bounds: Bounds,
    count: int,
    seed: int,
) -> pd.DataFrame:
    """Choose the values of the next `count` runs from all earlier ones.

    By optuna's tree-structured Parzen estimator (Bergstra et al. 2011), which compares
    the density of the best runs with that of the others, and counts runs that it has
    proposed as bad until they are scored (constant liar).

    `runs` has columns of the parameters, score (NaN if diverged) and cause. The same
    runs and seed give the same rows. InputError if no run has a score.
    """
    _require_finished(runs)
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    # another seed each round, or the same places would be drawn again
    sampler = optuna.samplers.TPESampler(
        seed=seed + len(runs),
        n_startup_trials=1,
    )
    search = optuna.create_study(sampler=sampler)
    distributions: dict[str, BaseDistribution] = {}
    for name, (low, high) in bounds.items():
        distributions[name] = FloatDistribution(low, high)
    for run in runs.to_dict("records"):
        search.add_trial(_trial(run, distributions))
    proposed = []
    for _ in range(count):
        proposed.append(search.ask(distributions).params)
    return _rounded(
        pd.DataFrame(proposed, columns=list(bounds)),
        bounds,
    )


def _trial(
    run: Mapping[Any, Any], distributions: dict[str, BaseDistribution]
) -> FrozenTrial:
    """Return a run as optuna's trial: finished, or pruned, which counts as worse than
    all finished ones."""
    parameters = {name: run[name] for name in distributions}
    if np.isnan(run["score"]):
        return create_trial(
            state=TrialState.PRUNED,
            params=parameters,
            distributions=distributions,
        )
    return create_trial(
        value=run["score"],
        params=parameters,
        distributions=distributions,
    )


def _rounded(values: pd.DataFrame, bounds: Bounds) -> pd.DataFrame:
    """Round values to `DIGITS` significant digits within the bounds."""
    rounded = values.copy()
    for key, (low, high) in bounds.items():
        digits = values[key].map(f"{{:.{DIGITS}g}}".format)
        rounded[key] = digits.astype(float).clip(low, high)
    return rounded


def _require_finished(runs: pd.DataFrame) -> None:
    """Raise InputError if none of the runs (columns score, NaN if diverged, and cause)
    has a score."""
    if runs["score"].notna().any():
        return
    causes = "; ".join(dict.fromkeys(runs["cause"].dropna().astype(str)))
    raise InputError(
        "no run of the calibration has finished",
        found=f"0 of {len(runs)} runs with a score; {causes}",
        expected="one or more",
        remedy=(
            "Narrow the bounds of calibrate.parameters around values with which"
            " calibrate.base finishes, or start with more runs (calibrate.rounds)."
        ),
    )


def find_optimum(runs: pd.DataFrame, bounds: Bounds) -> pd.DataFrame:
    """Return the parameters of the run with the least score: a row per parameter.

    `runs` has columns of run, the parameters, score (NaN if diverged) and cause.
    Returns columns parameter, value, lowest and highest (the bounds), at_bound (whether
    the value is within 1 % of a bound), run and score. InputError if no run has a
    score.
    """
    _require_finished(runs)
    best = runs.iloc[int(np.nanargmin(runs["score"].to_numpy(dtype=float)))]
    rows = []
    for name, (low, high) in bounds.items():
        value = best[name]
        margin = AT_BOUND * (high - low)
        is_at_bound = value < low + margin or value > high - margin
        row = {
            "parameter": name,
            "value": value,
            "lowest": low,
            "highest": high,
            "at_bound": is_at_bound,
        }
        rows.append(
            row
            | {
                "run": best["run"],
                "score": best["score"],
            }
        )
    return pd.DataFrame(rows)


def calibrated_parameters(
    base: Mapping[str, Any],
    values: Mapping[str, float],
    week: float,
) -> dict[str, Any]:
    """Return the content of `params.yaml` for a run of a calibration that ends at a
    week.

    `base` is that of the base run, `values` the value of each parameter: a key of
    `params.yaml`, with dots for nested keys.
    """
    params = deepcopy(dict(base))
    for key, value in values.items():
        *outer, last = key.split(".")
        section = params
        for name in outer:
            section = section[name]
        section[last] = value
    return params | {
        "end_week": week,
        "output_weeks": [params["start_week"], week],
    }


SURFACE_SCORES: dict[Score, tuple[Group, Callable[[Mapping[str, float]], float]]] = {
    "size": (
        "size",
        lambda row: float(np.hypot(row["area_difference"], row["volume_difference"])),
    ),
    "surface_distance": ("distance", lambda row: row["distance_mm"]),
    "shape_index": ("folds", lambda row: 1 - row["r_shape_index"]),
    "mean_curvature": ("folds", lambda row: 1 - row["r_mean_curvature"]),
    "curvature_distribution": ("folds", lambda row: row["curvature_distance_per_mm"]),
}
"""Scores of a row of `comparison.compare`, 0 for equal brains, and the group of columns
that they need."""


def require_bands(
    spectra: pd.DataFrame,
    names: Collection[str],
    path: str | None = None,
) -> None:
    """Raise InputError unless the bands of spectral scores are complete and resolved.

    `spectra`, from the file `path`, have the columns proxy, band, wavelength_min_mm,
    wavelength_max_mm, complete, resolved.
    """
    rows = spectra[(spectra["proxy"] == PROXIES[0]) & spectra["band"].isin(FOLD_BANDS)]
    # the spectral distance covers all complete bands
    last = (
        int(rows.loc[rows["complete"], "band"].max())
        if rows["complete"].any()
        else FOLD_BANDS[0]
    )
    for name in [name for name in names if name in SPECTRAL_SCORES]:
        for band in (
            range(FOLD_BANDS[0], last + 1)
            if name == "spectral_distance"
            else [int(name[-1])]
        ):
            row = rows[rows["band"] == band]
            if row["complete"].all() and row["resolved"].all():
                continue
            problem = "not resolved"
            remedy = "Use shorter edges and a smaller metrics.curvature_radius_mm"
            if not row["complete"].all():
                problem, remedy = "cut off", f"Set metrics.spangy_modes: B{band}"
            raise InputError(
                f"calibrate.score {name} needs a band that is {problem}",
                path=path,
                found=(
                    f"B{band}, {row['wavelength_min_mm'].min():.1f} to"
                    f" {row['wavelength_max_mm'].max():.1f} mm"
                ),
                remedy=f"{remedy}, or use another score.",
            )


def spectral_scores(
    simulated: pd.DataFrame, observed: pd.DataFrame
) -> dict[str, float]:
    """Return the `SPECTRAL_SCORES` of two brains: means over hemispheres, NaN where
    bands are not complete or resolved.

    Both have the columns hemisphere, proxy, band, power, relative_power, complete,
    resolved.
    """
    tables = [simulated.assign(run=""), observed.assign(run=OBSERVED)]
    both = pd.concat(tables, ignore_index=True).assign(subject="", week=0.0)
    distances = (
        spectral_distances(both)
        .query("run == ''")
        .groupby("metric")["value"]
        .mean()
        .dropna()
    )
    shares = both[both["proxy"] == PROXIES[0]].pivot_table(
        "relative_power", ["hemisphere", "band"], "run"
    )
    differences = (shares[""] - shares[OBSERVED]).abs().groupby("band").mean()
    scores = {
        f"relative_power_b{band}": float(differences.get(band, np.nan))
        for band in FOLD_BANDS
    }
    return scores | {
        "spectral_distance": float(distances.iloc[-1]) if len(distances) else np.nan
    }


def brain_scores(
    simulated: TriangleMesh,
    observed: ObservedBrain,
    names: Collection[Score],
    *,
    radius_mm: float,
) -> dict[Score, float]:
    """Return the scores of `names` for a simulated closed surface in mm. `radius_mm` is
    that of fitted curvature."""
    row, _ = compare(
        simulated,
        observed,
        radius_mm=radius_mm,
        groups={SURFACE_SCORES[name][0] for name in names},
    )
    return {name: SURFACE_SCORES[name][1](row) for name in names}


def run_score(
    pairs: Iterable[tuple[TriangleMesh, ObservedBrain]],
    weights: Mapping[Score, float],
    causes: Sequence[str],
    *,
    radius_mm: float,
    spectra: Iterable[tuple[pd.DataFrame, pd.DataFrame]] = (),
) -> dict[str, Any]:
    """Return the score of a run, the weighted sum of its scores' means over all pairs
    of brains.

    `pairs` are simulated surfaces and the observed brains to compare them with,
    `spectra` those of the same pairs as in `spectral_scores`, only needed if `weights`
    has some of these scores. Neither is read if there are `causes` why simulations of
    the run have diverged.

    Returns score and the mean of each score in `weights`, NaN if the run has diverged;
    outcome ("finished" or "diverged") and cause.
    """
    rows: list[dict[str, float]] = []
    if not causes:
        surface_names = [name for name in weights if name not in SPECTRAL_SCORES]
        rows = [
            dict(brain_scores(*pair, surface_names, radius_mm=radius_mm).items())
            for pair in pairs
        ]
        if len(surface_names) < len(weights):
            for row, pair in zip(rows, spectra, strict=True):
                require_bands(pd.concat(pair), weights)
                row.update(spectral_scores(*pair))
    table = pd.DataFrame(rows, columns=list(weights))
    means: dict[str, float] = {name: float(table[name].mean()) for name in weights}
    score = sum(weight * means[name] for name, weight in weights.items())
    outcome = {
        "outcome": "diverged" if causes else "finished",
        "cause": "; ".join(causes),
    }
    return {"score": score, **means, **outcome}
