"""Zones of the brain that hold through a run: contact facets, clamped facets, growth and no growth.

Set once, on the mesh at the start; plain NumPy, so that a picture of them needs no solver.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.tetrahedra import TetrahedralMesh, boundary_faces, on_whole_faces
from ..geometry.triangles import Floats, TriangleMesh, face_normals
from ..settings import terms
from ..settings.folding import FoldingParameters, NoGrowth
from ..settings.terms import Side
from .layers import PialSearch

Tags = dict[str, NDArray[np.int32]]
FLAT = 0.01
"""Part of the extent within which vertices of a flat base or side lie."""
WALL_MM, WALL_COSINE = 2.0, 0.7
"""The medial wall of a single hemisphere: how far it lies from its innermost place at most, and faces the midline."""


@dataclass(frozen=True, eq=False)
class Zones:
    """The zones of a brain mesh.

    `facets` (f, 3) are the pial ones, outward, as vertex indices, the four of a quadratic element's face together.
    `facet_zone` (f,) is FREE, CLAMPED, LEFT_CONTACT, RIGHT_CONTACT or BETWEEN_PLANES; BASE, SIDE_X or SIDE_Y where
    tissue is cut off flat and there is no cortex; MEDIAL_WALL where the only hemisphere faces the one that is not
    there. `growth` (n,) is 1 where tissue grows, else 0. The left, and the right hemisphere may not pass `planes_mm`.

    In a `free` body nothing is fixed on purpose, so that rigid motions are to be removed. `anchors` are (k,) vertices,
    and which of their (k, 3) components are fixed beside the zones', so that a body whose only support is a sliding
    wall makes no rigid motion. They take no force: as few are fixed as there are such motions.
    """

    facets: NDArray[np.int64]
    facet_zone: NDArray[np.int64]
    growth: Floats
    fissure_x_mm: float
    planes_mm: tuple[float, float]
    free: bool = False
    anchors: tuple[NDArray[np.int64], NDArray[np.bool_]] | None = None

    def vertices_of(self, *zones: int) -> NDArray[np.int64]:
        """Return the vertices of the facets of some zones, each once."""
        return np.unique(self.facets[np.isin(self.facet_zone, zones)])

    def penetration_mm(self, positions: Floats) -> float:
        """Return how far the fissure's walls stand beyond their planes at most, for (n, 3) positions in mm."""
        left = positions[self.vertices_of(terms.LEFT_CONTACT), 0] - self.planes_mm[0]
        right = self.planes_mm[1] - positions[self.vertices_of(terms.RIGHT_CONTACT), 0]
        return float(max(left.max(initial=0.0), right.max(initial=0.0)))

    @property
    def cortex_facets(self) -> NDArray[np.int64]:
        """The (c, 3) facets under which the cortex lies: all but flat cuts and the wall of a single hemisphere."""
        return self.facets[~np.isin(self.facet_zone, terms.FLAT_CUTS)]

    @property
    def measured_facets(self) -> NDArray[np.int64]:
        """The (k, 3) facets of the pial surface as its area is measured: with the medial wall, without shapes' cuts."""
        return self.facets[~np.isin(self.facet_zone, terms.SHAPE_CUTS)]

    @property
    def fixed(self) -> NDArray[np.bool_]:
        """Which of the (n, 3) components of the vertices' displacements are zero."""
        fixed = np.zeros((len(self.growth), 3), dtype=bool)
        fixed[self.vertices_of(terms.CLAMPED, terms.BASE)] = True
        fixed[self.vertices_of(terms.SIDE_X), 0] = True
        fixed[self.vertices_of(terms.SIDE_Y), 1] = True
        wall = self.vertices_of(terms.MEDIAL_WALL)
        fixed[wall, 0] = True
        if self.anchors is not None:
            vertices, components = self.anchors
            fixed[vertices] |= components
        return fixed


