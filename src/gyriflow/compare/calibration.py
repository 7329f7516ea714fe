"""Calibration: choose the parameters of the next runs, score the runs, and minimise a surrogate of the score."""

import warnings
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import minimize
from scipy.stats import norm, qmc
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from ..errors import InputError
from ..geometry.triangles import Floats, TriangleMesh
from ..metrics.spangy import spectral_distances
from ..settings.terms import AMPLITUDE, FOLD_BANDS, MEASURED, PROXIES, SPECTRAL_SCORES, STIFFNESS_RATIO, Score
from .comparison import Group, ObservedBrain, compare

DIGITS = 6
"""Significant digits of calibrated values."""
N_CANDIDATES = 1024
"""Points of a Sobol sequence at which the surrogate is evaluated."""
MIN_SPACING = 0.02
"""Smallest distance in the unit box between a new run and any other run."""


def sobol_design(bounds: Mapping[str, Sequence[float]], count: int, seed: int) -> pd.DataFrame:
    """Spread `count` rows of values evenly over the bounds, by a scrambled Sobol sequence (Sobol 1967; Owen 1998).

    The same seed gives the same rows.
    """
    # the sequence is balanced over powers of two
    power = int(np.ceil(np.log2(max(count, 2))))
    points = qmc.Sobol(len(bounds), rng=np.random.default_rng(seed)).random_base2(power)[:count]
    return from_unit_box(points, bounds)


def from_unit_box(points: Floats, bounds: Mapping[str, Sequence[float]]) -> pd.DataFrame:
    """Scale (n, d) points of the unit box to values between the bounds, in columns of the parameters' names."""
    low, high = np.transpose(list(bounds.values()))
    values = low + points * (high - low)
    return pd.DataFrame(values, columns=list(bounds)).map(lambda value: float(f"{value:.{DIGITS}g}"))


def to_unit_box(values: pd.DataFrame, bounds: Mapping[str, Sequence[float]]) -> Floats:
    """Scale rows of values to (n, d) points of the unit box."""
    low, high = np.transpose(list(bounds.values()))
    return np.asarray((values[list(bounds)].to_numpy(dtype=float) - low) / (high - low))


def calibrated_parameters(base: Mapping[str, Any], values: Mapping[str, float], week: float) -> dict[str, Any]:
    """Return the content of `params.yaml` for a run of a calibration that ends at a week.

    `base` is that of the base run, `values` the value of each parameter: a key of `params.yaml` (with dots for nested
    keys), `stiffness_ratio`, or `KEY.amplitude`, a factor on the curve KEY.
    """
    params = deepcopy(dict(base))
    for key, value in values.items():
        if key == STIFFNESS_RATIO:
            params["shear_modulus_cortex_pa"] = value * params["shear_modulus_core_pa"]
            continue
        *outer, last = key.removesuffix(AMPLITUDE).split(".")
        section = params
        for name in outer:
            section = section[name]
        section[last] = _scaled(section[last], value) if key.endswith(AMPLITUDE) else value
    return params | {"end_week": week, "output_weeks": [params["start_week"], week]}


def _scaled(curve: Mapping[Any, Any], factor: float) -> dict[Any, Any]:
    if "weeks" in curve:
        return dict(curve) | {"weeks": _scaled(curve["weeks"], factor)}
    return {week: factor * value for week, value in curve.items()}


SURFACE_SCORES: dict[Score, tuple[Group, Callable[[Mapping[str, float]], float]]] = {
    "size": ("size", lambda row: float(np.hypot(row["area_difference"], row["volume_difference"]))),
    "surface_distance": ("distance", lambda row: row["distance_mm"]),
    "shape_index": ("folds", lambda row: 1 - row["r_shape_index"]),
    "mean_curvature": ("folds", lambda row: 1 - row["r_mean_curvature"]),
    "curvature_distribution": ("folds", lambda row: row["curvature_distance_per_mm"]),
}
"""Scores of a row of `comparison.compare`, 0 for equal brains, and the group of columns that they need."""


