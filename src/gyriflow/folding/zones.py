"""Zones of the brain that hold through a run: contact facets, clamped facets, growth and no growth.

Set once, on the mesh at the start; plain NumPy, so that a picture of them needs no solver.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..errors import InputError, MeshError
from ..geometry.tetrahedra import TetrahedralMesh, boundary_faces
from ..geometry.triangles import TriangleMesh, edges, face_areas
from .layers import PialSearch
from .parameters import FoldingParameters

FREE, CLAMPED, LEFT_CONTACT, RIGHT_CONTACT, BETWEEN_PLANES = range(5)
MUCH_BETWEEN_PLANES = 0.05
"""Share of the pial area between the contact planes above which a user is warned."""
ZONE_NAMES = ("free", "clamped", "left contact", "right contact", "between planes")


@dataclass(frozen=True, eq=False)
class Zones:
    """The zones of a brain mesh.

    Attributes
    ----------
    facets : (f, 3) int
        Pial facets, outward, as vertex indices.
    facet_zone : (f,) int
        FREE, CLAMPED, LEFT_CONTACT, RIGHT_CONTACT or BETWEEN_PLANES.
    growth : (n,) float
        1 where tissue grows, 0 where it does not.
    fissure_x_mm : float
        Position of the interhemispheric fissure.
    planes_mm : (float, float)
        The plane that the left, and that the right hemisphere may not pass.
    """

    facets: NDArray[np.int64]
    facet_zone: NDArray[np.int64]
    growth: NDArray[np.float64]
    fissure_x_mm: float
    planes_mm: tuple[float, float]

    def vertices_of(self, zone: int) -> NDArray[np.int64]:
        """Returns the vertices of the facets of a zone, each once."""
        return np.unique(self.facets[self.facet_zone == zone])


def inside_ellipsoid(
    vertices: NDArray, shift_y: float, shift_z: float, semi_axes: tuple[float, float, float]
) -> NDArray[np.bool_]:
    """Returns which vertices lie in the ellipsoid of no growth; all parameters are fractions of the extents."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    extent = high - low
    centre = (low + high) / 2 + np.array([0.0, shift_y, shift_z]) * extent
    return (((vertices - centre) / (np.array(semi_axes) * extent)) ** 2).sum(axis=1) <= 1


def find_zones(
    mesh: TetrahedralMesh,
    *,
    fissure_x_mm: float,
    gap_mm: float,
    contact: bool,
    shift_y: float,
    shift_z: float,
    semi_axes: tuple[float, float, float],
) -> Zones:
    """Returns the zones of a brain in RAS+ mm.

    Parameters
    ----------
    fissure_x_mm
        Position of the interhemispheric fissure.
    gap_mm
        Width of the fissure; the planes stand a quarter of it to the left and to the right of its middle.
    contact
        Whether the hemispheres are kept apart by the planes.
    shift_y, shift_z, semi_axes
        The ellipsoid of no growth, in fractions of the brain's extents (Tallinen et al. 2016).
    """
    x = mesh.vertices[:, 0]
    facets, _ = boundary_faces(mesh)
    left_plane, right_plane = fissure_x_mm - gap_mm / 4, fissure_x_mm + gap_mm / 4
    reach = np.ptp(x) / 8
    facet_x = x[facets]
    still = inside_ellipsoid(mesh.vertices, shift_y, shift_z, semi_axes)
    between = ((facet_x > left_plane) & (facet_x < right_plane)).all(axis=1)

    zone = np.full(len(facets), FREE)
    zone[still[facets].all(axis=1)] = CLAMPED
    if contact:
        zone[between] = BETWEEN_PLANES
        zone[((facet_x > fissure_x_mm - reach) & (facet_x <= left_plane)).all(axis=1)] = LEFT_CONTACT
        zone[((facet_x < fissure_x_mm + reach) & (facet_x >= right_plane)).all(axis=1)] = RIGHT_CONTACT

    depth = PialSearch(mesh.vertices, facets).distance(mesh.vertices)[mesh.tets]
    # where several vertices are as deep, all of them must lie between the planes
    innermost = depth >= depth.max(axis=1, keepdims=True) - 1e-9
    bridging = ((x > left_plane) & (x < right_plane))[mesh.tets]
    bridge = mesh.tets[(bridging | ~innermost).all(axis=1)]
    growth = np.where(still, 0.0, 1.0)
    growth[np.unique(bridge)] = 0.0
    return Zones(facets, zone, growth, fissure_x_mm, (left_plane, right_plane))


def zones_of_run(mesh: TetrahedralMesh, parameters: FoldingParameters) -> Zones:
    """Returns the zones of a brain in RAS+ mm for the parameters of a run."""
    p = parameters
    return find_zones(
        mesh,
        fissure_x_mm=p.fissure_x_mm,
        gap_mm=p.contact.gap_mm,
        contact=p.contact.kind == "planes",
        shift_y=p.no_growth.shift_y,
        shift_z=p.no_growth.shift_z,
        semi_axes=p.no_growth.semi_axes,
    )