def brain_box(vertices: NDArray, side: Side | None = None) -> tuple[Floats, Floats]:
    """Return the least and the greatest coordinates (3,) of a brain, for one hemisphere alone with its mirror image.

    The mirror is at the innermost place of the hemisphere `side`.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    width = high[0] - low[0]
    if side == "left":
        high[0] += width
    elif side == "right":
        low[0] -= width
    return low, high


def medial_wall_facets(mesh: TetrahedralMesh, facets: NDArray[np.int64], side: Side) -> NDArray[np.bool_]:
    """Return the (f,) mask of the facets of the only hemisphere that face the other side, near its innermost place."""
    x = mesh.vertices[:, 0] if side == "left" else -mesh.vertices[:, 0]
    facing = face_normals(TriangleMesh(mesh.vertices, facets))[:, 0] * (1.0 if side == "left" else -1.0)
    near = (x[facets] > x.max() - WALL_MM).all(axis=1)
    return on_whole_faces(near & (facing > WALL_COSINE), mesh.order)


def _wall_anchors(vertices: Floats, wall: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    places = vertices[wall][:, 1:]
    middle = int(((places - places.mean(axis=0)) ** 2).sum(axis=1).argmin())
    away = int(np.abs(places[:, 0] - places[middle, 0]).argmax())
    # shifts along y and z, and the turn about x
    return wall[[middle, away]], np.array([[False, True, True], [False, False, True]])


def inside_ellipsoid(vertices: NDArray, ellipsoid: NoGrowth, low: Floats, high: Floats) -> NDArray[np.bool_]:
    """Return which vertices lie in the ellipsoid of no growth of a brain with (3,) ends `low` and `high`."""
    extent = high - low
    centre = (low + high) / 2 + np.array([0.0, *ellipsoid.shift]) * extent
    return (((vertices - centre) / (np.array(ellipsoid.semi_axes) * extent)) ** 2).sum(axis=1) <= 1


def flat_cuts(mesh: TetrahedralMesh, facets: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return BASE for facets of a flat base, SIDE_X and SIDE_Y for those of upright sides, else FREE.

    A facet belongs to a cut where its vertices lie within a hundredth of the extent of the mesh's end and it faces it.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    near = FLAT * (high - low)
    normals = face_normals(TriangleMesh(mesh.vertices, facets))
    corners = mesh.vertices[facets]
    zone = np.full(len(facets), terms.FREE)
    for axis, name in ((0, terms.SIDE_X), (1, terms.SIDE_Y)):
        for end, sign in ((low, -1.0), (high, 1.0)):
            at_end = (np.abs(corners[:, :, axis] - end[axis]) <= near[axis]).all(axis=1)
            zone[on_whole_faces(at_end & (sign * normals[:, axis] > 0.7), mesh.order)] = name
    at_base = (corners[:, :, 2] <= low[2] + near[2]).all(axis=1)
    zone[on_whole_faces(at_base & (normals[:, 2] < -0.7), mesh.order)] = terms.BASE
    return zone


def zones_of_run(mesh: TetrahedralMesh, parameters: FoldingParameters) -> Zones:
    """Return the zones of a brain in RAS+ mm for the parameters of a run.

    The planes stand a quarter of `contact.gap_mm` to the left and to the right of the fissure's middle. With contact of
    any kind, facets near the fissure are not clamped. The ellipsoid of no growth is in fractions of the brain's extents
    (Tallinen et al. 2016). The wall of a hemisphere that is alone is MEDIAL_WALL, and the plane that it may not pass is
    that of the wall.
    """
    p = parameters
    fissure_x_mm, support, side = p.fissure_x_mm, p.support, p.side
    x = mesh.vertices[:, 0]
    facets, _ = boundary_faces(mesh)
    left_plane, right_plane = fissure_x_mm - p.contact.gap_mm / 4, fissure_x_mm + p.contact.gap_mm / 4
    if side is not None:
        left_plane = right_plane = float(x.max() if side == "left" else x.min())
    low, high = brain_box(mesh.vertices, side)
    reach = (high - low)[0] / 8
    facet_x = x[facets]
    ellipsoid = p.no_growth
    still = inside_ellipsoid(mesh.vertices, ellipsoid, low, high)

    def faces_where(holds: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the facets on faces of elements at all of whose vertices something holds."""
        return on_whole_faces(np.asarray(holds.all(axis=1)), mesh.order)

    zone = np.full(len(facets), terms.FREE)
    if support == "ellipsoid":
        zone[faces_where(still[facets])] = terms.CLAMPED
    if p.contact.kind != "none":
        zone[faces_where((facet_x > left_plane) & (facet_x < right_plane))] = terms.BETWEEN_PLANES
        zone[faces_where((facet_x > fissure_x_mm - reach) & (facet_x <= left_plane))] = terms.LEFT_CONTACT
        zone[faces_where((facet_x < fissure_x_mm + reach) & (facet_x >= right_plane))] = terms.RIGHT_CONTACT
    if support == "box":
        cuts = flat_cuts(mesh, facets)
        zone[cuts != terms.FREE] = cuts[cuts != terms.FREE]
    anchors = None
    if side is not None:
        zone[medial_wall_facets(mesh, facets, side)] = terms.MEDIAL_WALL
        wall = np.unique(facets[zone == terms.MEDIAL_WALL])
        if support == "free" and len(wall):
            anchors = _wall_anchors(mesh.vertices, wall)

    growth = np.ones(len(mesh.vertices))
    if ellipsoid.kind != "none":
        growth[still] = 0.0
        if side is None:
            growth[bridge_vertices(mesh, facets, left_plane, right_plane)] = 0.0
    free = support == "free" and side is None
    return Zones(facets, zone, growth, fissure_x_mm, (left_plane, right_plane), free, anchors)


