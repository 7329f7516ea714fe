"""Mid-sagittal plane, interhemispheric fissure (a curved surface, opened where labels
touch), left and right sides."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from operator import itemgetter

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.optimize import minimize
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.transform import Rotation
from skimage.segmentation import watershed

from ..errors import InputError
from ..geometry import triangles
from ..geometry.alignment import motion
from ..geometry.boxes import Box
from ..geometry.deformations import transform_points, voxel_index, voxel_size
from ..geometry.matching import nearest_on
from ..geometry.triangles import Ints, TriangleMesh
from ..geometry.voxels import OUTSIDE, distance_to, number_parts
from ..settings.terms import Side
from .extraction import (
    EDGE_SLOPE,
    SMOOTHING_VOXELS,
    Floats,
    Mask,
    dilated,
    with_neighbours,
)

SAMPLES = 600
DIRECTIONS = 400
STARTS = 5
# step and tolerance of the search with every third point and about so many vertices;
# then with all, for planes whose mirror distance is at most this multiple of the
# smallest one plus so many mm
ROUGH_EVERY, ROUGH_VERTICES, ROUGH_SEARCH = 3, 4000, (0.1, 3e-3)
FINE_SEARCH, REFINED_FACTOR, REFINED_MM = (0.02, 1e-4), 2.0, 0.3
# larger leaves than usual: single points are searched, often far from the surface
LEAF_SIZE = 64
# starts that lead to the same plane but for this
SAME_NORMAL, SAME_OFFSET_MM = 1e-3, 0.05
# the same after the rough search
NEAR_NORMAL, NEAR_OFFSET_MM = 0.03, 0.5
# the left-right axis is searched within this angle of the world's x axis
SEARCH_DEG = 60.0
# a plane x = const is accepted if its mirror distance is at most this factor of the
# best plane's, plus so many edges
SYMMETRY_TOL_FACTOR, SYMMETRY_TOL_EDGES = 1.1, 0.1
# smaller tilts are not corrected, since the plane is not more accurate
MIN_TILT_DEG = 0.5
# distances to the mirror image above this quantile are ignored as asymmetry
TRIM_QUANTILE = 0.8
FISSURE_BAND = 0.2
MAX_FISSURE_WIDTH = 0.25
MIN_FISSURE_POINTS = 60
# the plane of symmetry is kept unless a plane fitted to the fissure has less scatter by
# this much
MIN_IMPROVEMENT_MM = 0.02
SPACING_MM = 0.5
MARGIN_MM = 5.0
# smoothing of the mid-surface; without walls nearby it returns to the plane
BEND_MM = 4.0
MAX_SHIFT_MM = 5.0
# the mid-surface is searched this often around the previous one, so that it can follow
# a midline shifted far
N_UPDATES = 4
# tissue inside the cortex further from the mid-surface than this is on its own side
SEED_MM = 6.0
# distances from the surface between the hemispheres are found within this of the
# mid-surface
NEAR_MM = 8.0
# lead of one side over the other where both reach a voxel about equally early, in
# voxels; above the noise of the mid-surface, which would else decide a tie, and far
# below a voxel
LEAD_VOXELS = 0.15
# the labels show a fissure only as a gap of at least twice this in the surface between
# the hemispheres
MIN_VISIBLE_MM = 3.0
# a contact of the tissue inside the cortex joins the hemispheres if it has this share
# of the largest contact's size
MIN_JOINT = 0.1
# tissue that crosses a visible fissure over a smaller area is an error of the labels
MAX_BRIDGE_MM2 = 10.0
# width to which a fissure hidden by cortex is opened
FISSURE_MM = 1.5
# thickness of the cortex left on the tissue that connects the hemispheres
FLOOR_MM = 1.2
# hemispheres are moved by at most this distance to remove an overlap
MAX_SEPARATION_MM = 10.0
# a second closed piece is a hemisphere if it has at least this share of the largest
# piece's area,
COMPARABLE_PIECE = 0.1
# and if both have at least this share of their area, weighted by height, on their own
# side of the fissure
MIN_SHARE_ON_SIDE = 0.75
# patches on the wrong side of the cut are bulges over the fissure if they are at most
# this share of the area
MAX_BULGE_SHARE = 0.05
# largest share of a hemisphere's area outside its largest piece that is left out
MAX_LEFT_OUT = 0.1


@dataclass(frozen=True, eq=False)
class MidPlane:
    """The mid-sagittal plane: points p with normal·p = offset in mm. The unit normal
    (3,) points from left to right.

    `asymmetry_mm` is the mean distance from the surface to its mirror image in the
    plane of best symmetry, without the largest fifth. `fissure_points` is the number of
    points between facing walls of the fissure to which the plane was fitted; 0 if there
    were too few, and the plane is that of mirror symmetry.
    """

    normal: Floats
    offset: float
    asymmetry_mm: float
    fissure_points: int


def mid_plane(mesh: TriangleMesh, *, named: bool = False) -> MidPlane:
    """Return the mid-sagittal plane of a closed, outward surface whose left-right axis
    is within `SEARCH_DEG` of x.

    Planes of mirror symmetry are fitted to the points half-way between medial walls
    that face each other. The best one has little asymmetry and many such points: in an
    asymmetric brain the fissure counts. With coordinates that the user has `named`, an
    almost as symmetric plane x = const is kept: a body of revolution has many planes.
    """
    weights = triangles.vertex_areas(mesh)
    selection = np.random.default_rng(0).choice(
        len(weights), SAMPLES, p=weights / weights.sum()
    )
    sample = mesh.vertices[selection]
    tree = cKDTree(mesh.vertices, leafsize=LEAF_SIZE)
    planes = _symmetry_planes(sample, tree)
    normals = triangles.vertex_normals(mesh)
    if named:
        x = np.array([1.0, 0.0, 0.0])
        middle = float(weights @ mesh.vertices[:, 0] / weights.sum())
        distance = _mirror_distance(x, middle, sample, tree)
        least = min(asymmetry for _, _, asymmetry in planes)
        if (
            distance
            < SYMMETRY_TOL_FACTOR * least
            + SYMMETRY_TOL_EDGES * triangles.mean_edge_length(mesh)
        ):
            return _fit_to_fissure(mesh.vertices, normals, x, middle, distance)
    candidates = [_fit_to_fissure(mesh.vertices, normals, *plane) for plane in planes]
    return max(
        candidates,
        key=lambda plane: (plane.fissure_points + 100.0) / (plane.asymmetry_mm + 0.5),
    )


def _fit_to_fissure(
    vertices: Floats,
    normals: Floats,
    normal: Floats,
    offset: float,
    asymmetry: float,
) -> MidPlane:
    middle = _fissure_points(vertices, normals, normal, offset)
    fitted = _plane_through(middle, normal, offset)
    if fitted is None:
        return MidPlane(normal, offset, asymmetry, 0)
    # the first band may have missed the fissure
    middle = _fissure_points(vertices, normals, *fitted)
    fitted = _plane_through(middle, *fitted) or fitted
    count, scatter = _scatter(middle, *fitted)
    before, by_symmetry = _scatter(middle, normal, offset)
    if before > 0.95 * count and by_symmetry < scatter + MIN_IMPROVEMENT_MM:
        return MidPlane(normal, offset, asymmetry, before)
    return MidPlane(*fitted, asymmetry, count)


def _fissure_points(
    vertices: Floats,
    normals: Floats,
    normal: Floats,
    offset: float,
) -> Floats:
    """Return the (k, 3) points half-way between facing walls of the fissure, a fifth of
    the width around a plane, from (n, 3) vertices and their normals."""
    height = vertices @ normal - offset
    width = np.ptp(height)
    facing = normals @ normal
    near = np.abs(height) < FISSURE_BAND * width
    left = np.flatnonzero(near & (facing > 0.5))
    right = np.flatnonzero(near & (facing < -0.5))
    if len(left) < 8 or len(right) < 8:
        return np.empty((0, 3))
    return np.concatenate(
        [
            _middles(vertices, height, left, right, normal),
            _middles(vertices, -height, right, left, -normal),
        ]
    )


def _middles(
    vertices: Floats,
    height: Floats,
    wall: Ints,
    opposite: Ints,
    normal: Floats,
) -> Floats:
    in_plane, squeezed = [], []
    for side in (wall, opposite):
        across = np.outer(height[side], normal)
        in_plane.append(vertices[side] - across)
        # distances along the plane count five times as much as distances across it
        squeezed.append(in_plane[-1] + 0.2 * across)
    tree = cKDTree(squeezed[1])
    _, nearest = tree.query(squeezed[0], k=min(8, len(opposite)))
    neighbours = opposite[nearest]
    gap = height[neighbours] - height[wall][:, None]
    offset_mm = np.linalg.norm(
        in_plane[1][nearest] - in_plane[0][:, None],
        axis=-1,
    )
    gap = np.where(
        (gap > 0) & (gap < MAX_FISSURE_WIDTH * np.ptp(height)) & (offset_mm < 2.0),
        gap,
        np.inf,
    )
    best = np.argmin(gap, axis=1)
    rows = np.flatnonzero(np.isfinite(gap[np.arange(len(wall)), best]))
    return 0.5 * (vertices[wall[rows]] + vertices[neighbours[rows, best[rows]]])


def upright(plane: MidPlane, centre: Floats) -> tuple[Floats, float]:
    """Return the smallest (4, 4) rotation about `centre` to a plane x = const, and its
    degrees; none below 0.5°."""
    cosine = np.clip(plane.normal[0], -1.0, 1.0)
    angle = float(np.degrees(np.arccos(cosine)))
    if angle < MIN_TILT_DEG:
        return np.eye(4), 0.0
    axis = np.cross(plane.normal, [1.0, 0.0, 0.0])
    rotation = np.radians(angle) * axis / np.linalg.norm(axis)
    turn = Rotation.from_rotvec(rotation).as_matrix()
    shift = centre - turn @ centre
    return motion(turn, shift), angle


def _symmetry_planes(
    sample: Floats, tree: cKDTree
) -> list[tuple[Floats, float, float]]:
    centre = sample.mean(axis=0)
    few = sample[::ROUGH_EVERY]
    every = max(1, len(tree.data) // ROUGH_VERTICES)
    sparse = cKDTree(tree.data[::every], leafsize=LEAF_SIZE)
    # a Fibonacci lattice on the cap of directions around x
    index = np.arange(DIRECTIONS) + 0.5
    along = 1.0 - (1.0 - np.cos(np.radians(SEARCH_DEG))) * index / DIRECTIONS
    turn = np.pi * (1.0 + 5.0**0.5) * index
    radius = np.sqrt(1.0 - along**2)
    directions = np.stack(
        [
            along,
            radius * np.cos(turn),
            radius * np.sin(turn),
        ],
        axis=1,
    )
    scores = np.array(
        [
            _mirror_distance(
                n,
                float(n @ centre),
                few,
                sparse,
            )
            for n in directions
        ]
    )
    starts: list[Floats] = []
    for direction in directions[np.argsort(scores)]:
        is_new = all(
            abs(direction @ start) < np.cos(np.radians(20.0)) for start in starts
        )
        if len(starts) < STARTS and is_new:
            starts.append(direction)
    frames = [
        (
            start,
            np.linalg.svd(start[None])[2][1:],
            centre,
        )
        for start in starts
    ]
    rough: list[tuple[float, Floats, tuple[Floats, Floats, Floats]]] = []
    for frame in frames:
        x, _ = _most_symmetric(
            np.zeros(3),
            *ROUGH_SEARCH,
            frame,
            few,
            sparse,
        )
        # sparse vertices are further away
        asymmetry = _mirror_distance(*_plane_near(x, *frame), few, tree)
        rough.append((asymmetry, x, frame))
    rough.sort(key=itemgetter(0))
    largest = REFINED_FACTOR * rough[0][0] + REFINED_MM
    planes: list[tuple[Floats, float, float]] = []
    for asymmetry, x, frame in rough:
        plane = _plane_near(x, *frame)
        if _is_among(planes, *plane, NEAR_NORMAL, NEAR_OFFSET_MM):
            continue
        if asymmetry <= largest:
            x, asymmetry = _most_symmetric(x, *FINE_SEARCH, frame, sample, tree)
            plane = _plane_near(x, *frame)
        if not _is_among(planes, *plane, SAME_NORMAL, SAME_OFFSET_MM):
            planes.append((*plane, asymmetry))
    return planes


def _is_among(
    planes: list[tuple[Floats, float, float]],
    normal: Floats,
    offset: float,
    max_turn: float,
    max_shift_mm: float,
) -> bool:
    """Return whether a plane is one of some planes within a change of its normal and
    offset."""
    return any(
        np.abs(normal - other).max() <= max_turn
        and abs(offset - middle) <= max_shift_mm
        for other, middle, _ in planes
    )


def _most_symmetric(
    start: Floats,
    step: float,
    tolerance: float,
    frame: tuple[Floats, Floats, Floats],
    sample: Floats,
    tree: cKDTree,
) -> tuple[Floats, float]:
    """Return the (3,) parameters of the plane of `_plane_near` with the smallest mirror
    distance, and that, by Nelder-Mead."""
    best = minimize(
        lambda x: _mirror_distance(
            *_plane_near(x, *frame),
            sample,
            tree,
        ),
        start,
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([start, start + step * np.eye(3)]),
            "xatol": tolerance,
            "fatol": tolerance,
        },
    )
    return best.x, float(best.fun)


def _plane_near(
    x: Floats,
    base: Floats,
    tangents: Floats,
    centre: Floats,
) -> tuple[Floats, float]:
    normal = np.asarray(
        base + x[:2] @ tangents,
        dtype=float,
    )
    normal /= np.linalg.norm(normal)
    return normal, float(normal @ centre) + 10.0 * float(x[2])


def _scatter(
    points: Floats,
    normal: Floats,
    offset: float,
) -> tuple[int, float]:
    distance = points @ normal - offset
    near = distance[np.abs(distance) < 3.0]
    if not len(near):
        return 0, math.inf
    return len(near), math.sqrt(np.mean(near**2))


def _mirror_distance(
    normal: Floats,
    offset: float,
    sample: Floats,
    tree: cKDTree,
) -> float:
    mirrored = sample - 2.0 * np.outer(sample @ normal - offset, normal)
    distance, _ = tree.query(mirrored)
    return float(np.sort(distance)[: int(TRIM_QUANTILE * len(distance))].mean())


def _plane_through(
    points: Floats,
    normal: Floats,
    offset: float,
) -> tuple[Floats, float] | None:
    for scale in (10.0, 6.0, 4.0, 3.0, 2.0, 2.0, 2.0):
        distance = points @ normal - offset
        weights = np.where(
            np.abs(distance) < scale, (1.0 - (distance / scale) ** 2) ** 2, 0.0
        )
        if np.count_nonzero(weights) < MIN_FISSURE_POINTS:
            return None
        centre = np.average(points, axis=0, weights=weights)
        spread, axes = np.linalg.eigh(np.cov(points.T, aweights=weights))
        # points along a single line do not determine a plane
        if np.sqrt(spread[1]) < 3.0:
            return None
        fitted = axes[:, 0] * np.sign(axes[:, 0] @ normal)
        if fitted @ normal < np.cos(np.radians(25.0)):
            return None
        normal, offset = fitted, float(fitted @ centre)
    return normal, offset


@dataclass(frozen=True, eq=False)
class Fissure:
    """The mid-surface of the fissure: `heights` (a, b) in mm above the mid-sagittal
    plane, every 0.5 mm.

    They are given along `axes` (2, 3), unit vectors in the plane, from the in-plane
    coordinates `corner` (2,).
    """

    plane: MidPlane
    axes: Floats
    corner: Floats
    heights: Floats

    def height_above(self, points: Floats) -> Floats:
        """Return the (n,) distances in mm from the mid-surface along the plane's
        normal, positive to the right."""
        middle = ndimage.map_coordinates(
            self.heights, self._cells(points), order=1, mode="nearest"
        )
        return points @ self.plane.normal - self.plane.offset - middle

    def _cells(self, points: Floats) -> Floats:
        """Return the (2, n) grid coordinates of (n, 3) points, in cells of
        `heights`."""
        return np.asarray(
            (points @ self.axes.T - self.corner).T / SPACING_MM, dtype=np.float64
        )


def fissure_between(walls: TriangleMesh, plane: MidPlane) -> Fissure:
    """Return the mid-surface half-way between the facing medial walls of a closed
    surface, else the plane."""
    axes = np.linalg.svd(plane.normal[None])[2][1:]
    flat = walls.vertices @ axes.T
    corner = flat.min(axis=0) - MARGIN_MM
    shape = tuple(
        np.ceil((flat.max(axis=0) + MARGIN_MM - corner) / SPACING_MM).astype(int) + 1
    )
    fissure = Fissure(plane, axes, corner, np.zeros(shape))
    normals = triangles.vertex_normals(walls)
    middle = _fissure_points(walls.vertices, normals, plane.normal, plane.offset)
    height = middle @ plane.normal - plane.offset
    cells = np.rint(fissure._cells(middle)).astype(int)
    for _ in range(N_UPDATES):
        near = np.abs(fissure.height_above(middle)) < MAX_SHIFT_MM
        weight, total = np.zeros(shape), np.zeros(shape)
        np.add.at(
            weight,
            tuple(cells[:, near]),
            1.0,
        )
        np.add.at(
            total,
            tuple(cells[:, near]),
            height[near],
        )
        weight, total = (
            ndimage.gaussian_filter(values, BEND_MM / SPACING_MM)
            for values in (weight, total)
        )
        # a weight far below one point per cell draws the surface back to the plane
        fissure = replace(fissure, heights=total / (weight + 0.02))
    return fissure


def side_distance(
    mask: Mask,
    core: Mask,
    affine: Floats,
    fissure: Fissure,
    left: Mask | None = None,
    right: Mask | None = None,
) -> NDArray[np.float32]:
    """Return each voxel's distance in mm from the surface between the hemispheres,
    negative on the left; further away than `NEAR_MM` only its sign counts.

    A voxel of an (i, j, k) mask belongs to the hemisphere whose flood reaches it first
    (watershed): through the `core`, the tissue inside the cortex, then the cortex by
    its distance from the core. It starts from the labels `left` and `right`, or in the
    core far from the mid-surface. So gyri may reach over the mid-surface.
    """
    size = voxel_size(affine)
    places = np.argwhere(core)
    height = fissure.height_above(transform_points(places, affine))
    order = distance_to(core, size)
    order[core] = -np.abs(height)
    seeds = np.zeros(mask.shape, dtype=np.int8)
    if left is None or right is None:
        seeds[core] = np.where(
            np.abs(height) > SEED_MM,
            np.where(height < 0, 1, 2),
            0,
        )
    else:
        seeds[left & mask], seeds[right & mask] = 1, 2
    # where both sides are about equally near, they win in turn, and the middle is
    # between
    lead = np.zeros(mask.shape, dtype=np.float32)
    height = fissure.height_above(transform_points(np.argwhere(mask), affine))
    lead[mask] = LEAD_VOXELS * size.min() * np.tanh(height / size.min())
    floods = [watershed(order + sign * lead, seeds, mask=mask) for sign in (1, -1)]
    near = _slices_between(
        mask,
        height,
        floods,
        fissure.plane.normal @ affine[:3, :3],
    )
    distances = []
    for flood, compare in zip(
        floods,
        (np.less, np.less_equal),
        strict=True,
    ):
        to_left, to_right = (distance_to(flood[near] == part, size) for part in (1, 2))
        distances.append(_signed_distance(compare(to_right, to_left), size))
    # only the side counts elsewhere
    margins = [
        (part.start, length - part.stop)
        for part, length in zip(near, mask.shape, strict=True)
    ]
    distance = np.pad(
        np.mean(distances, axis=0, dtype=np.float32),
        margins,
        "edge",
    )
    return ndimage.gaussian_filter(distance, SMOOTHING_VOXELS)


def _slices_between(
    mask: Mask,
    height: Floats,
    floods: list[NDArray[np.int8]],
    normal: Floats,
) -> Box:
    """Return the part of a volume around the surface between the hemispheres: slices
    along the axis that its `normal` in voxels is closest to.

    All voxels of the mask beyond it are further than `NEAR_MM` from the mid-surface, by
    their `height` (n,), and on its side.
    """
    is_right = height > 0
    is_between = np.abs(height) < NEAR_MM
    for flood in floods:
        is_between |= (flood[mask] == 2) != is_right
    axis = int(np.abs(normal).argmax())
    places = np.nonzero(mask)[axis][is_between]
    part = [slice(0, length) for length in mask.shape]
    if len(places):
        part[axis] = slice(
            int(places.min()),
            int(places.max()) + 1,
        )
    return tuple(part)


def _signed_distance(mask: Mask, size: Floats) -> Floats:
    """Return each voxel's distance (mm) from the border of a mask, half a voxel from
    its voxels; negative outside."""
    inside = distance_to(~mask, size)
    outside = distance_to(mask, size)
    sign = np.where(mask, 1.0, -1.0)
    half_voxel = 0.5 * size.mean() * sign
    distance = inside - outside - half_voxel
    return np.asarray(distance)


def hidden_fissure(
    side_mm: NDArray[np.float32],
    brain: Mask,
    core: Mask,
    affine: Floats,
    *,
    bridges: bool = False,
) -> Mask:
    """Return the voxels of the surface between the hemispheres that cortex hides, in
    two or three layers.

    `side_mm` is that of `side_distance`, `brain` the (i, j, k) mask with all gaps that
    its labels show. The fissure ends above the tissue of the `core` that joins the
    hemispheres; small contacts elsewhere are errors of the labels. With `bridges`, bits
    of tissue that cross a visible fissure are included.
    """
    size = voxel_size(affine)
    # not whole voxels, which rounding would include or not
    sheet = np.abs(side_mm) < 1.25 * size.max()
    reach = max(0.5 * FISSURE_MM, 1.25 * size.min())
    shows = sheet & dilated(~brain, reach, size)
    # small gaps between touching walls are not a fissure, and would leave tunnels when
    # it is opened
    wide = shows & ~dilated(sheet & ~shows, MIN_VISIBLE_MM, size)
    hidden = sheet & ~dilated(wide, MIN_VISIBLE_MM, size)
    if bridges:
        number, _ = number_parts(
            brain & ~hidden & (np.abs(side_mm) < 0.45 * size.min()), OUTSIDE
        )
        sizes_mm2 = np.bincount(number.ravel()) * float(np.prod(size)) / size.min()
        hidden |= (number > 0) & (sizes_mm2 <= MAX_BRIDGE_MM2)[number]
    is_right = side_mm > 0
    touching = [
        with_neighbours(core & part) & core & ~part for part in (is_right, ~is_right)
    ]
    number, _ = number_parts(
        touching[0] | touching[1],
        OUTSIDE,
    )
    sizes = np.bincount(number.ravel())
    sizes[0] = 0
    joint = (number > 0) & (sizes >= MIN_JOINT * sizes.max())[number]
    above = sheet & ~dilated(joint, FLOOR_MM, size)
    number, _ = number_parts(above, OUTSIDE)
    return (
        above
        & hidden
        & np.isin(
            number,
            np.setdiff1d(number[~brain], 0),
        )
    )


def open_fissure(
    field: NDArray[np.float32],
    affine: Floats,
    side_mm: NDArray[np.float32],
    to_hidden_mm: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Open the hidden fissure of a smoothed (i, j, k) mask to `FISSURE_MM`, where
    cortex labels of both sides touch.

    `to_hidden_mm` is each voxel's distance from the `hidden_fissure`; elsewhere it is
    as wide as its CSF.
    """
    voxel = float(abs(np.linalg.det(affine[:3, :3])) ** (1 / 3))
    outside = np.maximum(
        np.abs(side_mm) - 0.5 * FISSURE_MM, to_hidden_mm - max(voxel, 0.5 * FISSURE_MM)
    )
    return np.minimum(
        field, np.clip(0.5 + EDGE_SLOPE * outside / voxel, 0.0, 1.0)
    ).astype(np.float32)