def zone_report(mesh: TetrahedralMesh, zones: Zones, thickness_mm: float) -> dict:
    """Returns what a user should see before the first step.

    Facets and area per zone, the clamped share of each hemisphere's facets, the initial penetration of the planes
    in mm (0 by construction) and the number of elements through the cortical thickness.
    """
    pial = TriangleMesh(mesh.vertices, zones.facets)
    areas = face_areas(pial)
    centroid_x = mesh.vertices[zones.facets, 0].mean(axis=1)
    clamped = zones.facet_zone == CLAMPED
    sides = {"left": centroid_x < zones.fissure_x_mm, "right": centroid_x >= zones.fissure_x_mm}
    beyond = [mesh.vertices[zones.vertices_of(LEFT_CONTACT), 0] - zones.planes_mm[0]]
    beyond += [zones.planes_mm[1] - mesh.vertices[zones.vertices_of(RIGHT_CONTACT), 0]]
    return {
        "zones": {
            name: {"facets": int((zones.facet_zone == i).sum()), "area_mm2": float(areas[zones.facet_zone == i].sum())}
            for i, name in enumerate(ZONE_NAMES)
        },
        "clamped_share": {
            side: float(areas[clamped & on].sum() / areas[on].sum()) if on.any() else 0.0 for side, on in sides.items()
        },
        "growing_vertices": int((zones.growth > 0).sum()),
        "initial_penetration_mm": float(
            max(0.0, *(gap.max() for gap in beyond if gap.size)) if any(gap.size for gap in beyond) else 0.0
        ),
        "elements_through_cortex": thickness_mm / edge_length_within(mesh, zones, thickness_mm),
    }


def zone_warnings(report: dict) -> list[str]:
    """Returns what a user should know of the zones, from their report, before trusting a run."""
    warnings = []
    through = report["elements_through_cortex"]
    if through < 2:
        warnings.append(f"fewer than two elements through the cortex ({through:.2f}): folds may be mesh noise")
    areas = {name: zone["area_mm2"] for name, zone in report["zones"].items()}
    share = areas[ZONE_NAMES[BETWEEN_PLANES]] / sum(areas.values())
    if share > MUCH_BETWEEN_PLANES:
        warnings.append(
            f"{share:.0%} of the pial area lies between the contact planes and feels no contact, so the hemispheres "
            "may cross: lower folding.contact.gap_mm below twice the fissure's width, or raise surface.gap_mm"
        )
    return warnings


def edge_length_within(mesh: TetrahedralMesh, zones: Zones, thickness_mm: float) -> float:
    """Returns the mean edge length in mm of the elements whose centroid lies in the cortex."""
    centroids = mesh.vertices[mesh.tets].mean(axis=1)
    depth = cKDTree(mesh.vertices[np.unique(zones.facets)]).query(centroids)[0]
    cortex = mesh.tets[depth <= thickness_mm]
    if not len(cortex):
        cortex = mesh.tets
    pairs = cortex[:, [0, 1, 0, 2, 0, 3, 1, 2, 1, 3, 2, 3]].reshape(-1, 2)
    return float(np.linalg.norm(np.diff(mesh.vertices[pairs], axis=1), axis=-1).mean())


def refuse_impossible(mesh: TetrahedralMesh, zones: Zones) -> None:
    """Raises an error for a brain that cannot be folded with these zones.

    Raises
    ------
    InputError
        Where nothing grows, no facet is clamped, or the fissure lies outside the brain.
    MeshError
        Where the pial surface is not closed, or a part of the brain has no clamped facet and would float.
    """
    low, high = mesh.vertices[:, 0].min(), mesh.vertices[:, 0].max()
    if not low < zones.fissure_x_mm < high:
        raise InputError(
            "the fissure lies outside the brain",
            found=f"fissure_x_mm {zones.fissure_x_mm:.2f}",
            expected=f"a value between {low:.2f} and {high:.2f} mm",
        )
    _, uses = edges(TriangleMesh(mesh.vertices, zones.facets))
    if (uses % 2).any():
        raise MeshError("the boundary of the mesh is not closed", found=f"{int((uses % 2).sum())} open edges")
    if not (zones.growth > 0).any():
        raise InputError("no vertex grows", remedy="Make the no-growth ellipsoid smaller (folding.no_growth).")
    clamped = zones.vertices_of(CLAMPED)
    if not len(clamped):
        raise InputError(
            "no facet is clamped, so the brain would drift",
            expected="pial facets inside the no-growth ellipsoid, outside the contact zones",
            remedy="Make or move the ellipsoid so that it cuts the pial surface (folding.no_growth).",
        )
    pairs = mesh.tets[:, [0, 1, 1, 2, 2, 3]].reshape(-1, 2)
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(mesh.vertices),) * 2)
    parts, part = connected_components(graph, directed=False)
    floating = np.setdiff1d(np.arange(parts), part[clamped])
    if len(floating):
        raise MeshError(
            "parts of the brain have no clamped facet and would float",
            found=f"{len(floating)} of {parts} parts, the largest with {np.bincount(part)[floating].max()} vertices",
            remedy="Drop small parts in the surface stage, or make the no-growth ellipsoid reach every part.",
        )
