"""Designs of a calibration: runs spread over the bounds of its parameters, and the parameters of each run."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import qmc

from ..parameters.terms import AMPLITUDE, STIFFNESS_RATIO

Floats = NDArray[np.float64]
DIGITS = 6
"""Significant digits of calibrated values."""


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
