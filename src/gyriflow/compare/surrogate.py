"""A Gaussian process through the scores of a calibration's runs: where it expects the least, and how sure it is."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.optimize import minimize
from scipy.stats import norm, qmc, sobol_indices, uniform
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from .design import Floats, in_bounds, in_unit_box

CANDIDATES = 1024
"""Points of a Sobol sequence at which the surrogate is looked at."""
DRAWS = 1000
"""Functions drawn from the surrogate, whose minima tell how sure the optimum is."""
INTERVAL = (0.025, 0.975)
LEAST_HALF_WIDTH = 0.005
"""No interval of the optimum is narrower than this part of the range to either side: candidates are not denser."""
APART = 0.02
"""Least distance of runs of a round from each other and from earlier runs, in the unit box."""
GRID = 41
"""Points along each parameter in `profiles`."""
INDEX_SAMPLES = 1024
"""Base samples of the sensitivity indices, a power of two."""


@dataclass(frozen=True, eq=False)
class Surrogate:
    """A Gaussian process over the unit box of the bounds, the lowest and highest value by parameter.

    The process is fitted, with a Matérn kernel (ν = 5/2), a length for each parameter, and noise, to (n, d) points with
    (n,) scores: a diverged run has one worse than all others. The seed is that of candidates and draws.
    """

    process: GaussianProcessRegressor
    bounds: Mapping[str, Sequence[float]]
    points: Floats
    scores: Floats
    seed: int


def fit(runs: pd.DataFrame, bounds: Mapping[str, Sequence[float]], seed: int) -> Surrogate:
    """Returns the surrogate through the runs of a calibration: columns of the parameters, score (NaN: has diverged)."""
    points, found = in_unit_box(runs, bounds), runs["score"].to_numpy(dtype=float)
    known = found[np.isfinite(found)]
    if len(known) < 2:
        raise ValueError(f"{len(known)} runs with a score; a surrogate needs two or more")
    # a wall that the surrogate can follow: as far above the worst as that is above the best
    scores = np.where(np.isfinite(found), found, 2 * known.max() - known.min())
    kernel = ConstantKernel(1.0, (1e-2, 1e2)) * Matern([0.5] * len(bounds), (0.05, 20.0), nu=2.5)
    process = GaussianProcessRegressor(
        kernel + WhiteKernel(1e-4, (1e-8, 0.3)), normalize_y=True, n_restarts_optimizer=8, random_state=seed
    )
    with warnings.catch_warnings():
        # lengths at their bounds are those of parameters without effect
        warnings.simplefilter("ignore", ConvergenceWarning)
        process.fit(points, scores)
    return Surrogate(process, bounds, points, scores, seed)


def propose(surrogate: Surrogate, count: int) -> pd.DataFrame:
    """Returns the values of the next `count` runs: where the score is expected to improve the most.

    Each is added with the score that the surrogate expects before the next is chosen (the kriging believer of
    Ginsbourger, Le Riche and Carraro 2010), so that they lie apart.
    """
    process, points, scores = surrogate.process, surrogate.points, surrogate.scores
    candidates, chosen = _candidates(surrogate), []
    for _ in range(count):
        free = np.linalg.norm(candidates[:, None] - points[None], axis=2).min(axis=1) >= APART
        candidates = candidates[free] if free.any() else candidates
        best = candidates[int(expected_improvement(process, candidates, float(scores.min())).argmax())]
        chosen.append(best)
        points, scores = np.vstack([points, best]), np.append(scores, process.predict(best[None]))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            kept = GaussianProcessRegressor(surrogate.process.kernel_, optimizer=None, normalize_y=True)
            process = kept.fit(points, scores)
    return in_bounds(np.array(chosen), surrogate.bounds)


def expected_improvement(process: GaussianProcessRegressor, points: Floats, best: float) -> Floats:
    """Returns by how much (n, d) points are expected to be below the best score (Jones, Schonlau and Welch 1998)."""
    mean, sd = process.predict(points, return_std=True)
    sd = np.maximum(sd, 1e-12)
    gain = best - mean
    return np.asarray(gain * norm.cdf(gain / sd) + sd * norm.pdf(gain / sd))


def optimum(surrogate: Surrogate) -> pd.DataFrame:
    """Returns the parameters where the surrogate is least, and how sure they are.

    Returns
    -------
    DataFrame
        A row per parameter: parameter, value, low, high (95 % of the minima of functions drawn from the surrogate),
        lowest, highest (the bounds), at_bound (whether the value is within 1 % of one), score, score_sd (of the
        surrogate there).
    """
    process, candidates = surrogate.process, _candidates(surrogate)
    box = [(0.0, 1.0)] * candidates.shape[1]
    starts = candidates[np.argsort(process.predict(candidates))[:5]]
    found = [minimize(lambda x: float(process.predict(x[None])[0]), start, bounds=box) for start in starts]
    best = min(found, key=lambda outcome: outcome.fun).x
    minima = _drawn_minima(surrogate, np.vstack([candidates, best]))
    mean, sd = process.predict(best[None], return_std=True)
    low, high = np.quantile(minima, INTERVAL, axis=0)
    low, high = np.minimum(low, best - LEAST_HALF_WIDTH), np.maximum(high, best + LEAST_HALF_WIDTH)
    ends = in_bounds(np.array([best, *np.clip([low, high], 0, 1)]), surrogate.bounds).to_numpy()
    lowest, highest = zip(*surrogate.bounds.values(), strict=True)
    return pd.DataFrame(
        {
            "parameter": list(surrogate.bounds),
            **dict(zip(("value", "low", "high"), ends, strict=True)),
            "lowest": lowest,
            "highest": highest,
            "at_bound": (best < 0.01) | (best > 0.99),
            "score": float(mean[0]),
            "score_sd": float(sd[0]),
        }
    )


def sensitivities(surrogate: Surrogate) -> pd.DataFrame:
    """Returns how much of the surrogate's variance over the box each parameter makes.

    Returns
    -------
    DataFrame
        A row per parameter: parameter, first_order and total (Sobol' indices, Saltelli et al. 2010), length (of the
        kernel, in parts of the range: the shorter, the more the score changes).
    """
    count = len(surrogate.bounds)
    found = sobol_indices(
        func=lambda x: surrogate.process.predict(x.T),
        n=INDEX_SAMPLES,
        dists=[uniform()] * count,
        rng=np.random.default_rng(surrogate.seed),
    )
    lengths = np.broadcast_to(surrogate.process.kernel_.k1.k2.length_scale, count)
    return pd.DataFrame(
        {
            "parameter": list(surrogate.bounds),
            "first_order": found.first_order,
            "total": found.total_order,
            "length": lengths,
        }
    )


def profiles(surrogate: Surrogate, best: Sequence[float]) -> pd.DataFrame:
    """Returns the surrogate along each parameter through the best values: parameter, value, mean, sd of the score."""
    parts = []
    at = in_unit_box(pd.DataFrame([best], columns=list(surrogate.bounds)), surrogate.bounds)[0]
    for index, name in enumerate(surrogate.bounds):
        points = np.tile(at, (GRID, 1))
        points[:, index] = np.linspace(0, 1, GRID)
        mean, sd = surrogate.process.predict(points, return_std=True)
        values = in_bounds(points, surrogate.bounds)[name]
        parts.append(pd.DataFrame({"parameter": name, "value": values, "mean": mean, "sd": sd}))
    return pd.concat(parts, ignore_index=True)


def _candidates(surrogate: Surrogate) -> Floats:
    rng = np.random.default_rng(surrogate.seed)
    dimension = len(surrogate.bounds)
    spread = qmc.Sobol(dimension, rng=rng).random(CANDIDATES)
    best = surrogate.points[surrogate.scores.argmin()]
    # as many near the best run, where the least is looked for
    near = np.clip(best + 0.1 * rng.standard_normal((CANDIDATES // 2, dimension)), 0, 1)
    return np.vstack([spread, near])


def _drawn_minima(surrogate: Surrogate, points: Floats) -> Floats:
    """Returns the (draws, d) places where functions drawn from the surrogate at the points are least."""
    mean, covariance = surrogate.process.predict(points, return_cov=True)
    # a small addition to the diagonal keeps the factorisation possible where points are nearly equal
    jitter = 1e-9 * float(np.trace(covariance)) / len(points) + 1e-300
    for _ in range(8):
        try:
            factor = np.linalg.cholesky(covariance + jitter * np.eye(len(points)))
            break
        except np.linalg.LinAlgError:
            jitter *= 10
    else:
        raise ValueError("the covariance of the surrogate is not positive definite")
    draws = np.random.default_rng(surrogate.seed).standard_normal((len(points), DRAWS))
    return points[(mean[:, None] + factor @ draws).argmin(axis=0)]