def sample(
    field: NDArray[np.floating],
    affine: Floats,
    points: Floats,
) -> Floats:
    """Return the (n,) values of an (i, j, k) field at (n, 3) points in mm, linear
    between voxels."""
    return ndimage.map_coordinates(
        field, voxel_index(points, affine), order=1, mode="nearest"
    )


def plane_between_labels(
    left: Mask,
    right: Mask,
    affine: Floats,
    brain: Mask,
) -> MidPlane:
    """Fit a plane half-way between (i, j, k) labels of unequal sides, in and around a
    brain."""
    size = voxel_size(affine)
    to_left = distance_to(left, size)
    to_right = distance_to(right, size)
    side = to_left - to_right
    to_brain = distance_to(brain, size)
    near = to_brain < MARGIN_MM
    is_between = near & (np.abs(side) < size.max())
    places = transform_points(np.argwhere(is_between), affine)
    centre = places.mean(axis=0)
    _, axes = np.linalg.eigh(np.cov(places.T))
    normal = axes[:, 0]
    # the normal points to where the right side is nearer
    around = transform_points(np.argwhere(near), affine)
    heights = (around - centre) @ normal
    towards_right = np.corrcoef(heights, side[near])[0, 1]
    normal = normal * np.sign(towards_right)
    return MidPlane(
        normal,
        float(normal @ centre),
        float("nan"),
        len(places),
    )


