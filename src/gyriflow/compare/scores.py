"""Scores of a calibration: how far a simulated brain is from a real one, each 0 where the two are the same."""

from collections.abc import Collection

import numpy as np

from ..geometry.triangles import TriangleMesh, area, signed_volume
from ..parameters.terms import Score
from .placement import MEASURES, correlation, values_on
from .shapes import Shape, against_real


def size_score(simulated: TriangleMesh, real: TriangleMesh) -> float:
    """Return √(a² + v²) with a, v the relative differences in area and volume of two closed surfaces as they are."""
    return float(np.hypot(area(simulated) / area(real) - 1, signed_volume(simulated) / signed_volume(real) - 1))


def shape_scores(run: Shape, real: Shape, names: Collection[Score]) -> dict[Score, float]:
    """Score shapes that are ready and laid onto each other by those of `names` that compare such.

    shape_index and mean_curvature are 1 − r of `placement.placement`, curvature_distribution is
    curvature_distance_per_mm of `shapes.against_real`.
    """
    scores: dict[Score, float] = {}
    if set(MEASURES) & set(names):
        values, _ = values_on(real, run)
        for measure in MEASURES:
            if measure in names:
                r = correlation(getattr(real, measure), values[measure], real.areas)
                scores[measure] = 1 - r  # type: ignore[index]
    if "curvature_distribution" in names:
        scores["curvature_distribution"] = against_real(run, real)["curvature_distance_per_mm"]
    return scores
