"""What chance gives: maps rotated over the brain (spins), which keep their smoothness and lose their place."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..geometry.triangles import Floats
from .placement import correlation

MIRROR = np.diag([-1.0, 1.0, 1.0])


def spins(count: int, seed: int) -> Floats:
    """Returns (count, 3, 3) rotations drawn evenly from all (Alexander-Bloch et al. 2018)."""
    return np.asarray(Rotation.random(count, random_state=np.random.default_rng(seed)).as_matrix())


def spun(points: Floats, values: NDArray, rotation: Floats, right: NDArray[np.bool_] | None = None) -> NDArray:
    """Returns (n,) or (n, k) values at points of a surface or of a solid, rotated over it.

    The points are taken into a ball: about their middle, each axis in units of its half extent. Each takes the value
    of the point nearest to where the inverse rotation leads. Where the (n,) mask `right` is given, either hemisphere is
    a ball of its own and the right one is rotated as in a mirror, so that symmetric maps stay symmetric.
    """
    moved = np.array(values, copy=True)
    sides = [np.ones(len(points), dtype=bool)] if right is None else [~right, right]
    for side, turn in zip(sides, (rotation, MIRROR @ rotation @ MIRROR), strict=False):
        low, high = points[side].min(axis=0), points[side].max(axis=0)
        ball = (points[side] - (low + high) / 2) / ((high - low) / 2)
        _, nearest = cKDTree(ball).query(ball @ turn)
        moved[side] = values[side][nearest]
    return moved


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