def bridge_vertices(
    mesh: TetrahedralMesh, facets: NDArray[np.int64], left_plane: float, right_plane: float
) -> NDArray[np.int64]:
    """Return the vertices of the elements whose innermost vertex lies between the planes, each once."""
    x = mesh.vertices[:, 0]
    depth = PialSearch(mesh.vertices, facets).distance(mesh.vertices)[mesh.tets]
    # where several vertices are as deep, all of them must lie between the planes
    innermost = depth >= depth.max(axis=1, keepdims=True) - 1e-9
    bridging = ((x > left_plane) & (x < right_plane))[mesh.tets]
    return np.unique(mesh.tets[(bridging | ~innermost).all(axis=1)])


def cell_tags(mesh: TetrahedralMesh, zones: Zones, weight: Floats) -> Tags:
    """Return the (m,) tags of the elements.

    `hemisphere` is LEFT or RIGHT by the element's centroid, BRIDGE between the two contact planes. `growing` is 0
    where the model lets none of an element's vertices grow, else 1. `layer` is CORTEX where the mean cortical `weight`
    (n,) of its vertices is above a half, else CORE.
    """
    x = mesh.vertices[mesh.corners, 0].mean(axis=1)
    left, right = zones.planes_mm
    return {
        "hemisphere": np.select([x <= left, x >= right], [terms.LEFT, terms.RIGHT], terms.BRIDGE).astype(np.int32),
        "growing": (zones.growth[mesh.tets].max(axis=1) > 0).astype(np.int32),
        "layer": np.where(weight[mesh.tets].mean(axis=1) > 0.5, terms.CORTEX, terms.CORE).astype(np.int32),
    }


def facet_tags(zones: Zones, on_left: NDArray[np.bool_]) -> Tags:
    """Return the (f,) tags of `zones.facets`: `zone`, and `hemisphere` LEFT or RIGHT.

    The fissure may be curved, so that no plane tells which facets are `on_left`.
    """
    side = np.where(on_left, terms.LEFT, terms.RIGHT)
    return {"zone": zones.facet_zone.astype(np.int32), "hemisphere": side.astype(np.int32)}
