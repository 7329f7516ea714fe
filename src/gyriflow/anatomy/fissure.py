"""The mid-sagittal plane, the fissure as a curved surface, opened where labels touch, and left and right beside it."""

from dataclasses import dataclass, replace

import igl
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.optimize import minimize
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.alignment import motion
from ..geometry.deformations import transform_points, voxel_index
from ..geometry.matching import nearest_on
from ..geometry.triangles import (
    Ints,
    TriangleMesh,
    corners,
    face_areas,
    face_components,
    mean_edge_length,
    submesh,
    vertex_areas,
    vertex_normals,
)
from ..settings.schemes import LabelScheme
from .extraction import EDGE_SLOPE, Floats, Mask

SAMPLES = 600
DIRECTIONS = 400
STARTS = 5
# the left-right axis is looked for within this angle of the world's x axis
SEARCH_DEG = 60.0
# how much farther from its mirror image a surface may be in the plane of its coordinates than in the best one: by a
# factor, and by edges, since distances are those to vertices
NEARLY, NEARLY_EDGES = 1.1, 0.1
# smaller tilts are left as they are: the plane is not known better than this
LEAST_TILT_DEG = 0.5
# of the distances to the mirror image, those above this quantile count as asymmetry
TRIMMED = 0.8
FISSURE_BAND = 0.2
WIDEST_FISSURE = 0.25
FEWEST_FISSURE_POINTS = 60
# the plane of symmetry is kept where the fissure fits it nearly as well as a plane of its own
CLEARLY_BETTER_MM = 0.02
SPACING_MM = 0.5
MARGIN_MM = 5.0
# the mid-surface follows the walls over this distance, and returns to the plane where there are none
BEND_MM = 4.0
FURTHEST_MM = 5.0
# how often the mid-surface is searched for around the last one, so that it follows a midline that is shifted far
FOLLOWED = 4
# a fissure is shown where it is so wide a gap in its own plane: twice this many half millimetres
SHOWN_CELLS = 8
# the width to which a fissure that cortex hides is opened
FISSURE_MM = 1.5
# cortex that stays on the tissue which joins the hemispheres
FLOOR_MM = 1.2
# hemispheres that overlap by more are not moved apart
FURTHEST_APART_MM = 10.0
# a second closed piece of this part of the largest is a hemisphere
COMPARABLE_PIECE = 0.1
# and has this part of its area, or more, on its own side of the fissure, as the largest has: a whole brain has half
ON_ITS_SIDE = 0.75
# of a cut surface, patches on the wrong side of the cut up to this share are bulges over the fissure
MOST_GIVEN_BACK = 0.05


@dataclass(frozen=True, eq=False)
class MidPlane:
    """The mid-sagittal plane, the points p with normal·p = offset in mm; the unit normal (3,) is from left to right.

    `asymmetry_mm` is the mean distance from the surface to its image in the plane of best symmetry, without the largest
    fifth; `fissure_points` the number of places between facing walls of the fissure that the plane was fitted to, 0
    where too few were found and it is that of mirror symmetry.
    """

    normal: Floats
    offset: float
    asymmetry_mm: float
    fissure_points: int


