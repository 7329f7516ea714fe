"""A Gaussian process through the scores of a calibration's runs: where it expects the least, and how sure it is."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.optimize import minimize
from scipy.stats import norm, qmc
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from .design import Floats, in_bounds, in_unit_box

CANDIDATES = 1024
"""Points of a Sobol sequence at which the surrogate is looked at."""
APART = 0.02
"""Least distance of runs of a round from each other and from earlier runs, in the unit box."""


@dataclass(frozen=True, eq=False)
class Surrogate:
    """A Gaussian process over the unit box of the bounds, the lowest and highest value by parameter.

    The process is fitted, with a Matérn kernel (ν = 5/2), a length for each parameter, and noise, to (n, d) points with
    (n,) scores: a diverged run has one worse than all others. The seed is that of the candidates.
    """

    process: GaussianProcessRegressor
    bounds: Mapping[str, Sequence[float]]
    points: Floats
    scores: Floats
    seed: int


def fit(runs: pd.DataFrame, bounds: Mapping[str, Sequence[float]], seed: int) -> Surrogate:
    """Fit the surrogate to the runs of a calibration: columns of the parameters, score (NaN: has diverged)."""
    points, scores = in_unit_box(runs, bounds), np.asarray(runs["score"], dtype=float)
    finished = scores[np.isfinite(scores)]
    if len(finished) < 2:
        raise ValueError(f"{len(finished)} runs with a score; a surrogate needs two or more")
    # a wall that the surrogate can follow: as far above the worst as that is above the best
    scores = np.where(np.isfinite(scores), scores, 2 * finished.max() - finished.min())
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
    """Choose the values of the next `count` runs: where the score is expected to improve the most.

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
        believer = GaussianProcessRegressor(surrogate.process.kernel_, optimizer=None, normalize_y=True)
        process = believer.fit(points, scores)
    return in_bounds(np.array(chosen), surrogate.bounds)


def expected_improvement(process: GaussianProcessRegressor, points: Floats, best: float) -> Floats:
    """Return by how much (n, d) points are expected to be below the best score (Jones, Schonlau and Welch 1998)."""
    mean, sd = process.predict(points, return_std=True)
    sd = np.maximum(sd, 1e-12)
    gain = best - mean
    return np.asarray(gain * norm.cdf(gain / sd) + sd * norm.pdf(gain / sd))


def optimum(surrogate: Surrogate) -> pd.DataFrame:
    """Find the parameters where the surrogate is least.

    Returns
    -------
    DataFrame
        A row per parameter: parameter, value, lowest, highest (the bounds), at_bound (whether the value is within 1 %
        of one), score, score_sd (mean and standard deviation of the surrogate there).
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
            "value": in_bounds(best[None], surrogate.bounds).iloc[0].to_numpy(),
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
    spread = qmc.Sobol(dimension, rng=rng).random(CANDIDATES)
    best = surrogate.points[surrogate.scores.argmin()]
    # as many near the best run, where the least is looked for
    near = np.clip(best + 0.1 * rng.standard_normal((CANDIDATES // 2, dimension)), 0, 1)
    return np.vstack([spread, near])
