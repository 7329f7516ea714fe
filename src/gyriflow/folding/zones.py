"""Zones of the brain that hold through a run: contact facets, clamped facets, growth and no growth.

Set once, on the mesh at the start; plain NumPy, so that a picture of them needs no solver.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.tetrahedra import TetrahedralMesh, boundary_faces, on_whole_faces
from ..geometry.triangles import TriangleMesh, face_normals
from ..parameters.folding import FoldingParameters
from ..parameters.terms import (
    BASE,
    BETWEEN_PLANES,
    CLAMPED,
    FLAT_CUTS,
    FREE,
    LEFT_CONTACT,
    RIGHT_CONTACT,
    SIDE_X,
    SIDE_Y,
)
from .layers import PialSearch

FLAT = 0.01
"""Part of the extent within which vertices of a flat base or side lie."""


@dataclass(frozen=True, eq=False)
class Zones:
    """The zones of a brain mesh.

    Attributes
    ----------
    facets : (f, 3) int
        Pial facets, outward, as vertex indices; the four triangles of a quadratic element's face follow each other.
    facet_zone : (f,) int
        FREE, CLAMPED, LEFT_CONTACT, RIGHT_CONTACT or BETWEEN_PLANES; BASE, SIDE_X or SIDE_Y where tissue is cut off
        flat and there is no cortex.
    growth : (n,) float
        1 where tissue grows, 0 where it does not.
    fissure_x_mm : float
        Position of the interhemispheric fissure.
    planes_mm : (float, float)
        The plane that the left, and that the right hemisphere may not pass.
    free : bool
        Whether nothing is fixed on purpose, so that rigid motions are to be removed.
    """

    facets: NDArray[np.int64]
    facet_zone: NDArray[np.int64]
    growth: NDArray[np.float64]
    fissure_x_mm: float
    planes_mm: tuple[float, float]
    free: bool = False

    def vertices_of(self, *zones: int) -> NDArray[np.int64]:
        """Returns the vertices of the facets of some zones, each once."""
        return np.unique(self.facets[np.isin(self.facet_zone, zones)])

    def penetration_mm(self, positions: NDArray[np.float64]) -> float:
        """Returns how far the fissure's walls stand beyond their planes at most, for (n, 3) positions in mm."""
        left = positions[self.vertices_of(LEFT_CONTACT), 0] - self.planes_mm[0]
        right = self.planes_mm[1] - positions[self.vertices_of(RIGHT_CONTACT), 0]
        return float(max(left.max(initial=0.0), right.max(initial=0.0)))

    @property
    def cortex_facets(self) -> NDArray[np.int64]:
        """The (c, 3) facets under which the cortex lies: all but flat cuts."""
        return self.facets[~np.isin(self.facet_zone, FLAT_CUTS)]

    @property
    def fixed(self) -> NDArray[np.bool_]:
        """Which of the (n, 3) components of the vertices' displacements are zero."""
        fixed = np.zeros((len(self.growth), 3), dtype=bool)
        fixed[self.vertices_of(CLAMPED, BASE)] = True
        fixed[self.vertices_of(SIDE_X), 0] = True
        fixed[self.vertices_of(SIDE_Y), 1] = True
        return fixed


def inside_ellipsoid(
    vertices: NDArray, shift_y: float, shift_z: float, semi_axes: tuple[float, float, float]
) -> NDArray[np.bool_]:
    """Returns which vertices lie in the ellipsoid of no growth; all parameters are fractions of the extents."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    extent = high - low
    centre = (low + high) / 2 + np.array([0.0, shift_y, shift_z]) * extent
    return (((vertices - centre) / (np.array(semi_axes) * extent)) ** 2).sum(axis=1) <= 1


def flat_cuts(mesh: TetrahedralMesh, facets: NDArray[np.int64], sides: bool) -> NDArray[np.int64]:
    """Returns BASE for facets of a flat base, SIDE_X and SIDE_Y for those of upright sides if asked for, else FREE.

    A facet belongs to a cut where its vertices lie within a hundredth of the extent of the mesh's end and it faces it.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    near = FLAT * (high - low)
    normals = face_normals(TriangleMesh(mesh.vertices, facets))
    corners = mesh.vertices[facets]
    zone = np.full(len(facets), FREE)
    for axis, name in ((0, SIDE_X), (1, SIDE_Y)) if sides else ():
        for end, sign in ((low, -1.0), (high, 1.0)):
            at_end = (np.abs(corners[:, :, axis] - end[axis]) <= near[axis]).all(axis=1)
            zone[on_whole_faces(at_end & (sign * normals[:, axis] > 0.7), mesh.order)] = name
    at_base = (corners[:, :, 2] <= low[2] + near[2]).all(axis=1)
    zone[on_whole_faces(at_base & (normals[:, 2] < -0.7), mesh.order)] = BASE
    return zone