def left_faces(mesh: TriangleMesh, heights: Floats) -> Mask:
    """Return the (m,) mask of the left faces, from their (m,) `heights` above the
    fissure, negative on the left.

    Two comparable closed pieces mostly on different sides are the hemispheres.
    Otherwise patches that bulge over the fissure go to the nearest hemisphere, so that
    each is in one piece. InputError if such patches are too large.
    """
    surface = triangles.face_components(mesh)
    areas = triangles.face_areas(mesh)
    side = heights < 0
    sizes = np.bincount(surface, weights=areas)
    # walls in contact at the fissure do not count
    moments = areas * np.abs(heights)
    on_left = np.bincount(surface, weights=moments * side) / np.bincount(
        surface, weights=moments
    )
    if len(sizes) > 1 and sizes[1] >= COMPARABLE_PIECE * sizes[0]:
        # a detached lump is not a hemisphere, since the rest of the brain lies on both
        # sides
        low, high = sorted(on_left[:2])
        if low <= 1 - MIN_SHARE_ON_SIDE and high >= MIN_SHARE_ON_SIDE:
            middles = np.bincount(surface, weights=areas * heights) / sizes
            return np.asarray(middles < 0)[surface]
    adjacent = igl.facet_adjacency_matrix(mesh.faces)
    a, b = adjacent.nonzero()
    within = side[a] == side[b]
    piece = triangles.connected(
        np.stack(
            [a[within], b[within]],
            axis=1,
        ),
        len(side),
    )
    area = np.bincount(piece, weights=areas)
    largest = [
        piece[side == part][area[piece[side == part]].argmax()]
        for part in (True, False)
        if (side == part).any()
    ]
    # strays go to the nearest of the largest pieces, so that each of these stays in one
    # piece
    main = np.flatnonzero(np.isin(piece, largest))
    _, _, start = dijkstra(
        adjacent,
        indices=main,
        return_predecessors=True,
        unweighted=True,
        min_only=True,
    )
    assigned = side[
        np.where(
            start < 0,
            np.arange(len(side)),
            start,
        )
    ]
    share = float(areas[assigned != side].sum() / areas.sum())
    if share > MAX_BULGE_SHARE:
        found = (
            f"several pieces on each side; {100 * share:.0f} % of the area is not in"
            " the two largest"
        )
        expected = f"at most {100 * MAX_BULGE_SHARE:.0f} %"
        raise InputError(
            "the surface cannot be split at the fissure", found=found, expected=expected
        )
    return assigned


