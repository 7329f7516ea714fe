"""What chance gives: maps rotated over the brain (spins), which keep their smoothness and lose their place."""

import numpy as np
from numpy.typing import NDArray

from ..geometry.spins import spins, spun
from ..geometry.triangles import Floats
from .placement import correlation


def spin_test(
    points: Floats,
    areas: Floats,
    truth: Floats,
    values: Floats,
    *,
    count: int,
    seed: int,
    right: NDArray[np.bool_] | None = None,
) -> dict[str, float]:
    """Returns r of (n,) values with the truth, null_mean and null_q95 of r for spun values, and p of r among them.

    p is (1 + number of spins with r as large)/(1 + spins).
    """
    r = correlation(truth, values, areas)
    null = np.array([correlation(truth, spun(points, values, turn, right), areas) for turn in spins(count, seed)])
    return {
        "r": r,
        "null_mean": float(np.nanmean(null)),
        "null_q95": float(np.nanquantile(null, 0.95)),
        "p": float((1 + np.count_nonzero(null >= r)) / (1 + count)),
    }
