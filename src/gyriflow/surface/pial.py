"""A brain's pial surface from each kind of input, posed in RAS+ mm: the calls of the surface stage."""

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    euler_number,
    face_components,
    mean_edge_length,
    signed_volume,
    transformed,
)
from gyriflow.surface.extraction import cropped, isosurface, main_parts, shifted_affine, smoothed_mask
from gyriflow.surface.hemispheres import split
from gyriflow.surface.labels import LabelScheme, cerebrum_mask
from gyriflow.surface.orientation import MidPlane, mid_plane, upright
from gyriflow.surface.repair import remeshed, self_intersections, smoothed
from gyriflow.surface.topology import unambiguous, without_handles
from gyriflow.units import CM2_PER_MM2, ML_PER_MM3

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class PialSurface:
    """A posed pial surface in RAS+ mm.

    Attributes
    ----------
    whole
        The closed, outward surface of the brain: one piece, or one for each hemisphere.
    left, right
        The hemispheres' parts of it, open where a connected brain is cut at the fissure.
    fissure_x_mm
        Where the interhemispheric fissure is.
    report
        What was found and done, in plain values for JSON.
    """

    whole: TriangleMesh
    left: TriangleMesh
    right: TriangleMesh
    fissure_x_mm: float
    report: dict[str, Any]


def from_labels(
    labels: NDArray[np.integer],
    affine: NDArray[np.float64],
    scheme: LabelScheme,
    *,
    week: float,
    smoothing_voxels: float = 1.0,
    edge_length_mm: float = 1.0,
    smoothing_iterations: int = 10,
    max_hole_mm: float = 3.0,
) -> PialSurface:
    mask, first = cropped(cerebrum_mask(labels, scheme))
    affine = shifted_affine(affine, first)
    field = smoothed_mask(mask, smoothing_voxels)
    kept, parts, voxels = main_parts(field > 0.5)
    field = np.where(kept, np.maximum(field, 0.501), np.minimum(field, 0.499)).astype(np.float32)
    repair = without_handles(field)
    raw = isosurface(unambiguous(repair.field), affine)
    clean = remeshed(smoothed(raw, smoothing_iterations), edge_length_mm)
    plane = mid_plane(raw)
    return _posed(clean, plane, {"source": "labels"})


def _posed(mesh: TriangleMesh, plane: MidPlane, report: dict[str, Any]) -> PialSurface:
    matrix, angle = upright(plane, mesh.vertices.mean(axis=0))
    whole = transformed(mesh, matrix)
    on_plane = matrix[:3, :3] @ (plane.offset * plane.normal) + matrix[:3, 3]
    # on a plane that stayed slightly tilted, where it passes the brain's centre
    normal = matrix[:3, :3] @ plane.normal
    centre = whole.vertices.mean(axis=0)
    fissure = float((normal @ on_plane - normal[1:] @ centre[1:]) / normal[0])
    left, right = split(whole, fissure)
    report |= {
        "pose": matrix.tolist(), "rotation_deg": angle, "fissure_x_mm": fissure, 
        "fissure_points": plane.fissure_points, "fissure_scatter_mm": plane.scatter_mm, "asymmetry_mm": plane.asymmetry_mm,
        "area_cm2": {n: area(m) * CM2_PER_MM2 for n, m in (("whole", whole), ("left", left), ("right", right))},
        "volume_mL": signed_volume(whole) * ML_PER_MM3,
        "euler_number": euler_number(whole),
        "self_intersections": self_intersections(whole),
    }
    return PialSurface(whole, left, right, fissure, report)