def mid_plane(mesh: TriangleMesh, *, named: bool = False) -> MidPlane:
    """Return the mid-sagittal plane of a closed, outward surface whose left-right axis is within an angle of x.

    Planes of mirror symmetry are the candidates; each is fitted to the fissure, that is, to the middle between medial
    walls that face each other. The best has both little asymmetry and much fissure. In an asymmetric brain the plane
    of symmetry and the fissure differ, and the fissure decides. In coordinates that the user has named, a plane
    x = const that is nearly as good a mirror as the best is kept: a body of revolution has many.
    """
    weights = vertex_areas(mesh)
    chosen = np.random.default_rng(0).choice(len(weights), SAMPLES, p=weights / weights.sum())
    sample, tree = mesh.vertices[chosen], cKDTree(mesh.vertices)
    planes = _symmetry_planes(sample, tree)
    if named:
        x, middle = np.array([1.0, 0.0, 0.0]), float(weights @ mesh.vertices[:, 0] / weights.sum())
        distance = _mirror_distance(x, middle, sample, tree)
        if distance < NEARLY * min(asymmetry for _, _, asymmetry in planes) + NEARLY_EDGES * mean_edge_length(mesh):
            return _fit_to_fissure(mesh, x, middle, distance)
    candidates = [_fit_to_fissure(mesh, *plane) for plane in planes]
    return max(candidates, key=lambda plane: (plane.fissure_points + 100.0) / (plane.asymmetry_mm + 0.5))


def _fit_to_fissure(mesh: TriangleMesh, normal: Floats, offset: float, asymmetry: float) -> MidPlane:
    fitted = _plane_through(fissure_points(mesh, normal, offset), normal, offset)
    if fitted is None:
        return MidPlane(normal, offset, asymmetry, 0)
    # the first band may have been beside the fissure
    middle = fissure_points(mesh, *fitted)
    fitted = _plane_through(middle, *fitted) or fitted
    count, scatter = _scatter(middle, *fitted)
    before, by_symmetry = _scatter(middle, normal, offset)
    if before > 0.95 * count and by_symmetry < scatter + CLEARLY_BETTER_MM:
        return MidPlane(normal, offset, asymmetry, before)
    return MidPlane(*fitted, asymmetry, count)


def fissure_points(mesh: TriangleMesh, normal: Floats, offset: float) -> Floats:
    """Return (k, 3) places half-way between walls that face each other across the interhemispheric fissure.

    Only walls in a band around the plane normal·p = offset are looked at: a fifth of the brain's width to each side.
    """
    height = mesh.vertices @ normal - offset
    width = np.ptp(height)
    facing = vertex_normals(mesh) @ normal
    near = np.abs(height) < FISSURE_BAND * width
    left, right = np.flatnonzero(near & (facing > 0.5)), np.flatnonzero(near & (facing < -0.5))
    if len(left) < 8 or len(right) < 8:
        return np.empty((0, 3))
    return np.concatenate([_middles(mesh, height, left, right, normal), _middles(mesh, -height, right, left, -normal)])


def _middles(mesh: TriangleMesh, height: Floats, wall: Ints, opposite: Ints, normal: Floats) -> Floats:
    across = np.outer(height, normal)
    in_plane = mesh.vertices - across
    # distances along the plane count five times those across it
    squeezed = in_plane + 0.2 * across
    _, nearest = cKDTree(squeezed[opposite]).query(squeezed[wall], k=min(8, len(opposite)))
    met = opposite[nearest]
    gap = height[met] - height[wall][:, None]
    aside = np.linalg.norm(in_plane[met] - in_plane[wall][:, None], axis=-1)
    gap = np.where((gap > 0) & (gap < WIDEST_FISSURE * np.ptp(height)) & (aside < 2.0), gap, np.inf)
    best = np.argmin(gap, axis=1)
    rows = np.flatnonzero(np.isfinite(gap[np.arange(len(wall)), best]))
    return 0.5 * (mesh.vertices[wall[rows]] + mesh.vertices[met[rows, best[rows]]])


def upright(plane: MidPlane, centre: Floats) -> tuple[Floats, float]:
    """Return the (4, 4) rotation about `centre` that turns the plane to x = const, and its angle in degrees.

    It is the smallest such rotation, so that anterior and superior stay as the world coordinates have them.
    Below half a degree it is none.
    """
    angle = float(np.degrees(np.arccos(np.clip(plane.normal[0], -1.0, 1.0))))
    if angle < LEAST_TILT_DEG:
        return np.eye(4), 0.0
    axis = np.cross(plane.normal, [1.0, 0.0, 0.0])
    turn = Rotation.from_rotvec(np.radians(angle) * axis / np.linalg.norm(axis)).as_matrix()
    return motion(turn, centre - turn @ centre), angle