def find_zones(
    mesh: TetrahedralMesh,
    *,
    fissure_x_mm: float,
    gap_mm: float,
    contact: bool,
    shift_y: float,
    shift_z: float,
    semi_axes: tuple[float, float, float],
    support: str = "ellipsoid",
    grows_everywhere: bool = False,
) -> Zones:
    """Returns the zones of a brain in RAS+ mm.

    Parameters
    ----------
    fissure_x_mm
        Position of the interhemispheric fissure.
    gap_mm
        Width of the fissure; the planes stand a quarter of it to the left and to the right of its middle.
    contact
        Whether there is contact of any kind: facets near the fissure then are not clamped.
    shift_y, shift_z, semi_axes
        The ellipsoid of no growth, in fractions of the brain's extents (Tallinen et al. 2016).
    support
        "ellipsoid", "base", "box" or "free", as in `FoldingParameters`.
    grows_everywhere
        Whether all tissue grows, that in the ellipsoid and that between the planes too.
    """
    x = mesh.vertices[:, 0]
    facets, _ = boundary_faces(mesh)
    left_plane, right_plane = fissure_x_mm - gap_mm / 4, fissure_x_mm + gap_mm / 4
    reach = np.ptp(x) / 8
    facet_x = x[facets]
    still = inside_ellipsoid(mesh.vertices, shift_y, shift_z, semi_axes)

    def faces_where(holds: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Returns the facets on faces of elements at all of whose vertices something holds."""
        return on_whole_faces(np.asarray(holds.all(axis=1)), mesh.order)

    zone = np.full(len(facets), FREE)
    if support == "ellipsoid":
        zone[faces_where(still[facets])] = CLAMPED
    if contact:
        zone[faces_where((facet_x > left_plane) & (facet_x < right_plane))] = BETWEEN_PLANES
        zone[faces_where((facet_x > fissure_x_mm - reach) & (facet_x <= left_plane))] = LEFT_CONTACT
        zone[faces_where((facet_x < fissure_x_mm + reach) & (facet_x >= right_plane))] = RIGHT_CONTACT
    if support in ("base", "box"):
        cuts = flat_cuts(mesh, facets, sides=support == "box")
        zone[cuts != FREE] = cuts[cuts != FREE]

    growth = np.ones(len(mesh.vertices))
    if not grows_everywhere:
        growth[still] = 0.0
        growth[bridge_vertices(mesh, facets, left_plane, right_plane)] = 0.0
    return Zones(facets, zone, growth, fissure_x_mm, (left_plane, right_plane), support == "free")


def bridge_vertices(
    mesh: TetrahedralMesh, facets: NDArray[np.int64], left_plane: float, right_plane: float
) -> NDArray[np.int64]:
    """Returns the vertices of the elements whose innermost vertex lies between the planes, each once."""
    x = mesh.vertices[:, 0]
    depth = PialSearch(mesh.vertices, facets).distance(mesh.vertices)[mesh.tets]
    # where several vertices are as deep, all of them must lie between the planes
    innermost = depth >= depth.max(axis=1, keepdims=True) - 1e-9
    bridging = ((x > left_plane) & (x < right_plane))[mesh.tets]
    return np.unique(mesh.tets[(bridging | ~innermost).all(axis=1)])


def zones_of_run(mesh: TetrahedralMesh, parameters: FoldingParameters) -> Zones:
    """Returns the zones of a brain in RAS+ mm for the parameters of a run."""
    p = parameters
    return find_zones(
        mesh,
        fissure_x_mm=p.fissure_x_mm,
        gap_mm=p.contact.gap_mm,
        contact=p.contact.kind != "none",
        shift_y=p.no_growth.shift_y,
        shift_z=p.no_growth.shift_z,
        semi_axes=p.no_growth.semi_axes,
        support=p.support,
        grows_everywhere=p.no_growth.kind == "none",
    )
