"""Calibration: designs of its rounds, the scores of their runs, and a surrogate that says where the least may be."""

import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
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

from ..geometry.triangles import Floats, TriangleMesh, area, signed_volume
from ..settings.terms import AMPLITUDE, STIFFNESS_RATIO, Score
from .placement import MEASURES, correlation, interpolate_measures
from .shapes import PreparedSurface, curvature_differences

DIGITS = 6
"""Significant digits of calibrated values."""
CANDIDATES = 1024
"""Points of a Sobol sequence at which the surrogate is looked at."""
APART = 0.02
"""Least distance of runs of a round from each other and from earlier runs, in the unit box."""


def sobol_design(bounds: Mapping[str, Sequence[float]], count: int, seed: int) -> pd.DataFrame:
    """Spread `count` rows of values evenly over the box of the bounds: a scrambled Sobol sequence.

    The same seed gives the same rows. Source: Sobol 1967; Owen 1998 for the scrambling.
    """
    # the sequence is balanced over powers of two; its first rows are taken
    power = int(np.ceil(np.log2(max(count, 2))))
    points = qmc.Sobol(len(bounds), rng=np.random.default_rng(seed)).random_base2(power)[:count]
    return in_bounds(points, bounds)


def in_bounds(points: Floats, bounds: Mapping[str, Sequence[float]]) -> pd.DataFrame:
    """Scale (n, d) points of the unit box to values between the bounds, in columns of the parameters' names."""
    low, high = np.transpose(list(bounds.values()))
    values = low + points * (high - low)
    return pd.DataFrame(values, columns=list(bounds)).map(lambda value: float(f"{value:.{DIGITS}g}"))


def in_unit_box(values: pd.DataFrame, bounds: Mapping[str, Sequence[float]]) -> Floats:
    """Scale rows of values to (n, d) points of the unit box."""
    low, high = np.transpose(list(bounds.values()))
    return np.asarray((values[list(bounds)].to_numpy(dtype=float) - low) / (high - low))


def calibrated_parameters(base: Mapping[str, Any], values: Mapping[str, float], week: float) -> dict[str, Any]:
    """Return the content of `params.yaml` of a run of a calibration, which ends at a week.

    Parameters
    ----------
    base
        Content of that of the base run.
    values
        By parameter: a key with dots for inner ones, `stiffness_ratio`, or `KEY.amplitude`, which scales a curve.
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


def size_score(simulated: TriangleMesh, real: TriangleMesh) -> float:
    """Return √(a² + v²) with a, v the relative differences in area and volume of two closed surfaces as they are."""
    return float(np.hypot(area(simulated) / area(real) - 1, signed_volume(simulated) / signed_volume(real) - 1))


SIZE_SCORES: dict[Score, Callable[[TriangleMesh, TriangleMesh], float]] = {"size": size_score}
"""Those scores that compare closed surfaces, simulated and real, as they are."""


def shape_scores(run: PreparedSurface, real: PreparedSurface, names: Collection[Score]) -> dict[Score, float]:
    """Score shapes that are ready and laid onto each other by those of `names` that compare such.

    shape_index and mean_curvature are 1 − r of `placement.placement`, curvature_distribution is
    curvature_distance_per_mm of `shapes.curvature_differences`.
    """
    values, _ = interpolate_measures(run, real)
    scores = {measure: 1 - correlation(getattr(real, measure), values[measure], real.areas) for measure in MEASURES}
    scores["curvature_distribution"] = curvature_differences(run, real)["curvature_distance_per_mm"]
    return {name: scores[name] for name in names}


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