def _symmetry_planes(sample: Floats, tree: cKDTree) -> list[tuple[Floats, float, float]]:
    centre = sample.mean(axis=0)
    # a Fibonacci lattice on the cap of directions around x
    index = np.arange(DIRECTIONS) + 0.5
    along = 1.0 - (1.0 - np.cos(np.radians(SEARCH_DEG))) * index / DIRECTIONS
    turn = np.pi * (1.0 + 5.0**0.5) * index
    radius = np.sqrt(1.0 - along**2)
    directions = np.stack([along, radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    scores = np.array([_mirror_distance(n, float(n @ centre), sample[::3], tree) for n in directions])
    starts: list[Floats] = []
    for one in directions[np.argsort(scores)]:
        if len(starts) < STARTS and all(abs(one @ other) < np.cos(np.radians(20.0)) for other in starts):
            starts.append(one)
    planes = []
    for base in starts:
        aside = np.linalg.svd(base[None])[2][1:]
        best = minimize(
            lambda x, *frame: _mirror_distance(*_plane_near(x, *frame), sample, tree),
            np.zeros(3),
            args=(base, aside, centre),
            method="Nelder-Mead",
            options={"initial_simplex": np.vstack([np.zeros(3), 0.1 * np.eye(3)]), "xatol": 1e-4, "fatol": 1e-4},
        )
        planes.append((*_plane_near(best.x, base, aside, centre), float(best.fun)))
    return planes


def _plane_near(x: Floats, base: Floats, aside: Floats, centre: Floats) -> tuple[Floats, float]:
    normal = np.asarray(base + x[:2] @ aside, dtype=float)
    normal /= np.linalg.norm(normal)
    return normal, float(normal @ centre) + 10.0 * float(x[2])


def _scatter(points: Floats, normal: Floats, offset: float) -> tuple[int, float]:
    distance = points @ normal - offset
    near = distance[np.abs(distance) < 3.0]
    return len(near), float(np.sqrt(np.mean(near**2))) if len(near) else float("inf")


def _mirror_distance(normal: Floats, offset: float, sample: Floats, tree: cKDTree) -> float:
    mirrored = sample - 2.0 * np.outer(sample @ normal - offset, normal)
    distance, _ = tree.query(mirrored)
    return float(np.sort(distance)[: int(TRIMMED * len(distance))].mean())


def _plane_through(points: Floats, normal: Floats, offset: float) -> tuple[Floats, float] | None:
    for scale in (10.0, 6.0, 4.0, 3.0, 2.0, 2.0, 2.0):
        distance = points @ normal - offset
        weights = np.where(np.abs(distance) < scale, (1.0 - (distance / scale) ** 2) ** 2, 0.0)
        if np.count_nonzero(weights) < FEWEST_FISSURE_POINTS:
            return None
        centre = np.average(points, axis=0, weights=weights)
        spread, axes = np.linalg.eigh(np.cov(points.T, aweights=weights))
        # along a single line of points the plane could still turn
        if np.sqrt(spread[1]) < 3.0:
            return None
        fitted = axes[:, 0] * np.sign(axes[:, 0] @ normal)
        if fitted @ normal < np.cos(np.radians(25.0)):
            return None
        normal, offset = fitted, float(fitted @ centre)
    return normal, offset


@dataclass(frozen=True, eq=False)
class Fissure:
    """The mid-surface of the interhemispheric fissure: heights in mm above the mid-sagittal plane.

    `axes` (2, 3) are unit vectors in the plane, `heights` (a, b) lie every 0.5 mm along them, the first at the in-plane
    coordinates `corner` (2,).
    """

    plane: MidPlane
    axes: Floats
    corner: Floats
    heights: Floats

    def height_above(self, points: Floats) -> Floats:
        """Return the (n,) distances in mm from the mid-surface along the plane's normal, positive to the right."""
        middle = ndimage.map_coordinates(self.heights, self.cells(points), order=1, mode="nearest")
        return points @ self.plane.normal - self.plane.offset - middle

    def cells(self, points: Floats) -> Floats:
        """Return the (2, n) places of (n, 3) points among the heights, in steps of these."""
        return np.asarray((points @ self.axes.T - self.corner).T / SPACING_MM, dtype=np.float64)

    def nearest_cells(self, points: Floats) -> tuple[Ints, ...]:
        """Return the indices, two of (n,), of the heights nearest to (n, 3) points."""
        ends = np.array(self.heights.shape)[:, None] - 1
        return tuple(np.clip(np.rint(self.cells(points)).astype(int), 0, ends))

    @property
    def places(self) -> Floats:
        """The (a, b, 3) places of the heights in mm."""
        a, b = np.meshgrid(*(np.arange(n) * SPACING_MM for n in self.heights.shape), indexing="ij")
        flat = np.stack([a + self.corner[0], b + self.corner[1]], axis=-1)
        return np.asarray(flat @ self.axes + (self.plane.offset + self.heights)[..., None] * self.plane.normal)

    def hidden(self, mask: Mask, affine: Floats) -> Mask:
        """Return where a brain's (i, j, k) mask shows no fissure within half a gap of the mid-surface, (a, b) bool."""
        voxel = float(np.linalg.norm(affine[:3, :3], axis=0).min())
        reach = max(0.5 * FISSURE_MM, voxel)
        shown = np.zeros(self.heights.shape, dtype=bool)
        for height in np.arange(-reach, reach + 0.25 * voxel, 0.5 * voxel):
            index = voxel_index(self.places + height * self.plane.normal, affine)
            shown |= ndimage.map_coordinates(mask.astype(np.float32), index, order=0, mode="constant") < 0.5
        # gaps here and there between touching walls show no fissure, but would leave tunnels in one that is opened
        return ~ndimage.binary_opening(shown, iterations=SHOWN_CELLS)

    def near(self, shape: tuple[int, ...], affine: Floats, reach_mm: float) -> tuple[Ints, Floats, Floats]:
        """Return the voxels of an (i, j, k) volume within a distance of the mid-surface: their indices (n, 3), their
        places in mm (n, 3) and their distances (n,).
        """
        steps = affine[:3, :3].T @ self.plane.normal
        i, j, k = (float(step) * np.arange(size, dtype=np.float32) for step, size in zip(steps, shape, strict=True))
        first = float(self.plane.normal @ affine[:3, 3] - self.plane.offset)
        above_plane = np.abs((i + first)[:, None, None] + j[:, None] + k)
        voxels = np.argwhere(above_plane < reach_mm + np.abs(self.heights).max() + SPACING_MM)
        points = transform_points(voxels, affine)
        distance = np.abs(self.height_above(points))
        close = distance < reach_mm
        return voxels[close], points[close], distance[close]


def fissure_between(walls: TriangleMesh, plane: MidPlane) -> Fissure:
    """Return the mid-surface half-way between medial walls of a closed surface that face each other."""
    axes = np.linalg.svd(plane.normal[None])[2][1:]
    flat = walls.vertices @ axes.T
    corner = flat.min(axis=0) - MARGIN_MM
    shape = tuple(np.ceil((flat.max(axis=0) + MARGIN_MM - corner) / SPACING_MM).astype(int) + 1)
    return between(walls, Fissure(plane, axes, corner, np.zeros(shape)))


def between(walls: TriangleMesh, start: Fissure) -> Fissure:
    """Return a mid-surface moved to half-way between walls that face each other; where there are none, it stays."""
    plane, shape, bend = start.plane, start.heights.shape, BEND_MM / SPACING_MM
    middle = fissure_points(walls, plane.normal, plane.offset)
    height, fissure = middle @ plane.normal - plane.offset, start
    for _ in range(FOLLOWED):
        near = np.abs(fissure.height_above(middle)) < FURTHEST_MM
        index, weight, total = start.nearest_cells(middle[near]), np.zeros(shape), np.zeros(shape)
        np.add.at(weight, index, 1.0)
        np.add.at(total, index, height[near])
        weight, total = ndimage.gaussian_filter(weight, bend), ndimage.gaussian_filter(total, bend)
        # a weight much below that of one point per cell draws the surface back to where it was
        fissure = replace(start, heights=(total + 0.02 * start.heights) / (weight + 0.02))
    return fissure


def open_fissure(
    field: NDArray[np.float32], affine: Floats, core: Mask, fissure: Fissure, hidden: Mask
) -> NDArray[np.float32]:
    """Return the smoothed (i, j, k) mask with the fissure `FISSURE_MM` wide or more down to what joins the hemispheres.

    Small fetal brains have no CSF label between their medial walls: there the cortex labels of both sides touch and
    hide the fissure. It lies half-way between the tissue inside the cortex (`core`) of the two sides, and ends where
    that tissue crosses the mid-surface (corpus callosum, deep grey matter, ventricles). It is opened only where it is
    `hidden`, as `Fissure.hidden` returns: what labels of CSF show is as wide as they say.
    """
    voxel = float(abs(np.linalg.det(affine[:3, :3])) ** (1 / 3))
    # the mid-surface, seen flat: where is the core, where is the brain
    index = voxel_index(fissure.places, affine)
    core_there = ndimage.map_coordinates(core.astype(np.float32), index, order=1, mode="constant") > 0.5
    brain_there = ndimage.map_coordinates(field, index, order=1, mode="constant") > 0.5
    depth = ndimage.distance_transform_edt(~core_there) * SPACING_MM - FLOOR_MM
    number, _ = ndimage.label(depth > 0)
    reached = np.isin(number, np.setdiff1d(number[~brain_there], 0))
    if not hidden.all():
        reached &= hidden
        depth = np.minimum(depth, ndimage.distance_transform_edt(hidden) * SPACING_MM)
    if not reached.any():
        return field
    depth = np.where(reached, depth, -ndimage.distance_transform_edt(~reached) * SPACING_MM)
    # voxels near the mid-surface: outside the opening by this distance
    near, points, distance = fissure.near(field.shape, affine, FISSURE_MM / 2 + 2.0 * voxel)
    below = -ndimage.map_coordinates(depth, fissure.cells(points), order=1, mode="nearest")
    outside = np.maximum(distance - FISSURE_MM / 2, below)
    result, at = field.copy(), tuple(near.T)
    result[at] = np.minimum(result[at], np.clip(0.5 + EDGE_SLOPE * outside / voxel, 0.0, 1.0))
    return result


def to_the_right(labels: NDArray[np.integer], scheme: LabelScheme, affine: Floats) -> Floats:
    """Return for each voxel the distance in mm to the left hemisphere's labels less that to the right one's.

    It is negative on the left, positive on the right, and zero half-way between the two.
    """
    size = np.linalg.norm(affine[:3, :3], axis=0)
    left, right = (
        ndimage.distance_transform_edt(~np.isin(labels, side), sampling=size) for side in (scheme.left, scheme.right)
    )
    return np.asarray(left - right)


def sample(field: NDArray[np.floating], affine: Floats, points: Floats) -> Floats:
    """Return the (n,) values of an (i, j, k) field at (n, 3) points in mm, linear between voxels."""
    return ndimage.map_coordinates(field, voxel_index(points, affine), order=1, mode="nearest")


def plane_between_labels(side: Floats, affine: Floats, brain: Mask) -> MidPlane:
    """Return the plane through the places half-way between the labels of the two sides, in and around a brain.

    It is for brains whose hemispheres are too unequal for a plane of mirror symmetry. `side` is what `to_the_right`
    returns, `brain` (i, j, k) where the brain is.
    """
    size = np.linalg.norm(affine[:3, :3], axis=0)
    near = ndimage.distance_transform_edt(~brain, sampling=size) < MARGIN_MM
    places = transform_points(np.argwhere(near & (np.abs(side) < size.max())), affine)
    centre = places.mean(axis=0)
    _, axes = np.linalg.eigh(np.cov(places.T))
    normal = axes[:, 0]
    heights = (transform_points(np.argwhere(near), affine) - centre) @ normal
    normal = normal * np.sign(np.corrcoef(heights, side[near])[0, 1])
    return MidPlane(normal, float(normal @ centre), float("nan"), len(places))


def fissure_between_labels(side: Floats, affine: Floats, fissure: Fissure) -> Fissure:
    """Return the mid-surface moved to half-way between the labels of the two sides.

    Where that is more than 5 mm away, it stays the mid-surface between facing walls, `fissure`. `side` (i, j, k) is
    what `to_the_right` returns, for voxels of the (4, 4) affine.
    """
    steps = np.arange(-FURTHEST_MM, FURTHEST_MM + SPACING_MM, SPACING_MM)
    line = fissure.places[None] + steps[:, None, None, None] * fissure.plane.normal
    values = sample(side, affine, line.reshape(-1, 3)).reshape(line.shape[:3])
    crossing = (values[:-1] < 0) & (values[1:] >= 0)
    share = -values[:-1] / np.where(crossing, values[1:] - values[:-1], 1.0)
    moves = np.where(crossing, steps[:-1, None, None] + share * SPACING_MM, np.inf)
    nearest = np.abs(moves).argmin(axis=0)
    move = np.take_along_axis(moves, nearest[None], axis=0)[0]
    crossed = np.isfinite(move)
    bend = 0.25 * BEND_MM / SPACING_MM
    weight = ndimage.gaussian_filter(crossed.astype(float), bend)
    total = ndimage.gaussian_filter(np.where(crossed, move, 0.0), bend)
    return replace(fissure, heights=fissure.heights + total / (weight + 0.02))


def left_faces(mesh: TriangleMesh, heights: Floats) -> Mask:
    """Return the (m,) mask of the faces of the left hemisphere.

    `heights` (m,) are the distances of the faces from the fissure, negative on the left. Two comparable closed pieces
    that lie mostly on different sides are the hemispheres, though they may reach over the fissure. Else patches that
    bulge over the fissure are given back to the hemisphere that surrounds them, so that each is in one piece.
    InputError where such patches are too large: a cut there would not part the hemispheres.
    """
    surface = face_components(mesh)
    areas = face_areas(mesh)
    side = heights < 0
    sizes = np.bincount(surface, weights=areas)
    on_left = np.bincount(surface, weights=areas * side) / sizes
    if len(sizes) > 1 and sizes[1] >= COMPARABLE_PIECE * sizes[0]:
        # a detached lump is no second hemisphere: the brain beside it lies on both sides
        low, high = sorted(on_left[:2])
        if low <= 1 - ON_ITS_SIDE and high >= ON_ITS_SIDE:
            middles = np.bincount(surface, weights=areas * heights) / sizes
            return np.asarray(middles < 0)[surface]
    a, b = igl.facet_adjacency_matrix(mesh.faces).nonzero()
    given_back = np.zeros(len(side), dtype=bool)
    # what is given back may join pieces of the other side
    for _ in range(3):
        within = side[a] == side[b]
        graph = sparse.coo_matrix((np.ones(within.sum()), (a[within], b[within])), shape=(len(side),) * 2)
        piece = connected_components(graph, directed=False)[1]
        area = np.bincount(piece, weights=areas)
        largest = [
            piece[side == left][area[piece[side == left]].argmax()] for left in (True, False) if (side == left).any()
        ]
        strays = ~np.isin(piece, largest)
        if not strays.any():
            break
        given_back ^= strays
        side = side ^ strays
    share = float(areas[given_back].sum() / areas.sum())
    if share > MOST_GIVEN_BACK:
        raise InputError(
            "the surface cannot be parted at the fissure",
            found=f"a left and a right part in several pieces, {100 * share:.0f} % of the area beside the largest two",
            expected=f"one piece for each hemisphere, {100 * MOST_GIVEN_BACK:.0f} % beside them",
        )
    return side


def nearer_left(mesh: TriangleMesh, left: TriangleMesh, right: TriangleMesh) -> Mask:
    """Return the (m,) mask of the faces that lie on the left hemisphere, of a surface close to that of both.

    A face belongs to the hemisphere whose given surface is nearer to its centroid: where a connected brain was cut
    along a curved fissure, so is `mesh`. Stray patches are given back as in `left_faces`.
    """
    centres = corners(mesh).mean(axis=1)
    away, back = (nearest_on(centres, side)[0] for side in (left, right))
    return left_faces(mesh, away - back)


def split(mesh: TriangleMesh, fissure_x_mm: float) -> tuple[TriangleMesh, TriangleMesh]:
    """Return the left and the right hemisphere's pial surfaces; together they have every face of `mesh` once.

    The fissure is the plane x = `fissure_x_mm` in RAS+. The parts are open where a connected brain is cut.
    """
    return cut_sides(mesh, left_faces(mesh, corners(mesh)[:, :, 0].mean(axis=1) - fissure_x_mm))


def cut_sides(mesh: TriangleMesh, left: Mask) -> tuple[TriangleMesh, TriangleMesh]:
    """Return the surfaces of the faces where the (m,) mask holds, and of the others.

    InputError where one of the two has no face.
    """
    if left.all() or not left.any():
        raise InputError(
            "the brain lies on one side of the interhemispheric fissure",
            found=f"{int(left.sum())} of {len(left)} faces on the left",
            expected="two hemispheres",
        )
    return submesh(mesh, left)[0], submesh(mesh, ~left)[0]


def least_gap(left: TriangleMesh, right: TriangleMesh) -> float:
    """Return the least distance in mm between two closed surfaces, negative by the depth where they overlap."""
    gaps = []
    for one, other in ((left, right), (right, left)):
        inward = igl.fast_winding_number(other.vertices, other.faces, one.vertices) > 0.5
        distance, _, _ = nearest_on(one.vertices, other)
        gaps.append(float(np.where(inward, -distance, distance).min()))
    return min(gaps)


def set_apart(
    left: TriangleMesh, right: TriangleMesh, gap_mm: float, to_right: Floats
) -> tuple[TriangleMesh, TriangleMesh, float]:
    """Return the hemispheres moved apart, each by the same, until they are `gap_mm` from each other.

    They move along the direction `to_right` (3,), a unit vector from left to right.

    The third value is the distance in mm by which each was moved; 0 where the gap was there already.
    InputError where more than 10 mm would be needed.
    """
    moved = 0.0
    gap = least_gap(left, right)
    while gap < gap_mm:
        # the shortest way out of an overlap is rarely along this direction, so more than one step may be needed
        step = max(0.5 * (gap_mm - gap), 0.05)
        moved += step
        if moved > FURTHEST_APART_MM:
            raise InputError(
                "the hemispheres overlap too much to be of one brain in one pose",
                found=f"an overlap beyond {2 * FURTHEST_APART_MM:g} mm",
                expected="hemispheres side by side",
            )
        left = TriangleMesh(left.vertices - step * to_right, left.faces)
        right = TriangleMesh(right.vertices + step * to_right, right.faces)
        gap = least_gap(left, right)
    return left, right, moved
