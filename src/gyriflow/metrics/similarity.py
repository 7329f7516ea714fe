"""How far two surfaces are from each other, for example a simulated and a real brain of a week, once aligned."""

import logging
from dataclasses import dataclass, replace

import igl
import numpy as np
import pandas as pd

from ..geometry.alignment import (
    CUBE_ROTATIONS,
    Effort,
    Fit,
    angle_deg,
    closest_points,
    fits_from_all_sides,
    margin,
    mean_distance,
    searched,
)
from ..geometry.triangles import Floats, TriangleMesh, area, corners, face_areas, transformed, vertex_areas

log = logging.getLogger(__name__)

CONVERGED_MM = 0.01

FULL = Effort(2000, 60, CONVERGED_MM)

FAIR = Effort(500, 30, 0.05)
"""For the few poses that are compared with each other."""

ROUGH = Effort(150, 10, 0.5)
"""For all poses, to find those few."""

CANDIDATES = 5
"""How many poses that differ from each other are compared."""

SAME_POSE_DEG = 30.0
"""Rotations that differ by less are one pose."""

CLEARLY_BETTER = 0.95
"""A pose other than that from the given one has to have a smaller share of its distance to be taken."""

SURE_MARGIN = 1.1
"""Where another pose is less far off than this many times the distance, the pose is doubtful."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """A rigid motion.

    Attributes
    ----------
    matrix : (4, 4) float
        Rotation and shift in mm.
    margin : float
        Mean distance between the surfaces in the best pose that is turned away from this one, over that in this one,
        both aligned in the same way. Near 1 the surfaces fit as well in another pose; infinity where there is no other.
    """

    matrix: Floats
    margin: float

    @property
    def rotation_deg(self) -> float:
        """The angle of the rotation."""
        return angle_deg(self.matrix[:3, :3])


def centroid(mesh: TriangleMesh) -> Floats:
    """Returns the (3,) area-weighted centroid in mm."""
    return face_areas(mesh) @ corners(mesh).mean(axis=1) / area(mesh)


def rigid_alignment(a: TriangleMesh, b: TriangleMesh) -> Alignment:
    """Returns the motion of `a` onto `b` with the least distance among those found from 24 poses.

    Iterative closest points find the nearest pose that fits, which need not be the best. They are therefore begun
    roughly from each rotation of a cube, the centroids together. The best few of these poses, and that from the
    surfaces as given, are aligned better and all alike, and compared. The last is kept unless another one is clearly
    better. The pose that is kept is aligned in full.
    """
    surfaces, centres = (searched(a), searched(b)), (centroid(a), centroid(b))

    def roughly(turn: Floats) -> Fit:
        return closest_points(*surfaces, Fit(turn, centres[1] - turn @ centres[0], np.inf), ROUGH)

    def better(fit: Fit) -> Fit:
        closer = closest_points(*surfaces, fit, FAIR)
        # of less than they are aligned to, distances say nothing
        distance = mean_distance(*surfaces, closer.rotation, closer.shift, FULL.points)
        return replace(closer, residual=max(distance, CONVERGED_MM))

    poses = fits_from_all_sides(CUBE_ROTATIONS, roughly, better, CANDIDATES, SAME_POSE_DEG)
    best = min(poses, key=lambda pose: pose.residual)
    chosen = best if best.residual < CLEARLY_BETTER * poses[0].residual else poses[0]
    fit = closest_points(*surfaces, chosen, FULL)
    return Alignment(fit.matrix, margin(poses, chosen, SAME_POSE_DEG))


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
    motion of the alignment; pose_margin_1, the margin of `Alignment`. Where the pose is doubtful, that is
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