def largest_pieces(
    mesh: TriangleMesh,
    sides: Mapping[Side, Mask],
    to_file: Floats,
) -> tuple[Mask, list[str]]:
    """Return the (m,) mask of the faces of each hemisphere's largest piece, and
    warnings of the pieces left out.

    `sides` has the (m,) mask of each hemisphere's faces; `to_file` (4, 4) leads to the
    coordinates of places in messages. InputError if more than `MAX_LEFT_OUT` of a
    hemisphere's area would be left out.
    """
    is_kept, warnings = (
        np.zeros(
            len(mesh.faces),
            dtype=bool,
        ),
        [],
    )
    for side, is_side in sides.items():
        part, faces = triangles.submesh(mesh, is_side)[0], np.flatnonzero(is_side)
        component, areas = triangles.face_components(part), triangles.face_areas(part)
        is_kept[faces[component == 0]] = True
        if not component.any():
            continue
        centre = triangles.corners(part)[component == 1].mean(axis=(0, 1))
        place = transform_points(centre[None], to_file)[0]
        share = areas[component > 0].sum() / areas.sum()
        where = ", ".join(str(round(x)) for x in place)
        found = (
            f"the {side} hemisphere is in {component.max() + 1} pieces,"
            f" {100 * share:.1f} % of its area is outside the largest, around"
            f" ({where}) mm in the file's coordinates"
        )
        if share > MAX_LEFT_OUT:
            raise InputError(
                "a hemisphere is not in one piece",
                found=found,
                expected=(
                    f"at most {100 * MAX_LEFT_OUT:.0f} % outside its largest piece"
                ),
                remedy="Connect the piece in the labels or the surface, or remove it.",
            )
        warnings.append(f"{found}: it was left out")
    return is_kept, warnings


