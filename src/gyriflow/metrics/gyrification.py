"""Hull and envelope of pial surfaces, sulcal depth below the hull, and gyrification
indices."""

from dataclasses import dataclass

import igl
import numpy as np
from scipy.spatial import cKDTree

from ..errors import MeshError
from ..geometry.matching import nearest_on
from ..geometry.remeshing import from_meshlab, in_meshlab, pymeshlab
from ..geometry.triangles import (
    Floats,
    Ints,
    TriangleMesh,
    area,
    connected,
    corners,
    face_areas,
    face_normals,
    vertex_normals,
)

ENVELOPE_RADIUS_MM = 5.0
"""The envelope bridges sulci narrower than twice this radius."""
ENVELOPE_OFFSET_MM = 0.1
"""Distance at which the envelope is first wrapped round the surface."""
PIECE_MM = 2.0
"""Size of the pieces that are classed as lying over the cut or over the pial
surface."""
ABOVE_MM = 0.3
"""Height above a piece at which the line into it begins: the envelope is in places
below the surface."""
LOCAL_RADIUS_MM = 10.0
"""Radius of the patches of the local index: two of the widest sulci that the envelope
bridges."""


def cap(mesh: TriangleMesh) -> TriangleMesh:
    """Return the surface with every boundary closed, the faces that close it after its
    own.

    Each boundary gets a fan of faces from its centroid. A cut in a plane is closed by
    that part of the plane. A closed surface is returned as it is. MeshError where a
    boundary is not a closed line.
    """
    directed = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    start, end = directed.T
    size = len(mesh.vertices)
    # twenty times as fast as np.isin, which finds distinct numbers by their hashes
    backward = np.sort(end * size + start)
    forward = start * size + end
    place = np.minimum(
        np.searchsorted(backward, forward),
        len(backward) - 1,
    )
    has_other_face = backward[place] == forward
    rim = directed[~has_other_face]
    if not len(rim):
        return mesh
    starts = np.bincount(rim[:, 0], minlength=size)
    ends = np.bincount(rim[:, 1], minlength=size)
    if not np.array_equal(starts, ends):
        raise MeshError(
            "the boundary of the surface is not made of closed lines",
            remedy="Repair the surface",
        )
    on_rim, local = np.unique(rim, return_inverse=True)
    local = local.reshape(-1, 2)
    boundary = connected(local, len(on_rim))
    centres = []
    for number in range(boundary.max() + 1):
        points = mesh.vertices[on_rim[boundary == number]]
        centres.append(points.mean(axis=0))
    centre = size + boundary[local[:, 0]]
    fan = np.column_stack([rim[:, ::-1], centre])
    vertices = np.concatenate([mesh.vertices, centres])
    faces = np.concatenate([mesh.faces, fan])
    return TriangleMesh(vertices, faces)


def envelope(mesh: TriangleMesh) -> TriangleMesh:
    """Return a closed surface that follows the outer folds and bridges sulci narrower
    than twice `ENVELOPE_RADIUS_MM`.

    It is an alpha wrap (Portaneri et al. 2022, in pymeshlab) of the capped surface,
    moved back onto it by the offset that the wrap needs. The area of a sphere comes out
    0.3 % small.
    """
    document = in_meshlab(cap(mesh))
    alpha = pymeshlab.PureValue(ENVELOPE_RADIUS_MM)
    offset = pymeshlab.PureValue(ENVELOPE_OFFSET_MM)
    document.generate_alpha_wrap(alpha=alpha, offset=offset)
    outside = from_meshlab(document)
    return TriangleMesh(
        outside.vertices - ENVELOPE_OFFSET_MM * vertex_normals(outside), outside.faces
    )


def sulcal_depth(mesh: TriangleMesh, hull: TriangleMesh) -> Floats:
    """Return the (n,) straight distance in mm from each vertex outwards to the convex
    hull of the hemisphere; 0 outside it.

    Of the measures that were compared it is nearest to the known depths of shapes, and
    does not jump when the lips of a fissure close.
    """
    signed, *_ = igl.signed_distance(
        mesh.vertices,
        hull.vertices,
        hull.faces,
        igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL,
    )
    return np.maximum(-signed, 0.0)


@dataclass(frozen=True, eq=False)
class Pieces:
    """A surface around a pial surface in small pieces, without those over a cut: (k, 3)
    centres in mm, areas in mm²."""

    centres: Floats
    areas: Floats


