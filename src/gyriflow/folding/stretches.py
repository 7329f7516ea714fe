"""Deformation gradients of elements, and their stretches."""

import numpy as np
from numpy.typing import NDArray

from ..geometry.jacobians import chunks
from ..geometry.triangles import Floats

MIN_SQUARED_STRETCH = 1e-6
"""Squared principal stretches below this count as this: those of flat elements."""


def deformation_gradients(before: Floats, after: Floats, cells: NDArray[np.integer], slopes: Floats) -> Floats:
    """Return the (c, q, 3, 3) deformation gradients F = ∂x_after/∂x_before of tetrahedra at points inside them.

    Positions of the nodes are (k, 3) in one unit, `cells` (c, n) their indices; the elements have a volume before.
    `slopes` (q, n, 3) are the gradients of the nodes' shape functions in the regular element, at the points.
    """
    found = np.empty((len(cells), len(slopes), 3, 3))
    across = slopes.transpose(0, 2, 1)
    for chunk in chunks(len(cells)):
        # the transposed maps from the regular element: those after = those before · Fᵀ
        first, second = (np.matmul(across, x[cells[chunk]][:, None]) for x in (before, after))
        found[chunk] = np.linalg.solve(first, second).swapaxes(-1, -2)
    return found


def inverse_stretch(F: Floats, power: Floats | float = 1.0, limit: float = np.inf) -> tuple[Floats, NDArray[np.bool_]]:
    """Return U^−power (..., 3, 3) of F = R·U, with one power for all or one for each, and where U is limited.

    Principal values of ln U beyond the `limit` count as this.
    """
    squares, axes = np.linalg.eigh(F.swapaxes(-1, -2) @ F)
    logs = 0.5 * np.log(np.maximum(squares, MIN_SQUARED_STRETCH))
    scale = np.exp(-np.asarray(power)[..., None] * np.clip(logs, -limit, limit))
    inverse = (axes * scale[..., None, :]) @ axes.swapaxes(-1, -2)
    return np.asarray(inverse), np.abs(logs).max(axis=-1) > limit


def log_stretch(F: Floats, *, left: bool = False, limit: float = np.inf) -> Floats:
    """Return the Hencky strain (..., 3, 3): ln U of F = R·U, in axes before F, or the `left` ln V of F = V·R.

    Principal values beyond the `limit` count as this.
    """
    turned = F.swapaxes(-1, -2)
    squares, axes = np.linalg.eigh(F @ turned if left else turned @ F)
    logs = np.clip(0.5 * np.log(np.maximum(squares, MIN_SQUARED_STRETCH)), -limit, limit)
    return np.asarray((axes * logs[..., None, :]) @ axes.swapaxes(-1, -2))