def cut_share(*sides: TriangleMesh) -> float:
    """Return the share of the medial walls that is a cut, of posed hemispheres: opening
    over outline from the side.

    The area vectors of a closed surface sum to zero, so those of a hemisphere give its
    opening.
    """
    cuts = sum(
        float(np.linalg.norm(triangles.area_vectors(side).sum(axis=0)))
        for side in sides
    )
    return cuts / sum(ConvexHull(side.vertices[:, 1:]).volume for side in sides)


def nearer_left(
    mesh: TriangleMesh,
    left: TriangleMesh,
    right: TriangleMesh,
) -> Mask:
    """Return the (m,) mask of the faces of a surface that are nearer to a left
    hemisphere, as by `left_faces`."""
    centres = triangles.corners(mesh).mean(axis=1)
    to_left, _, _ = nearest_on(centres, left)
    to_right, _, _ = nearest_on(centres, right)
    return left_faces(mesh, to_left - to_right)


def split(mesh: TriangleMesh, fissure_x_mm: float) -> tuple[TriangleMesh, TriangleMesh]:
    """Split a pial surface (RAS+) into its left and right faces at the plane x =
    `fissure_x_mm`, open at the cut."""
    return cut_sides(
        mesh,
        left_faces(
            mesh,
            triangles.corners(mesh)[:, :, 0].mean(axis=1) - fissure_x_mm,
        ),
    )