def pieces_without_cuts(surface: TriangleMesh, mesh: TriangleMesh) -> Pieces:
    """Return a surface around `mesh` in pieces of 2 mm, without what lies over the cuts
    that `mesh` is open at.

    A piece is left out where a line into it, along its normal, meets a cap first. The
    nearest point would be wrong near the rim of a cut: a piece that spans a recess of
    the cut may be nearer to its banks, and one over the wall of a neck nearer to the
    cut.
    """
    small = _split_to_size(surface, PIECE_MM)
    # neighbours follow each other, so that lines into them stay in the cache
    order = cKDTree(corners(small).mean(axis=1)).indices
    small = TriangleMesh(small.vertices, small.faces[order])
    centres, areas = corners(small).mean(axis=1), face_areas(small)
    closed = cap(mesh)
    if len(closed.faces) == len(mesh.faces):
        return Pieces(centres, areas)
    inwards = -face_normals(small)
    tree, shape = igl.AABB(), (closed.vertices, closed.faces)
    tree.init(*shape)
    face, *_ = tree.intersect_ray_first(
        *shape,
        centres - ABOVE_MM * inwards,
        inwards,
    )
    # a line may miss a surface at its rim
    is_missed = face < 0
    if is_missed.any():
        face[is_missed] = nearest_on(centres[is_missed], closed)[1]
    is_original = face < len(mesh.faces)
    return Pieces(centres[is_original], areas[is_original])


def _split_to_size(mesh: TriangleMesh, length_mm: float) -> TriangleMesh:
    """Return the faces of a surface, each apart and halved at its longest edge until
    no edge is longer than a length."""
    parts = []
    remaining = corners(mesh)
    while len(remaining):
        lengths = np.linalg.norm(
            np.roll(remaining, -1, axis=1) - remaining,
            axis=2,
        )
        is_long = lengths.max(axis=1) > length_mm
        parts.append(remaining[~is_long])
        # the longest edge first
        order = (lengths[is_long].argmax(axis=1)[:, None] + np.arange(3)) % 3
        long = np.take_along_axis(
            remaining[is_long],
            order[:, :, None],
            axis=1,
        )
        start, end, apex = long.transpose(1, 0, 2)
        middle = 0.5 * (start + end)
        first = np.stack(
            [start, middle, apex],
            axis=1,
        )
        second = np.stack(
            [middle, end, apex],
            axis=1,
        )
        remaining = np.concatenate([first, second])
    pieces = np.concatenate(parts)
    faces = np.arange(3 * len(pieces)).reshape(-1, 3)
    return TriangleMesh(pieces.reshape(-1, 3), faces)


def gyrification_index(meshes: list[TriangleMesh], around: list[Pieces]) -> float:
    """Return the area of surfaces over that of the hulls or envelopes around them, cuts
    left out of both.

    The index of a brain is that of its two hemispheres, each in its own hull: a hull
    around both would bridge the fissure between them and count it as folding.
    """
    return sum(map(area, meshes)) / sum(float(pieces.areas.sum()) for pieces in around)


def local_gyrification_index(mesh: TriangleMesh, around: Pieces) -> Floats:
    """Return the (n,) area of the pial surface over that of the envelope, round each
    vertex.

    As Schaer et al. 2008 (IEEE Trans. Med. Imaging 27, 161-170), a patch of the
    envelope, here all within `LOCAL_RADIUS_MM` of the point nearest to the vertex, is
    compared with the part of the pial surface that is nearest to that patch. Patches of
    25 mm, as for adults, would hold half a fetal hemisphere.
    """
    tree = cKDTree(around.centres)
    _, home = tree.query(corners(mesh).mean(axis=1))
    pial = np.bincount(
        home,
        face_areas(mesh),
        len(around.centres),
    )
    _, nearest = tree.query(mesh.vertices)
    # each pair of pieces once; a piece is in its own patch, too
    pairs = tree.query_pairs(LOCAL_RADIUS_MM, output_type="ndarray")
    first, second = np.ascontiguousarray(pairs.T)
    pial_areas = _with_partners(pial, first, second)
    patch_areas = _with_partners(around.areas, first, second)
    return (pial_areas / patch_areas)[nearest]


def _with_partners(values: Floats, first: Ints, second: Ints) -> Floats:
    """Return the sums of (k,) values and those of their partners in (p,) pairs."""
    size = len(values)
    return (
        values
        + np.bincount(first, values[second], size)
        + np.bincount(second, values[first], size)
    )
