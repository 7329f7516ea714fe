"""The limits that a mesh has to keep: shape and size of its elements, and how well it keeps to the surface."""

from collections.abc import Mapping
from os import PathLike
from typing import Any

import numpy as np

from ..errors import MeshError
from ..geometry.tetrahedra import TetrahedralMesh, signed_volumes
from .quality import dihedral_angles, jacobian_ratios, radius_ratios


def refuse_bad_mesh(
    mesh: TetrahedralMesh,
    summary: Mapping[str, Any],
    path: str | PathLike[str] | None = None,
    *,
    min_radius_ratio: float,
    min_dihedral_deg: float,
    max_dihedral_deg: float,
    min_volume_mm3: float,
    min_jacobian_ratio: float,
    max_volume_change: float,
    max_surface_distance_mm: float,
    min_gap_kept: float,
) -> None:
    """Raises MeshError where a mesh with this `quality_summary` passes one of the limits, all of them named.

    For elements the message has the number of bad ones and the worst place. Faces of the mesh's surface that cross
    each other are always refused. `path` is for the message: where the mesh can be looked at.
    """
    faults = [
        *_bad_elements(mesh, min_radius_ratio, min_dihedral_deg, max_dihedral_deg, min_volume_mm3, min_jacobian_ratio),
        *_departures(summary, max_volume_change, max_surface_distance_mm, min_gap_kept),
    ]
    if faults:
        raise MeshError(
            "the mesh is not good enough",
            path=path,
            found="; ".join(found for found, _ in faults),
            expected="; ".join(expected for _, expected in faults),
            remedy="Mesh with another mesh.envelope_mm, other edge lengths or another mesh.mesher, or lower the gates "
            "of mesh.",
        )


def _bad_elements(
    mesh: TetrahedralMesh,
    least_ratio: float,
    least_angle: float,
    largest_angle: float,
    least_volume: float,
    least_jacobian: float,
) -> list[tuple[str, str]]:
    """Returns what was found and what was expected of elements, a pair for each limit that some of them pass."""
    ratio, angles, volume = radius_ratios(mesh), dihedral_angles(mesh), signed_volumes(mesh)
    jacobian = jacobian_ratios(mesh)
    sharp, blunt = angles.min(axis=1), angles.max(axis=1)
    angle = "dihedral angle in degrees"
    limits = [
        ("radius ratio", ratio, ratio < least_ratio, ratio.argmin(), f"at least {least_ratio:g}"),
        (angle, sharp, sharp < least_angle, sharp.argmin(), f"at least {least_angle:g}"),
        (angle, blunt, blunt > largest_angle, blunt.argmax(), f"at most {largest_angle:g}"),
        ("volume in mm3", volume, volume < least_volume, volume.argmin(), f"at least {least_volume:g}"),
        ("ratio of Jacobians", jacobian, jacobian < least_jacobian, jacobian.argmin(), f"at least {least_jacobian:g}"),
    ]
    faults = []
    for name, values, bad, worst, limit in limits:
        if bad.any():
            place = np.round(mesh.vertices[mesh.corners[worst]].mean(axis=0), 1).tolist()
            found = f"{int(bad.sum())} of {len(bad)} elements with {name} to {values[worst]:.4g} at {place} mm"
            faults.append((found, f"{name} {limit}"))
    return faults


def _departures(
    summary: Mapping[str, Any], largest_change: float, largest_distance: float, least_kept: float
) -> list[tuple[str, str]]:
    """Returns what was found and what was expected, a pair for each way in which the mesh left its surface too far."""
    change, distance = summary["volume_change"], summary["surface_distance_mm"]["hausdorff99"]
    faults = []
    if abs(change) > largest_change:
        found = f"a volume of {summary['volume_mm3']:.0f} mm3, {100 * change:+.1f} % against the surface's"
        faults.append((found, f"at most {100 * largest_change:g} % (mesh.max_volume_change)"))
    if distance > largest_distance:
        found = f"a surface {distance:.3f} mm from the one that was filled (99 % of it is nearer)"
        faults.append((found, f"at most {largest_distance:g} mm (mesh.max_surface_distance_mm)"))
    if summary["gap_kept"] is not None and summary["gap_kept"] < least_kept:
        found = f"narrow gaps, such as the fissure, open along {100 * summary['gap_kept']:.0f} % of their walls"
        faults.append((found, f"at least {100 * least_kept:g} % (mesh.min_gap_kept)"))
    if summary["crossing_faces"]:
        faults.append((f"{summary['crossing_faces']} faces of its surface that cross others", "none that cross"))
    return faults
