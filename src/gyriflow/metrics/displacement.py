"""Norms of the displacement between weeks of a folding run."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ..errors import InputError
from ..geometry.triangles import Floats, Ints


def weekly_norms(weeks: Sequence[float], positions: Sequence[Floats], pial: Ints) -> pd.DataFrame:
    """Returns the largest and the mean length of the displacement between successive weeks, as in the paper's table.

    Parameters
    ----------
    weeks
        Gestational weeks of the positions, ascending.
    positions
        Per week the (n, 3) positions of the same nodes in mm.
    pial : (k,) int
        Indices of the nodes on the pial surface.

    Returns
    -------
    DataFrame
        from_week, to_week, nodes ("all" or "pial"), max_mm, mean_mm; two rows per pair of weeks. Means are over nodes.

    InputError where weeks and positions do not go together.
    """
    if len(weeks) != len(positions):
        raise InputError("each week needs its positions", found=f"{len(weeks)} weeks, {len(positions)} positions")
    if (np.diff(weeks) <= 0).any():
        raise InputError("weeks are not ascending", found=list(weeks))
    shapes = {np.shape(nodes) for nodes in positions}
    if len(shapes) > 1:
        raise InputError("positions of different nodes", found=sorted(shapes), expected="the same nodes in every week")
    rows = []
    for i in range(1, len(weeks)):
        length = np.linalg.norm(np.asarray(positions[i]) - np.asarray(positions[i - 1]), axis=1)
        for nodes, of in (("all", length), ("pial", length[pial])):
            rows.append((weeks[i - 1], weeks[i], nodes, of.max(), of.mean()))
    return pd.DataFrame(rows, columns=["from_week", "to_week", "nodes", "max_mm", "mean_mm"])
