"""Maps rotated over a brain (spins): they keep their smoothness and lose their place."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from .triangles import Floats

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
