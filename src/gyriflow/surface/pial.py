"""What the surfaces of all kinds of brains go through: even triangles, a pose, two sides, measures."""

import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.triangles import TriangleMesh, area, transformed
from .even_triangles import make_even
from .hemispheres import DOUBTFUL_RATIO, cut_sides, split
from .orientation import MidPlane, upright
from .outcome import PialSurface, describe, faults, require_sound
from .rebuilding import rebuild

log = logging.getLogger(__name__)

# beyond this part of the brain's width the mid-sagittal plane is doubtful
DOUBTFUL_ASYMMETRY = 0.03
# a loss beyond this fraction of a brain is reported
TOLD_LOSS = 0.005


def from_shape(mesh: TriangleMesh, *, week: float) -> PialSurface:
    """Returns a simple geometry as it is, in the place of a brain: its left and right meet at x = 0.

    It has no fissure to be found and no size of its own, and smoothing would round its edges. MeshError where it is
    not closed or cuts itself.
    """
    require_sound(mesh)
    pose = {"pose": np.eye(4).tolist(), "rotation_deg": 0.0}
    return describe(mesh, *split(mesh, 0.0), 0.0, {"source": "shape", **pose}, week)


def make_sound(
    mesh: TriangleMesh, smoothing_iterations: int, edge_length_mm: float, report: dict[str, Any], name: str = "mesh"
) -> TriangleMesh:
    """Returns the surface smoothed and remeshed, each piece a sphere that does not cut itself.

    Where the triangles can't be repaired, the surface is rebuilt through voxels of half an edge length.
    """
    smooth, report[name] = make_even(mesh, smoothing_iterations, edge_length_mm)
    if faults(smooth):
        warn(report, f"the surface was rebuilt through voxels, since it had {faults(smooth)}")
        mesh, report[name.replace("mesh", "remade")] = rebuild(mesh, 0.5 * edge_length_mm)
        smooth, report[name] = make_even(mesh, smoothing_iterations, edge_length_mm)
    require_sound(smooth)
    return smooth


def pose_surface(
    mesh: TriangleMesh,
    is_left: NDArray[np.bool_],
    plane: MidPlane,
    report: dict[str, Any],
    week: float,
    rotation: NDArray[np.float64] | None = None,
) -> PialSurface:
    """Returns the surface with its mid-sagittal plane turned to x = const, its hemispheres and the whole report.

    `rotation` (3, 3) is what brought the file's coordinates to those of the surface; the report's pose is for those
    of the file.
    """
    matrix, angle = upright(plane, mesh.vertices.mean(axis=0))
    whole = transformed(mesh, matrix)
    left, right = cut_sides(whole, is_left)
    # where the plane, which may have kept a tilt below half a degree, passes the brain's centre
    normal = matrix[:3, :3] @ plane.normal
    offset = plane.offset + normal @ matrix[:3, 3]
    fissure_x = float((offset - normal[1:] @ whole.vertices.mean(axis=0)[1:]) / normal[0])
    width = float(np.ptp(whole.vertices[:, 0]))
    if plane.fissure_points == 0:
        warn(report, "no fissure was found between facing walls: its place is that of the plane of mirror symmetry")
    if plane.asymmetry_mm > DOUBTFUL_ASYMMETRY * width:
        warn(report, f"the brain is far from mirror-symmetric ({plane.asymmetry_mm:.1f} mm): check its pose")
    areas = sorted((area(left), area(right)))
    if areas[1] > DOUBTFUL_RATIO * areas[0]:
        warn(report, f"the hemispheres' areas differ by {100 * (areas[1] / areas[0] - 1):.0f} %: check the midline")
    report |= {
        "pose": (matrix @ motion(rotation)).tolist(),
        "rotation_deg": angle,
        "fissure_points": plane.fissure_points,
        "fissure_scatter_mm": plane.scatter_mm,
        "asymmetry_mm": plane.asymmetry_mm,
    }
    return describe(whole, left, right, fissure_x, report, week)


def motion(rotation: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Returns a (3, 3) rotation as a (4, 4) motion about the origin; the identity for None."""
    matrix = np.eye(4)
    if rotation is not None:
        matrix[:3, :3] = rotation
    return matrix


def warn(report: dict[str, Any], message: str) -> None:
    log.warning(message)
    report.setdefault("warnings", []).append(message)
