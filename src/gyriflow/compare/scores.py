"""Scores of a calibration: how far a simulated brain is from a real one, each 0 where the two are the same."""

from collections.abc import Collection

import numpy as np

from ..geometry.matching import match_points, values_at
from ..geometry.triangles import TriangleMesh, area, signed_volume, vertex_normals
from ..parameters.terms import Score
from .placement import MEASURES, correlation
from .shapes import Shape, against_real


def size_score(simulated: TriangleMesh, real: TriangleMesh) -> float:
    """Returns √(a² + v²) with a, v the relative differences in area and volume of two closed surfaces as they are."""
    return float(np.hypot(area(simulated) / area(real) - 1, signed_volume(simulated) / signed_volume(real) - 1))


def shape_scores(run: Shape, real: Shape, names: Collection[Score]) -> dict[Score, float]:
    """Returns the scores among `names` that compare shapes that are ready and laid onto each other.

    shape_index and mean_curvature are 1 − r of `placement.placement`, curvature_distribution is
    curvature_distance_per_mm of `shapes.against_real`.
    """
    found: dict[Score, float] = {}
    wanted = [measure for measure in MEASURES if measure in names]
    if wanted:
        match = match_points(real.mesh.vertices, vertex_normals(real.mesh), run.mesh)
        for measure in wanted:
            values = values_at(match, getattr(run, measure))
            found[measure] = 1 - correlation(getattr(real, measure), values, real.areas)  # type: ignore[index]
    if "curvature_distribution" in names:
        found["curvature_distribution"] = against_real(run, real)["curvature_distance_per_mm"]
    return found
