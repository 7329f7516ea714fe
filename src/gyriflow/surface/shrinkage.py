"""The volume that smoothing takes, given back, and what smoothing did to volume and area."""

import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.remeshing import self_intersecting_faces
from ..geometry.triangles import TriangleMesh, area, signed_volume, vertex_areas, vertex_normals
from ..units import CM2_PER_MM2, ML_PER_MM3
from .outcome import faults

log = logging.getLogger(__name__)

# smoothing keeps the volume to this part
KEPT = 0.01
# beyond this it has taken structures, not rounded them, and moving the whole surface would not bring them back
MOST_GIVEN_BACK = 0.05
ROUNDS = 2
# how many times walls that would cut each other are held back, with their neighbours
HELD_BACK = 4


def after_repairs(mask_mm3: float, topology: dict[str, Any], affine: NDArray[np.float64]) -> float:
    """Returns the volume in mm³ of a mask after the repairs of its topology, with voxels of a (4, 4) affine."""
    voxels = sum(topology[f"voxels_{key}"] for key in ("filled", "filled_in_tunnels"))
    voxels -= sum(topology[f"voxels_{key}"] for key in ("dropped", "cut_from_bridges"))
    return mask_mm3 + voxels * float(abs(np.linalg.det(affine[:3, :3])))


def with_volume(mesh: TriangleMesh, volume_mm3: float, area_mm2: float) -> tuple[TriangleMesh, dict[str, Any]]:
    """Returns a closed surface set along its normals so that it encloses a volume, and a report in plain values.

    Smoothing and remeshing draw a convex surface inwards by some hundredths of a mm: ΔV/A is given back. Walls so near
    to each other that they would cut stay where they are. So does the whole surface where more than 5 % of the volume
    is missing, or where it would cut itself even so.

    Parameters
    ----------
    volume_mm3
        Volume of the mask.
    area_mm2
        Area of the mask's isosurface before it was smoothed and remeshed.
    """
    before = signed_volume(mesh) / volume_mm3 - 1.0
    moved = _set_along_normals(mesh, volume_mm3) if abs(before) <= MOST_GIVEN_BACK else mesh
    change = signed_volume(moved) / volume_mm3 - 1.0
    report = {
        "volume_expected_mL": volume_mm3 * ML_PER_MM3,
        "volume_change": change,
        "volume_change_before_correction": before,
        "area_before_cm2": area_mm2 * CM2_PER_MM2,
        "area_change": area(moved) / area_mm2 - 1.0,
    }
    log.info("volume changed by %.2f %%, area by %.2f %% through smoothing", 100 * change, 100 * report["area_change"])
    return moved, report


def _set_along_normals(mesh: TriangleMesh, volume_mm3: float) -> TriangleMesh:
    """Returns the surface set along its normals to a volume, but for walls that would cut; unmoved where others do."""
    free = np.ones(len(mesh.vertices), dtype=bool)
    for _ in range(HELD_BACK + 1):
        moved = mesh
        for _ in range(ROUNDS):
            share = float(vertex_areas(moved)[free].sum())
            offset = (volume_mm3 - signed_volume(moved)) / share * free
            moved = TriangleMesh(moved.vertices + offset[:, None] * vertex_normals(moved), moved.faces)
        if not (cutting := self_intersecting_faces(moved)).any():
            break
        near = np.isin(mesh.faces, mesh.faces[cutting]).any(axis=1)
        free[mesh.faces[near]] = False
        if not free.any():
            return mesh
    return mesh if faults(moved) else moved
