"""What the surface stage hands on: a posed surface with its report, refused where it is not sound."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import MeshError
from ..geometry.remeshing import self_intersecting_faces
from ..geometry.triangles import TriangleMesh, area, euler_number, is_closed, mean_edge_length, signed_volume
from ..units import CM2_PER_MM2, ML_PER_MM3
from .repair import pieces


@dataclass(frozen=True, eq=False)
class PialSurface:
    """A posed pial surface in RAS+ mm.

    Attributes
    ----------
    whole
        The closed, outward surface of the brain: one piece, or one for each hemisphere.
    left, right
        The hemispheres' parts of it, open where a connected brain is cut at the fissure; None for one that is not
        there.
    fissure_x_mm
        Where the interhemispheric fissure is: the plane x = const between the hemispheres.
    report
        What was found and done, in plain values for JSON.
    """

    whole: TriangleMesh
    left: TriangleMesh | None
    right: TriangleMesh | None
    fissure_x_mm: float
    report: dict[str, Any]


def describe(
    whole: TriangleMesh,
    left: TriangleMesh | None,
    right: TriangleMesh | None,
    fissure_x: float,
    report: dict[str, Any],
    week: float,
) -> PialSurface:
    """Returns the surface with what was measured on it added to the report."""
    parts = {"whole": whole, "left": left, "right": right}
    report |= {
        "week": week,
        "fissure_x_mm": fissure_x,
        "area_cm2": {name: area(part) * CM2_PER_MM2 for name, part in parts.items() if part},
        "volume_mL": signed_volume(whole) * ML_PER_MM3,
        "extents_mm": np.ptp(whole.vertices, axis=0).tolist(),
        "vertices": len(whole.vertices),
        "faces": len(whole.faces),
        "mean_edge_mm": mean_edge_length(whole),
        "pieces": len(pieces(whole)),
        "euler_number": euler_number(whole),
    }
    report.setdefault("warnings", [])
    return PialSurface(whole, left, right, fissure_x, report)


def require_sound(mesh: TriangleMesh) -> None:
    """Raises MeshError where the surface is not made of closed spheres without intersections."""
    found = faults(mesh)
    if found:
        raise MeshError(
            "the surface could not be made good",
            found=found,
            expected="closed pieces of Euler number 2 that do not cut themselves",
            remedy="Look at the labels or the surface there; more smoothing or shorter edges may help.",
        )


def faults(mesh: TriangleMesh) -> str:
    """Returns what keeps the surface from being closed spheres without intersections; empty where nothing does."""
    euler = [euler_number(piece) for piece in pieces(mesh)]
    cutting = int(self_intersecting_faces(mesh).sum())
    found = [
        "edges without two faces" if not is_closed(mesh) else "",
        f"Euler numbers {euler}" if any(number != 2 for number in euler) else "",
        f"{cutting} faces that cut others" if cutting else "",
    ]
    return ", ".join(fault for fault in found if fault)