def cut_sides(mesh: TriangleMesh, left: Mask) -> tuple[TriangleMesh, TriangleMesh]:
    """Return the surfaces of the left faces, given as an (m,) mask, and of the others;
    InputError if one is empty."""
    if left.all() or not left.any():
        raise InputError(
            "the brain lies on one side of the interhemispheric fissure",
            found=f"{int(left.sum())} of {len(left)} faces on the left",
            expected="two hemispheres",
        )
    left_side, _ = triangles.submesh(mesh, left)
    right_side, _ = triangles.submesh(mesh, ~left)
    return left_side, right_side


def cut_middle(left: TriangleMesh, right: TriangleMesh) -> float:
    """Return the mean x in mm of the cut between hemispheres, or of the gap between
    them if both are closed."""
    borders = []
    for side in (left, right):
        pairs, counts = triangles.edges(side)
        border = np.unique(pairs[counts == 1])
        borders.append(side.vertices[border, 0])
    cut = np.concatenate(borders)
    if len(cut):
        return float(cut.mean())
    end_of_left = left.vertices[:, 0].max()
    start_of_right = right.vertices[:, 0].min()
    return float((end_of_left + start_of_right) / 2)


def smallest_gap(left: TriangleMesh, right: TriangleMesh) -> float:
    """Return the smallest distance in mm between two closed surfaces; if they overlap,
    minus the depth."""
    gaps = []
    for mesh, opposite in ((left, right), (right, left)):
        is_inside = (
            igl.fast_winding_number(opposite.vertices, opposite.faces, mesh.vertices)
            > 0.5
        )
        distance, _, _ = nearest_on(mesh.vertices, opposite)
        gaps.append(float(np.where(is_inside, -distance, distance).min()))
    return min(gaps)


def separate(
    left: TriangleMesh,
    right: TriangleMesh,
    gap_mm: float,
    to_right: Floats,
) -> tuple[TriangleMesh, TriangleMesh, float]:
    """Move two hemispheres along `to_right` (3,), a unit vector, until the gap between
    them is `gap_mm`.

    The third value is the distance that each moved in mm. InputError if it is more than
    10 mm.
    """
    moved = 0.0
    gap = smallest_gap(left, right)
    while gap < gap_mm:
        # an overlap is rarely deepest along this direction, so more than one step may
        # be needed
        step = max(0.5 * (gap_mm - gap), 0.05)
        moved += step
        if moved > MAX_SEPARATION_MM:
            problem = (
                "the hemispheres overlap too much to belong to one brain in one pose"
            )
            found = f"an overlap beyond {2 * MAX_SEPARATION_MM:g} mm"
            raise InputError(problem, found=found, expected="hemispheres side by side")
        left = TriangleMesh(left.vertices - step * to_right, left.faces)
        right = TriangleMesh(right.vertices + step * to_right, right.faces)
        gap = smallest_gap(left, right)
    return left, right, moved
