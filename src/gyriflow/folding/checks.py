"""Checks of a run before its first step: a report on its zones, warnings, refusals."""

import numpy as np
from scipy.spatial import cKDTree

from ..errors import InputError, MeshError
from ..geometry.jacobians import EDGES, lower_bounds
from ..geometry.tetrahedra import TetrahedralMesh, connected_parts
from ..geometry.triangles import TriangleMesh, edge_lengths, edges, face_areas
from ..settings.terms import BASE, CLAMPED, MEDIAL_WALL, ZONE_NAMES
from .zones import Zones

MAX_POISSON_RATIO = 0.46
"""Poisson's ratio above which linear elements are clearly too stiff. With two of them
through the cortex, the fastest-growing wave of a slab grows 32 % too slowly at 0.45, 40
% at 0.48, 47 % at 0.49 and 69 % at 0.499, where a wave of another length is the
fastest."""


def zone_report(
    mesh: TetrahedralMesh,
    zones: Zones,
    thickness_mm: float,
) -> dict:
    """Return a report on the zones.

    It contains the facets and area of each zone, the clamped share of each hemisphere,
    the order of the elements, the initial penetration of the planes in mm (0 by
    construction), and the number of elements through the cortex.
    """
    areas = face_areas(TriangleMesh(mesh.vertices, zones.facets))
    by_zone = {}
    for number, name in enumerate(ZONE_NAMES):
        is_in_zone = zones.facet_zone == number
        by_zone[name] = {
            "facets": int(is_in_zone.sum()),
            "area_mm2": float(areas[is_in_zone].sum()),
        }
    centroid_x = mesh.vertices[zones.facets, 0].mean(axis=1)
    is_left = centroid_x < zones.fissure_x_mm
    is_clamped = np.isin(zones.facet_zone, (CLAMPED, BASE))
    clamped_share = {}
    for side, is_on_side in {"left": is_left, "right": ~is_left}.items():
        total = areas[is_on_side].sum()
        clamped = areas[is_clamped & is_on_side].sum()
        clamped_share[side] = float(clamped / total) if total else 0.0
    edge_mm = _edge_length_within(mesh, zones, thickness_mm)
    return {
        "zones": by_zone,
        "clamped_share": clamped_share,
        "order": mesh.order,
        "initial_penetration_mm": zones.penetration_mm(mesh.vertices),
        "elements_through_cortex": thickness_mm / edge_mm,
    }


def _edge_length_within(
    mesh: TetrahedralMesh,
    zones: Zones,
    thickness_mm: float,
) -> float:
    """Return the mean edge length in mm of the elements whose centroid is in the
    cortex, or of all if none is."""
    centroids = sum(mesh.vertices[corners] for corners in mesh.corners.T) / 4
    pial = np.unique(zones.cortex_facets)
    depth, _ = cKDTree(mesh.vertices[pial]).query(centroids)
    cortex = mesh.corners[depth <= thickness_mm]
    if not len(cortex):
        cortex = mesh.corners
    lengths = [edge_lengths(mesh.vertices, cortex[:, pair]).mean() for pair in EDGES]
    return float(np.mean(lengths))


def refuse_impossible(mesh: TetrahedralMesh, zones: Zones) -> None:
    """Raise an error for a brain that cannot be folded with these zones.

    InputError if nothing grows, no facet has cortex, no facet is clamped, or the
    fissure lies outside the brain; MeshError if elements are inverted, the surface is
    not closed, or a part has no clamped facet and would float.
    """
    if mesh.order == 2:
        folded = np.flatnonzero(lower_bounds(mesh.vertices, mesh.tets) <= 0)
        if len(folded):
            place = np.round(
                mesh.vertices[mesh.corners[folded[0]]].mean(axis=0), 1
            ).tolist()
            count = f"{len(folded)} of {len(mesh.tets)}, one at {place} mm"
            raise MeshError("the mesh has inverted curved elements", found=count)
    low, high = mesh.vertices[:, 0].min(), mesh.vertices[:, 0].max()
    single_hemisphere = (zones.facet_zone == MEDIAL_WALL).any()
    if not single_hemisphere and not low < zones.fissure_x_mm < high:
        raise InputError(
            "the fissure lies outside the brain",
            found=f"fissure_x_mm {zones.fissure_x_mm:.2f}",
            expected=f"a value between {low:.2f} and {high:.2f} mm",
        )
    _, uses = edges(TriangleMesh(mesh.vertices, zones.facets))
    if (uses % 2).any():
        raise MeshError(
            "the boundary of the mesh is not closed",
            found=f"{int((uses % 2).sum())} open edges",
        )
    if not len(zones.cortex_facets):
        raise InputError(
            "no facet has cortex under it", remedy="Choose another folding.support."
        )
    if not (zones.growing > 0).any():
        raise InputError(
            "no vertex grows",
            remedy="Choose another folding.support.",
        )
    if zones.free:
        return
    # a sliding wall supports a hemisphere too
    clamped = zones.vertices_of(
        CLAMPED, BASE, *((MEDIAL_WALL,) if zones.anchors else ())
    )
    if not len(clamped):
        raise InputError(
            "no facet is clamped, so the brain would drift",
            expected="pial facets inside the ellipsoid, or another folding.support",
        )
    part = connected_parts(mesh)
    parts = part.max() + 1
    floating = np.setdiff1d(np.arange(parts), part[clamped])
    if len(floating):
        detached = (
            f"{len(floating)} of {parts} parts, the largest with"
            f" {np.bincount(part)[floating].max()} vertices"
        )
        raise MeshError(
            "parts of the brain have no clamped facet and would float", found=detached
        )


def stiffness_warning(poisson_ratio: float) -> str:
    """Return a warning if linear elements are too stiff for a Poisson's ratio, else an
    empty text."""
    if poisson_ratio <= MAX_POISSON_RATIO:
        return ""
    return (
        f"folding.poisson_ratio is {poisson_ratio:g}: above {MAX_POISSON_RATIO:g}"
        " linear elements lock, and folds grow too slowly and with wrong wavelengths"
        " (docs/verification.md); use quadratic ones (mesh.order: 2)"
    )
