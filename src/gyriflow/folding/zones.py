"""Zones of the brain: facets in contact, clamped facets, and vertices that grow.

They are set on the mesh at the start of a run and do not change. This module imports no
solver, so that figures of the zones do not need one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.tetrahedra import TetrahedralMesh, boundary_faces, on_whole_faces
from ..geometry.triangles import (
    Floats,
    Ints,
    Mask,
    TriangleMesh,
    face_areas,
    face_normals,
)
from ..settings import terms
from ..settings.folding import FoldingParameters
from ..settings.terms import Side
from .layers import PialSearch

Tags = dict[str, NDArray[np.int32]]
GAP_MM = 2.5
"""Largest width of the fissure, as in the FetalFoldSim paper."""
ELLIPSOID_SHIFT = (0.0, 0.05, -0.15)
ELLIPSOID_SEMI_AXES = (0.35, 0.40, 0.50)
"""Shift from the middle and semi-axes along X, Y, Z of the ellipsoid without growth, in
extents of the brain, as in the FetalFoldSim paper."""
MAX_BETWEEN_PLANES = 0.01
"""Largest share of the pial area between the contact planes, where walls would have no
contact."""
MAX_WALL_MM, MIN_WALL_COSINE = 2.0, 0.7
"""The medial wall of a single hemisphere: its largest distance to the innermost point,
and the smallest cosine of the angle between its normal and the left-right axis."""


@dataclass(frozen=True, eq=False)
class Zones:
    """The zones of a brain mesh.

    Attributes
    ----------
    facets
        Pial facets (f, 3), outward, as vertex indices; the four of a quadratic
        element's face are consecutive.
    facet_zone
        FREE, CLAMPED, LEFT_CONTACT, RIGHT_CONTACT or BETWEEN_PLANES (f,); BASE, SIDE_X
        or SIDE_Y on flat cuts, which have no cortex; MEDIAL_WALL on the wall of a
        single hemisphere towards the missing one.
    growing
        1 at vertices (n,) that grow, else 0.
    fissure_x_mm, planes_mm
        Position of the fissure, and of the planes that the left and the right
        hemisphere may not pass.
    free
        Whether the body has no support, so that its rigid motions have to be removed.
    anchors
        Vertices (k,), and the mask (k, 3) of their components that are fixed in
        addition to the zones, so that a body whose only support is a sliding wall has
        no rigid motion. They carry no force, since just as many components are fixed as
        there are such motions.
    """

    facets: Ints
    facet_zone: Ints
    growing: Floats
    fissure_x_mm: float
    planes_mm: tuple[float, float]
    free: bool = False
    anchors: tuple[Ints, Mask] | None = None

    def vertices_of(self, *zones: int) -> Ints:
        """Return the vertices of the facets of some zones, each once."""
        return np.unique(self.facets[np.isin(self.facet_zone, zones)])

    def penetration_mm(self, positions: Floats) -> float:
        """Return the largest distance of the fissure's walls beyond their planes, for
        (n, 3) positions in mm."""
        x = positions[:, 0]
        left_plane, right_plane = self.planes_mm
        beyond_left = x[self.vertices_of(terms.LEFT_CONTACT)] - left_plane
        beyond_right = right_plane - x[self.vertices_of(terms.RIGHT_CONTACT)]
        beyond = np.concatenate([beyond_left, beyond_right])
        return float(beyond.max(initial=0.0))

    @property
    def cortex_facets(self) -> Ints:
        """The (c, 3) facets with cortex under them: all but flat cuts and the medial
        wall of a single hemisphere."""
        return self.facets[~np.isin(self.facet_zone, terms.FLAT_CUTS)]

    @property
    def measured_facets(self) -> Ints:
        """The (k, 3) facets whose area is measured: with the medial wall, without the
        cuts of synthetic shapes."""
        return self.facets[~np.isin(self.facet_zone, terms.SHAPE_CUTS)]

    @property
    def fixed(self) -> Mask:
        """The mask (n, 3) of the displacement components that are fixed at zero."""
        fixed = np.zeros(
            (len(self.growing), 3),
            dtype=bool,
        )
        fixed[self.vertices_of(terms.CLAMPED, terms.BASE)] = True
        fixed[self.vertices_of(terms.SIDE_X), 0] = True
        fixed[self.vertices_of(terms.SIDE_Y), 1] = True
        wall = self.vertices_of(terms.MEDIAL_WALL)
        fixed[wall, 0] = True
        if self.anchors is not None:
            vertices, components = self.anchors
            fixed[vertices] |= components
        return fixed


def _brain_box(vertices: NDArray, side: Side | None = None) -> tuple[Floats, Floats]:
    """Return the smallest and largest coordinates (3,) of a brain.

    The single hemisphere `side` is completed by its mirror image at its innermost
    point.
    """
    low = vertices.min(axis=0)
    high = vertices.max(axis=0)
    width = high[0] - low[0]
    if side == "left":
        high[0] += width
    elif side == "right":
        low[0] -= width
    return low, high


def _medial_wall_facets(
    mesh: TetrahedralMesh,
    facets: Ints,
    side: Side,
) -> Mask:
    """Return the mask (f,) of the facets of a single hemisphere that face the missing
    one, near its innermost point."""
    inwards = 1.0 if side == "left" else -1.0
    x = inwards * mesh.vertices[:, 0]
    normals = face_normals(TriangleMesh(mesh.vertices, facets))
    is_facing = inwards * normals[:, 0] > MIN_WALL_COSINE
    is_near = (x[facets] > x.max() - MAX_WALL_MM).all(axis=1)
    return on_whole_faces(is_near & is_facing, mesh.order)


def _wall_anchors(vertices: Floats, wall: Ints) -> tuple[Ints, Mask]:
    """Return the `anchors` of a hemisphere: the vertex in the middle of its wall and
    the farthest from there along y."""
    yz = vertices[wall][:, 1:]
    offsets = yz - yz.mean(axis=0)
    squares = (offsets**2).sum(axis=1)
    central = squares.argmin()
    y = yz[:, 0]
    along_y = np.abs(y - y[central])
    farthest = along_y.argmax()
    # against translations along y and z, and the rotation about x
    fixed_at_centre = [False, True, True]
    fixed_farthest = [False, False, True]
    anchors = wall[[central, farthest]]
    return anchors, np.array([fixed_at_centre, fixed_farthest])


def _inside_ellipsoid(
    vertices: NDArray,
    low: Floats,
    high: Floats,
) -> Mask:
    """Return the mask of vertices in the ellipsoid without growth; `low`, `high` (3,)
    are the ends of the brain."""
    extent = high - low
    middle = (low + high) / 2
    centre = middle + np.array(ELLIPSOID_SHIFT) * extent
    semi_axes = np.array(ELLIPSOID_SEMI_AXES) * extent
    from_centre = (vertices - centre) / semi_axes
    squares = (from_centre**2).sum(axis=1)
    return squares <= 1


def zones_of_run(
    mesh: TetrahedralMesh,
    parameters: FoldingParameters,
    gap_mm: float = GAP_MM,
) -> Zones:
    """Return the zones of a brain in RAS+ mm for the parameters of a run.

    The planes are a quarter of `gap_mm`, the width of the fissure, left and right of
    its middle; with contact `planes` nearer, where the fissure is narrower: see
    `_planes_distance`. With any kind of contact, facets near the fissure are not
    clamped; with `planes`, the `_medial_vertices` do not grow. The ellipsoid without
    growth is given in fractions of the brain's extents (Tallinen et al. 2016). A single
    hemisphere has a MEDIAL_WALL, and may not pass the plane of that wall.
    """
    p = parameters
    fissure_x_mm = p.fissure_x_mm
    x = mesh.vertices[:, 0]
    facets, _ = boundary_faces(mesh)
    bridge = gap_mm / 4
    distance = bridge
    if p.contact == "planes":
        distance = min(distance, _planes_distance(mesh.vertices, facets, fissure_x_mm))
    left_plane = fissure_x_mm - distance
    right_plane = fissure_x_mm + distance
    if p.side is not None:
        left_plane = right_plane = float(x.max() if p.side == "left" else x.min())
    low, high = _brain_box(mesh.vertices, p.side)
    reach = (high - low)[0] / 8
    facet_x = x[facets]
    is_static = _inside_ellipsoid(mesh.vertices, low, high)
    zone = np.full(len(facets), terms.FREE)

    # the vertices (f, 3) of the facets in each zone; of several zones the last counts
    in_zones: dict[int, Mask] = {}
    if p.support == "ellipsoid":
        in_zones[terms.CLAMPED] = is_static[facets]
    if p.contact != "none":
        is_left = (facet_x > fissure_x_mm - reach) & (facet_x <= left_plane)
        is_right = (facet_x < fissure_x_mm + reach) & (facet_x >= right_plane)
        is_between = (facet_x > left_plane) & (facet_x < right_plane)
        in_zones[terms.BETWEEN_PLANES] = is_between
        in_zones[terms.LEFT_CONTACT] = is_left
        in_zones[terms.RIGHT_CONTACT] = is_right
    for number, is_inside in in_zones.items():
        zone[on_whole_faces(is_inside.all(axis=1), mesh.order)] = number
    anchors = None
    if p.side is not None:
        zone[_medial_wall_facets(mesh, facets, p.side)] = terms.MEDIAL_WALL
        wall = np.unique(facets[zone == terms.MEDIAL_WALL])
        if p.support == "free" and len(wall):
            anchors = _wall_anchors(mesh.vertices, wall)

    growing = np.ones(len(mesh.vertices))
    if p.support == "ellipsoid":
        growing[is_static] = 0.0
        if p.side is None:
            in_bridge = _bridge_vertices(
                mesh, facets, fissure_x_mm - bridge, fissure_x_mm + bridge
            )
            growing[in_bridge] = 0.0
            if p.contact == "planes":
                medial = _medial_vertices(mesh, fissure_x_mm, left_plane, right_plane)
                growing[medial] = 0.0
    return Zones(
        facets,
        zone,
        growing,
        fissure_x_mm,
        (left_plane, right_plane),
        free=p.support == "free" and p.side is None,
        anchors=anchors,
    )


def _planes_distance(
    vertices: Floats,
    facets: Ints,
    fissure_x_mm: float,
) -> float:
    """Return the distance in mm from the middle of the fissure that has
    `MAX_BETWEEN_PLANES` of the area within."""
    distances = np.abs(vertices[facets, 0] - fissure_x_mm).max(axis=1)
    nearest_first = np.argsort(distances)
    areas = face_areas(TriangleMesh(vertices, facets))
    area_within = np.cumsum(areas[nearest_first])
    last = np.searchsorted(area_within, MAX_BETWEEN_PLANES * area_within[-1])
    return float(distances[nearest_first[last]])


def _bridge_vertices(
    mesh: TetrahedralMesh,
    facets: Ints,
    left_plane: float,
    right_plane: float,
) -> Ints:
    """Return the vertices of the elements whose deepest vertex lies between the planes,
    each once."""
    x = mesh.vertices[:, 0]
    is_between = (x > left_plane) & (x < right_plane)
    depths, _ = PialSearch(mesh.vertices, facets).nearest(mesh.vertices)
    depth = depths[mesh.tets]
    # of several equally deep vertices, all must lie between the planes
    is_deepest = depth >= depth.max(axis=1, keepdims=True) - 1e-9
    is_in_bridge = (is_between[mesh.tets] | ~is_deepest).all(axis=1)
    return np.unique(mesh.tets[is_in_bridge])


def _medial_vertices(
    mesh: TetrahedralMesh,
    fissure_x_mm: float,
    left_plane: float,
    right_plane: float,
) -> Ints:
    """Return the vertices, each once, of the elements whose most medial vertex lies
    between the planes.

    Walls between the planes have no contact; the prototype of the FetalFoldSim paper
    does not let them grow.
    """
    x = mesh.vertices[mesh.tets, 0]
    is_right = x.mean(axis=1) > fissure_x_mm
    medial = np.where(
        is_right,
        x.min(axis=1),
        x.max(axis=1),
    )
    is_between = (medial > left_plane) & (medial < right_plane)
    return np.unique(mesh.tets[is_between])


def cell_tags(
    mesh: TetrahedralMesh,
    zones: Zones,
    weight: Floats,
) -> Tags:
    """Return the (m,) tags of the elements.

    `hemisphere` is LEFT or RIGHT by the element's centroid, or BRIDGE between the two
    contact planes. `growing` is 1 if any of its vertices grows, else 0. `layer` is
    CORTEX if the mean cortical `weight` (n,) of its vertices is above a half, else
    CORE.
    """
    x = mesh.vertices[mesh.corners, 0].mean(axis=1)
    left_plane, right_plane = zones.planes_mm
    hemisphere = np.full(
        len(x),
        terms.BRIDGE,
        dtype=np.int32,
    )
    hemisphere[x >= right_plane] = terms.RIGHT
    hemisphere[x <= left_plane] = terms.LEFT
    is_growing = zones.growing[mesh.tets].max(axis=1) > 0
    is_cortex = weight[mesh.tets].mean(axis=1) > 0.5
    layer = np.where(is_cortex, terms.CORTEX, terms.CORE)
    return {
        "hemisphere": hemisphere,
        "growing": is_growing.astype(np.int32),
        "layer": layer.astype(np.int32),
    }
