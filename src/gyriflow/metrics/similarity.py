"""How far two surfaces are from each other, for example a simulated and a real brain of a week, once aligned."""

import numpy as np
import pandas as pd

from ..geometry.alignment import fit_onto
from ..geometry.matching import nearest_on
from ..geometry.triangles import TriangleMesh, transformed, vertex_areas


def brain_distances(simulated: dict[str, TriangleMesh], real: dict[str, TriangleMesh]) -> pd.DataFrame:
    """Returns the distances between two brains: a row per part (such as whole, left and right) and metric.

    Each part is aligned by itself. Columns hemisphere, metric, value, unit; the metrics are those of
    `surface_distance`.
    """
    rows = [
        (part, metric, value, "mm")
        for part, mesh in simulated.items()
        for metric, value in surface_distance(mesh, real[part]).items()
    ]
    return pd.DataFrame(rows, columns=["hemisphere", "metric", "value", "unit"])


def surface_distance(a: TriangleMesh, b: TriangleMesh) -> dict[str, float]:
    """Returns the distances in mm between two surfaces in RAS+ mm, `a` moved rigidly onto `b` first.

    symmetric_mean is the mean over both directions of the area-weighted mean distance of the vertices to the other
    surface, hausdorff95 the larger of the two 95 % quantiles.
    """
    moved = transformed(a, fit_onto(a, b))
    ways = [(nearest_on(one.vertices, other)[0], vertex_areas(one)) for one, other in ((moved, b), (b, moved))]
    return {
        "symmetric_mean": float(np.mean([np.average(way, weights=areas) for way, areas in ways])),
        "hausdorff95": max(float(np.quantile(way, 0.95, weights=areas, method="inverted_cdf")) for way, areas in ways),
    }