def require_bands(spectra: pd.DataFrame, names: Collection[str], path: str | None = None) -> None:
    """Raise InputError unless the bands of spectral scores are complete and resolved.

    `spectra`, from the file `path`, have the columns proxy, band, wavelength_min_mm, wavelength_max_mm, complete,
    resolved.
    """
    rows = spectra[(spectra["proxy"] == PROXIES[0]) & spectra["band"].isin(FOLD_BANDS)]
    # the spectral distance covers all complete bands
    last = int(rows.loc[rows["complete"], "band"].max()) if rows["complete"].any() else FOLD_BANDS[0]
    for name in [name for name in names if name in SPECTRAL_SCORES]:
        for band in range(FOLD_BANDS[0], last + 1) if name == "spectral_distance" else [int(name[-1])]:
            row = rows[rows["band"] == band]
            if row["complete"].all() and row["resolved"].all():
                continue
            problem, remedy = "not resolved", "Use shorter edges and a smaller metrics.curvature_radius_mm"
            if not row["complete"].all():
                problem, remedy = "cut off", f"Set metrics.spangy_modes: B{band}"
            raise InputError(
                f"calibrate.score {name} needs a band that is {problem}",
                path=path,
                found=f"B{band}, {row['wavelength_min_mm'].min():.1f} to {row['wavelength_max_mm'].max():.1f} mm",
                remedy=f"{remedy}, or use another score.",
            )


def spectral_scores(simulated: pd.DataFrame, observed: pd.DataFrame) -> dict[str, float]:
    """Return the `SPECTRAL_SCORES` of two brains: means over hemispheres, NaN where bands are not complete or resolved.

    Both have the columns hemisphere, proxy, band, power, relative_power, complete, resolved.
    """
    tables = [simulated.assign(run=""), observed.assign(run=MEASURED)]
    both = pd.concat(tables, ignore_index=True).assign(subject="", week=0.0)
    distances = spectral_distances(both).query("run == ''").groupby("metric")["value"].mean().dropna()
    shares = both[both["proxy"] == PROXIES[0]].pivot_table("relative_power", ["hemisphere", "band"], "run")
    differences = (shares[""] - shares[MEASURED]).abs().groupby("band").mean()
    scores = {f"relative_power_b{band}": float(differences.get(band, np.nan)) for band in FOLD_BANDS}
    return scores | {"spectral_distance": float(distances.iloc[-1]) if len(distances) else np.nan}


def brain_scores(
    simulated: TriangleMesh, observed: ObservedBrain, names: Collection[Score], *, radius_mm: float
) -> dict[Score, float]:
    """Return the scores of `names` for a simulated closed surface in mm. `radius_mm` is that of fitted curvature."""
    row, _ = compare(simulated, observed, radius_mm=radius_mm, groups={SURFACE_SCORES[name][0] for name in names})
    return {name: SURFACE_SCORES[name][1](row) for name in names}


def run_score(
    pairs: Iterable[tuple[TriangleMesh, ObservedBrain]],
    weights: Mapping[Score, float],
    causes: Sequence[str],
    *,
    radius_mm: float,
    spectra: Iterable[tuple[pd.DataFrame, pd.DataFrame]] = (),
) -> dict[str, Any]:
    """Return the score of a run, the weighted sum of its scores' means over all pairs of brains.

    `pairs` are simulated surfaces and the observed brains to compare them with, `spectra` those of the same pairs as in
    `spectral_scores`, only needed if `weights` has some of these scores. Neither is read if there are `causes` why
    simulations of the run have diverged.

    Returns score and the mean of each score in `weights`, NaN if the run has diverged; outcome ("finished" or
    "diverged") and cause.
    """
    rows: list[dict[str, float]] = []
    if not causes:
        surface_names = [name for name in weights if name not in SPECTRAL_SCORES]
        rows = [dict(brain_scores(*pair, surface_names, radius_mm=radius_mm).items()) for pair in pairs]
        if len(surface_names) < len(weights):
            for row, pair in zip(rows, spectra, strict=True):
                require_bands(pd.concat(pair), weights)
                row.update(spectral_scores(*pair))
    table = pd.DataFrame(rows, columns=list(weights))
    means: dict[str, float] = {name: float(table[name].mean()) for name in weights}
    score = sum(weight * means[name] for name, weight in weights.items())
    outcome = {"outcome": "diverged" if causes else "finished", "cause": "; ".join(causes)}
    return {"score": score, **means, **outcome}


@dataclass(frozen=True, eq=False)
class Surrogate:
    """A Gaussian process that predicts the score of a run from its parameters.

    It is fitted to n runs at `points` (n, d) of the unit box, whose sides are the `bounds` of
    each parameter, with `scores` (n,); a diverged run gets a score worse than all others. The kernel is
    Matérn's (ν = 5/2), with a length for each parameter, plus noise. `seed` determines the candidates for the next
    runs.
    """

    process: GaussianProcessRegressor
    bounds: Mapping[str, Sequence[float]]
    points: Floats
    scores: Floats
    seed: int


