"""Distance between two surfaces, for example a simulated and a real brain of the same week."""

import logging

import igl
import numpy as np
import pandas as pd

from ..geometry.triangles import Floats, TriangleMesh, transformed, vertex_areas
from .alignment import SAME_POSE_DEG, centroid, rigid_alignment

log = logging.getLogger(__name__)

SURE_MARGIN = 1.1
"""Where another pose is less far off than this many times the distance, the pose is doubtful."""


def brain_distances(simulated: dict[str, TriangleMesh], real: dict[str, TriangleMesh]) -> pd.DataFrame:
    """Returns the distances between two brains: a row per part (such as whole, left and right) and metric.

    Each part is aligned by itself. Columns hemisphere, metric, value, unit; the metrics are those of
    `surface_distance`.
    """
    rows = []
    for part, mesh in simulated.items():
        # the names end in their unit
        for name, value in surface_distance(mesh, real[part], name=part).items():
            rows.append((part, *name.rsplit("_", 1), value))
    return pd.DataFrame(rows, columns=["hemisphere", "metric", "unit", "value"])[
        ["hemisphere", "metric", "value", "unit"]
    ]


def surface_distance(a: TriangleMesh, b: TriangleMesh, *, name: str = "surface") -> dict[str, float]:
    """Returns the distances in mm between two surfaces in RAS+ mm, `a` moved rigidly onto `b` first.

    The keys are symmetric_mean_mm, the mean over both directions of the area-weighted mean distance to the other
    surface; hausdorff95_mm, the larger of the two 95 % quantiles; rotation_deg and shift_mm (of the centroid), the
    motion of the alignment; pose_margin_1, the margin of `alignment.Alignment`. Where the pose is doubtful, that is
    logged under the `name` of the surfaces.
    """
    alignment = rigid_alignment(a, b)
    moved = transformed(a, alignment.matrix)
    ways = [(distances(moved, b), vertex_areas(moved)), (distances(b, moved), vertex_areas(b))]
    if alignment.rotation_deg > SAME_POSE_DEG:
        log.warning("%s: fits best when turned by %.0f degrees; is the pose right?", name, alignment.rotation_deg)
    if alignment.margin < SURE_MARGIN:
        log.warning("%s: the pose is doubtful, another has %.2f times the distance", name, alignment.margin)
    return {
        "symmetric_mean_mm": float(np.mean([np.average(way, weights=areas) for way, areas in ways])),
        "hausdorff95_mm": max(
            float(np.quantile(way, 0.95, weights=areas, method="inverted_cdf")) for way, areas in ways
        ),
        "rotation_deg": alignment.rotation_deg,
        "shift_mm": float(np.linalg.norm(centroid(moved) - centroid(a))),
        "pose_margin_1": alignment.margin,
    }


def distances(points_of: TriangleMesh, mesh: TriangleMesh) -> Floats:
    """Returns the (n,) distances in mm from the vertices of one surface to the other surface."""
    squared, _, _ = igl.point_mesh_squared_distance(points_of.vertices, mesh.vertices, mesh.faces)
    return np.sqrt(squared)