def fit_surrogate(runs: pd.DataFrame, bounds: Mapping[str, Sequence[float]], seed: int) -> Surrogate:
    """Fit the surrogate to the runs of a calibration: columns of the parameters, score (NaN if diverged) and cause.

    InputError if fewer than two runs have a score.
    """
    points, scores = to_unit_box(runs, bounds), np.asarray(runs["score"], dtype=float)
    finished = scores[np.isfinite(scores)]
    if len(finished) < 2:
        causes = "; ".join(dict.fromkeys(runs["cause"].dropna().astype(str)))
        raise InputError(
            "too few runs of the calibration have finished to choose the next ones",
            found=f"{len(finished)} of {len(runs)} runs with a score; {causes}",
            expected="two or more",
            remedy="Narrow the bounds of calibrate.parameters around values with which calibrate.base finishes, or "
            "start with more runs (calibrate.rounds).",
        )
    # a diverged run scores as far above the worst as the worst is above the best: not too steep for the surrogate
    scores = np.where(np.isfinite(scores), scores, 2 * finished.max() - finished.min())
    kernel = ConstantKernel(1.0, (1e-2, 1e2)) * Matern([0.5] * len(bounds), (0.05, 20.0), nu=2.5)
    process = GaussianProcessRegressor(
        kernel + WhiteKernel(1e-4, (1e-8, 0.3)), normalize_y=True, n_restarts_optimizer=8, random_state=seed
    )
    with warnings.catch_warnings():
        # the length of a parameter without effect ends at its bound
        warnings.simplefilter("ignore", ConvergenceWarning)
        process.fit(points, scores)
    return Surrogate(process, bounds, points, scores, seed)


def propose_runs(surrogate: Surrogate, count: int) -> pd.DataFrame:
    """Choose the values of the next `count` runs, those with the largest expected improvement of the score.

    Each is added with its expected score before the next is chosen, so that they do not cluster (the kriging believer
    of Ginsbourger, Le Riche and Carraro 2010).
    """
    process, points, scores = surrogate.process, surrogate.points, surrogate.scores
    candidates, proposed = _candidates(surrogate), []
    for _ in range(count):
        free = np.linalg.norm(candidates[:, None] - points[None], axis=2).min(axis=1) >= MIN_SPACING
        candidates = candidates[free] if free.any() else candidates
        best = candidates[int(expected_improvement(process, candidates, float(scores.min())).argmax())]
        proposed.append(best)
        points, scores = np.vstack([points, best]), np.append(scores, process.predict(best[None]))
        believer = GaussianProcessRegressor(surrogate.process.kernel_, optimizer=None, normalize_y=True)
        process = believer.fit(points, scores)
    return from_unit_box(np.array(proposed), surrogate.bounds)


def expected_improvement(process: GaussianProcessRegressor, points: Floats, best: float) -> Floats:
    """Return the (n,) expected improvements of (n, d) points over the best score (Jones, Schonlau and Welch 1998)."""
    mean, sd = process.predict(points, return_std=True)
    sd = np.maximum(sd, 1e-12)
    gain = best - mean
    return np.asarray(gain * norm.cdf(gain / sd) + sd * norm.pdf(gain / sd))


def find_optimum(surrogate: Surrogate) -> pd.DataFrame:
    """Find the minimum of the surrogate: a row per parameter.

    Columns parameter, value, lowest and highest (the bounds), at_bound (whether the value is within 1 % of a bound),
    score and score_sd (mean and standard deviation of the surrogate at the minimum).
    """
    process, candidates = surrogate.process, _candidates(surrogate)
    box = [(0.0, 1.0)] * candidates.shape[1]
    starts = candidates[np.argsort(process.predict(candidates))[:5]]
    minima = [minimize(lambda x: float(process.predict(x[None])[0]), start, bounds=box) for start in starts]
    best = min(minima, key=lambda minimum: minimum.fun).x
    mean, sd = process.predict(best[None], return_std=True)
    lowest, highest = zip(*surrogate.bounds.values(), strict=True)
    return pd.DataFrame(
        {
            "parameter": list(surrogate.bounds),
            "value": from_unit_box(best[None], surrogate.bounds).iloc[0].to_numpy(),
            "lowest": lowest,
            "highest": highest,
            "at_bound": (best < 0.01) | (best > 0.99),
            "score": float(mean[0]),
            "score_sd": float(sd[0]),
        }
    )


def _candidates(surrogate: Surrogate) -> Floats:
    rng = np.random.default_rng(surrogate.seed)
    dimension = len(surrogate.bounds)
    spread = qmc.Sobol(dimension, rng=rng).random(N_CANDIDATES)
    best = surrogate.points[surrogate.scores.argmin()]
    # further candidates near the best run, half as many
    near = np.clip(best + 0.1 * rng.standard_normal((N_CANDIDATES // 2, dimension)), 0, 1)
    return np.vstack([spread, near])
