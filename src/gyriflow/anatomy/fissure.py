"""Mid-sagittal plane, interhemispheric fissure (a curved surface, opened where labels touch), left and right sides."""

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
# the left-right axis is searched within this angle of the world's x axis
SEARCH_DEG = 60.0
# a plane x = const is accepted if the distance to the mirror image is at most this factor of the best plane's, plus
# this many edge lengths, since distances are measured to vertices
SYMMETRY_TOL_FACTOR, SYMMETRY_TOL_EDGES = 1.1, 0.1
# smaller tilts are not corrected, since the plane is not more accurate
MIN_TILT_DEG = 0.5
# distances to the mirror image above this quantile are ignored as asymmetry
TRIM_QUANTILE = 0.8
FISSURE_BAND = 0.2
MAX_FISSURE_WIDTH = 0.25
MIN_FISSURE_POINTS = 60
# the plane of symmetry is kept unless a plane fitted to the fissure has less scatter by this much
MIN_IMPROVEMENT_MM = 0.02
SPACING_MM = 0.5
MARGIN_MM = 5.0
# smoothing of the mid-surface; without walls nearby it returns to the plane
BEND_MM = 4.0
MAX_SHIFT_MM = 5.0
# the mid-surface is searched this often around the previous one, so that it can follow a midline shifted far
N_UPDATES = 4
# the labels show a fissure only as a gap of at least twice this many half millimetres in the mid-surface
MIN_VISIBLE_CELLS = 8
# width to which a fissure hidden by cortex is opened
FISSURE_MM = 1.5
# thickness of the cortex left on the tissue that connects the hemispheres
FLOOR_MM = 1.2
# hemispheres are moved by at most this distance to remove an overlap
MAX_SEPARATION_MM = 10.0
# a second closed piece is a hemisphere if it has at least this share of the largest piece's area,
COMPARABLE_PIECE = 0.1
# and if both have at least this share of their area, weighted by height, on their own side of the fissure
MIN_SHARE_ON_SIDE = 0.75
# patches on the wrong side of the cut are bulges over the fissure if they are at most this share of the area
MAX_BULGE_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class MidPlane:
    """The mid-sagittal plane: points p with normal·p = offset in mm. The unit normal (3,) points from left to right.

    `asymmetry_mm` is the mean distance from the surface to its mirror image in the plane of best symmetry, without the
    largest fifth. `fissure_points` is the number of points between facing walls of the fissure to which the plane was
    fitted; 0 if there were too few, and the plane is that of mirror symmetry.
    """

    normal: Floats
    offset: float
    asymmetry_mm: float
    fissure_points: int


def mid_plane(mesh: TriangleMesh, *, named: bool = False) -> MidPlane:
    """Return the mid-sagittal plane of a closed, outward surface whose left-right axis is within `SEARCH_DEG` of x.

    Planes of mirror symmetry are the candidates. Each is fitted to the fissure, that is, to the points half-way between
    medial walls that face each other. The chosen plane has little asymmetry and many fissure points. In an asymmetric
    brain the plane of symmetry and the fissure differ; then the fissure counts. If the user has named the coordinates
    (`named`), a plane x = const that is almost as symmetric as the best is kept: a body of revolution has many planes.
    """
    weights = vertex_areas(mesh)
    selection = np.random.default_rng(0).choice(len(weights), SAMPLES, p=weights / weights.sum())
    sample, tree = mesh.vertices[selection], cKDTree(mesh.vertices)
    planes = _symmetry_planes(sample, tree)
    if named:
        x, middle = np.array([1.0, 0.0, 0.0]), float(weights @ mesh.vertices[:, 0] / weights.sum())
        distance = _mirror_distance(x, middle, sample, tree)
        least = min(asymmetry for _, _, asymmetry in planes)
        if distance < SYMMETRY_TOL_FACTOR * least + SYMMETRY_TOL_EDGES * mean_edge_length(mesh):
            return _fit_to_fissure(mesh, x, middle, distance)
    candidates = [_fit_to_fissure(mesh, *plane) for plane in planes]
    return max(candidates, key=lambda plane: (plane.fissure_points + 100.0) / (plane.asymmetry_mm + 0.5))


def _fit_to_fissure(mesh: TriangleMesh, normal: Floats, offset: float, asymmetry: float) -> MidPlane:
    fitted = _plane_through(fissure_points(mesh, normal, offset), normal, offset)
    if fitted is None:
        return MidPlane(normal, offset, asymmetry, 0)
    # the first band may have missed the fissure
    middle = fissure_points(mesh, *fitted)
    fitted = _plane_through(middle, *fitted) or fitted
    count, scatter = _scatter(middle, *fitted)
    before, by_symmetry = _scatter(middle, normal, offset)
    if before > 0.95 * count and by_symmetry < scatter + MIN_IMPROVEMENT_MM:
        return MidPlane(normal, offset, asymmetry, before)
    return MidPlane(*fitted, asymmetry, count)


def fissure_points(mesh: TriangleMesh, normal: Floats, offset: float) -> Floats:
    """Return the (k, 3) points half-way between walls that face each other across the interhemispheric fissure.

    Only walls within a fifth of the brain's width of the plane normal·p = offset are used.
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
    # distances along the plane count five times as much as distances across it
    squeezed = in_plane + 0.2 * across
    _, nearest = cKDTree(squeezed[opposite]).query(squeezed[wall], k=min(8, len(opposite)))
    neighbours = opposite[nearest]
    gap = height[neighbours] - height[wall][:, None]
    offset_mm = np.linalg.norm(in_plane[neighbours] - in_plane[wall][:, None], axis=-1)
    gap = np.where((gap > 0) & (gap < MAX_FISSURE_WIDTH * np.ptp(height)) & (offset_mm < 2.0), gap, np.inf)
    best = np.argmin(gap, axis=1)
    rows = np.flatnonzero(np.isfinite(gap[np.arange(len(wall)), best]))
    return 0.5 * (mesh.vertices[wall[rows]] + mesh.vertices[neighbours[rows, best[rows]]])


def upright(plane: MidPlane, centre: Floats) -> tuple[Floats, float]:
    """Return the smallest (4, 4) rotation about `centre` that makes the plane x = const, and its angle in degrees.

    Anterior and superior remain those of the world coordinates. Below half a degree the identity is returned.
    """
    angle = float(np.degrees(np.arccos(np.clip(plane.normal[0], -1.0, 1.0))))
    if angle < MIN_TILT_DEG:
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
    for direction in directions[np.argsort(scores)]:
        is_new = all(abs(direction @ start) < np.cos(np.radians(20.0)) for start in starts)
        if len(starts) < STARTS and is_new:
            starts.append(direction)
    planes = []
    for base in starts:
        tangents = np.linalg.svd(base[None])[2][1:]
        best = minimize(
            lambda x, *frame: _mirror_distance(*_plane_near(x, *frame), sample, tree),
            np.zeros(3),
            args=(base, tangents, centre),
            method="Nelder-Mead",
            options={"initial_simplex": np.vstack([np.zeros(3), 0.1 * np.eye(3)]), "xatol": 1e-4, "fatol": 1e-4},
        )
        planes.append((*_plane_near(best.x, base, tangents, centre), float(best.fun)))
    return planes


def _plane_near(x: Floats, base: Floats, tangents: Floats, centre: Floats) -> tuple[Floats, float]:
    normal = np.asarray(base + x[:2] @ tangents, dtype=float)
    normal /= np.linalg.norm(normal)
    return normal, float(normal @ centre) + 10.0 * float(x[2])


def _scatter(points: Floats, normal: Floats, offset: float) -> tuple[int, float]:
    distance = points @ normal - offset
    near = distance[np.abs(distance) < 3.0]
    return len(near), float(np.sqrt(np.mean(near**2))) if len(near) else float("inf")


def _mirror_distance(normal: Floats, offset: float, sample: Floats, tree: cKDTree) -> float:
    mirrored = sample - 2.0 * np.outer(sample @ normal - offset, normal)
    distance, _ = tree.query(mirrored)
    return float(np.sort(distance)[: int(TRIM_QUANTILE * len(distance))].mean())


def _plane_through(points: Floats, normal: Floats, offset: float) -> tuple[Floats, float] | None:
    for scale in (10.0, 6.0, 4.0, 3.0, 2.0, 2.0, 2.0):
        distance = points @ normal - offset
        weights = np.where(np.abs(distance) < scale, (1.0 - (distance / scale) ** 2) ** 2, 0.0)
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
    """The mid-surface of the interhemispheric fissure, as heights in mm above the mid-sagittal plane.

    `axes` (2, 3) are unit vectors in the plane. `heights` (a, b) are given every 0.5 mm along them, the first at the
    in-plane coordinates `corner` (2,).
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
        """Return the (2, n) grid coordinates of (n, 3) points, in cells of `heights`."""
        return np.asarray((points @ self.axes.T - self.corner).T / SPACING_MM, dtype=np.float64)

    def nearest_cells(self, points: Floats) -> tuple[Ints, ...]:
        """Return the two (n,) index arrays of the heights nearest to (n, 3) points."""
        ends = np.array(self.heights.shape)[:, None] - 1
        return tuple(np.clip(np.rint(self.cells(points)).astype(int), 0, ends))

    @property
    def places(self) -> Floats:
        """The (a, b, 3) points of the mid-surface in mm."""
        a, b = np.meshgrid(*(np.arange(n) * SPACING_MM for n in self.heights.shape), indexing="ij")
        flat = np.stack([a + self.corner[0], b + self.corner[1]], axis=-1)
        return np.asarray(flat @ self.axes + (self.plane.offset + self.heights)[..., None] * self.plane.normal)

    def hidden(self, mask: Mask, affine: Floats) -> Mask:
        """Return (a, b) bool: no gap in a brain's (i, j, k) mask within half a gap's width of the mid-surface."""
        voxel = float(np.linalg.norm(affine[:3, :3], axis=0).min())
        reach = max(0.5 * FISSURE_MM, voxel)
        visible = np.zeros(self.heights.shape, dtype=bool)
        for height in np.arange(-reach, reach + 0.25 * voxel, 0.5 * voxel):
            index = voxel_index(self.places + height * self.plane.normal, affine)
            visible |= ndimage.map_coordinates(mask.astype(np.float32), index, order=0, mode="constant") < 0.5
        # small gaps between touching walls are not a fissure, and would leave tunnels when it is opened
        return ~ndimage.binary_opening(visible, iterations=MIN_VISIBLE_CELLS)

    def near(self, shape: tuple[int, ...], affine: Floats, reach_mm: float) -> tuple[Ints, Floats, Floats]:
        """Return the voxels of an (i, j, k) volume within a distance of the mid-surface.

        These are their indices (n, 3), their points in mm (n, 3) and their distances (n,).
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
    """Return the mid-surface half-way between the facing medial walls of a closed surface."""
    axes = np.linalg.svd(plane.normal[None])[2][1:]
    flat = walls.vertices @ axes.T
    corner = flat.min(axis=0) - MARGIN_MM
    shape = tuple(np.ceil((flat.max(axis=0) + MARGIN_MM - corner) / SPACING_MM).astype(int) + 1)
    return between(walls, Fissure(plane, axes, corner, np.zeros(shape)))


def between(walls: TriangleMesh, start: Fissure) -> Fissure:
    """Move a mid-surface to half-way between facing walls. Parts without walls nearby stay."""
    plane, shape, bend = start.plane, start.heights.shape, BEND_MM / SPACING_MM
    middle = fissure_points(walls, plane.normal, plane.offset)
    height, fissure = middle @ plane.normal - plane.offset, start
    for _ in range(N_UPDATES):
        near = np.abs(fissure.height_above(middle)) < MAX_SHIFT_MM
        index, weight, total = start.nearest_cells(middle[near]), np.zeros(shape), np.zeros(shape)
        np.add.at(weight, index, 1.0)
        np.add.at(total, index, height[near])
        weight, total = ndimage.gaussian_filter(weight, bend), ndimage.gaussian_filter(total, bend)
        # a weight far below one point per cell draws the surface back to its previous place
        fissure = replace(start, heights=(total + 0.02 * start.heights) / (weight + 0.02))
    return fissure


def open_fissure(
    field: NDArray[np.float32], affine: Floats, core: Mask, fissure: Fissure, hidden: Mask
) -> NDArray[np.float32]:
    """Open the fissure of a smoothed (i, j, k) mask to `FISSURE_MM`, down to the tissue that joins the hemispheres.

    Labels of small fetal brains have no CSF between the medial walls: the cortex labels of both sides touch and hide
    the fissure. It lies half-way between the tissue inside the cortex (`core`) of the two sides, and ends where that
    tissue crosses the mid-surface (corpus callosum, deep grey matter, ventricles). It is opened only where it is
    `hidden` (see `Fissure.hidden`). Elsewhere its width is that of the CSF labels.
    """
    voxel = float(abs(np.linalg.det(affine[:3, :3])) ** (1 / 3))
    # core and brain on the mid-surface
    index = voxel_index(fissure.places, affine)
    core_on_surface = ndimage.map_coordinates(core.astype(np.float32), index, order=1, mode="constant") > 0.5
    brain_on_surface = ndimage.map_coordinates(field, index, order=1, mode="constant") > 0.5
    depth = ndimage.distance_transform_edt(~core_on_surface) * SPACING_MM - FLOOR_MM
    number, _ = ndimage.label(depth > 0)
    reached = np.isin(number, np.setdiff1d(number[~brain_on_surface], 0))
    if not hidden.all():
        reached &= hidden
        depth = np.minimum(depth, ndimage.distance_transform_edt(hidden) * SPACING_MM)
    if not reached.any():
        return field
    depth = np.where(reached, depth, -ndimage.distance_transform_edt(~reached) * SPACING_MM)
    # signed distance of voxels near the mid-surface from the opening
    near, points, distance = fissure.near(field.shape, affine, FISSURE_MM / 2 + 2.0 * voxel)
    below = -ndimage.map_coordinates(depth, fissure.cells(points), order=1, mode="nearest")
    outside = np.maximum(distance - FISSURE_MM / 2, below)
    result, voxels = field.copy(), tuple(near.T)
    result[voxels] = np.minimum(result[voxels], np.clip(0.5 + EDGE_SLOPE * outside / voxel, 0.0, 1.0))
    return result


def signed_side_distance(labels: NDArray[np.integer], scheme: LabelScheme, affine: Floats) -> Floats:
    """Return each voxel's distance in mm to the left hemisphere's labels minus that to the right hemisphere's.

    It is negative on the left, positive on the right and zero half-way between.
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
    """Fit a plane to the points half-way between the labels of the two sides, in and around a brain.

    It serves brains whose hemispheres are too unequal for a plane of mirror symmetry. `side` is the result of
    `signed_side_distance`, `brain` the (i, j, k) mask of the brain.
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
    """Move the mid-surface `fissure` to half-way between the labels of the two sides.

    Parts that would move by more than 5 mm stay. `side` (i, j, k) is the result of `signed_side_distance`, for voxels
    of the (4, 4) affine.
    """
    steps = np.arange(-MAX_SHIFT_MM, MAX_SHIFT_MM + SPACING_MM, SPACING_MM)
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
    mostly on different sides are the hemispheres, even if they reach over the fissure. Otherwise patches that bulge
    over the fissure are assigned to the hemisphere that surrounds them, so that each is in one piece. InputError if
    such patches are too large, so that a cut would not separate the hemispheres.
    """
    surface = face_components(mesh)
    areas = face_areas(mesh)
    side = heights < 0
    sizes = np.bincount(surface, weights=areas)
    # walls in contact at the fissure do not count
    moments = areas * np.abs(heights)
    on_left = np.bincount(surface, weights=moments * side) / np.bincount(surface, weights=moments)
    if len(sizes) > 1 and sizes[1] >= COMPARABLE_PIECE * sizes[0]:
        # a detached lump is not a hemisphere, since the rest of the brain lies on both sides
        low, high = sorted(on_left[:2])
        if low <= 1 - MIN_SHARE_ON_SIDE and high >= MIN_SHARE_ON_SIDE:
            middles = np.bincount(surface, weights=areas * heights) / sizes
            return np.asarray(middles < 0)[surface]
    a, b = igl.facet_adjacency_matrix(mesh.faces).nonzero()
    reassigned = np.zeros(len(side), dtype=bool)
    # reassigned patches may connect pieces of the other side
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
        reassigned ^= strays
        side = side ^ strays
    share = float(areas[reassigned].sum() / areas.sum())
    if share > MAX_BULGE_SHARE:
        found = f"several pieces on each side; {100 * share:.0f} % of the area is not in the two largest"
        expected = f"at most {100 * MAX_BULGE_SHARE:.0f} %"
        raise InputError("the surface cannot be split at the fissure", found=found, expected=expected)
    return side


def nearer_left(mesh: TriangleMesh, left: TriangleMesh, right: TriangleMesh) -> Mask:
    """Return the (m,) mask of the left faces of a surface that lies close to the two given hemispheres.

    A face belongs to the hemisphere whose surface is nearer to its centroid, so `mesh` is cut along the same curved
    fissure as the hemispheres. Stray patches are reassigned as in `left_faces`.
    """
    centres = corners(mesh).mean(axis=1)
    to_left, to_right = (nearest_on(centres, side)[0] for side in (left, right))
    return left_faces(mesh, to_left - to_right)


def split(mesh: TriangleMesh, fissure_x_mm: float) -> tuple[TriangleMesh, TriangleMesh]:
    """Split a pial surface into left and right hemisphere at the plane x = `fissure_x_mm` (RAS+).

    Each face of `mesh` is in one of them. They are open where a connected brain is cut.
    """
    return cut_sides(mesh, left_faces(mesh, corners(mesh)[:, :, 0].mean(axis=1) - fissure_x_mm))


def cut_sides(mesh: TriangleMesh, left: Mask) -> tuple[TriangleMesh, TriangleMesh]:
    """Return the surfaces of the left faces, given as an (m,) mask, and of the others; InputError if one is empty."""
    if left.all() or not left.any():
        problem = "the brain lies on one side of the interhemispheric fissure"
        found = f"{int(left.sum())} of {len(left)} faces on the left"
        raise InputError(problem, found=found, expected="two hemispheres")
    return submesh(mesh, left)[0], submesh(mesh, ~left)[0]


def smallest_gap(left: TriangleMesh, right: TriangleMesh) -> float:
    """Return the smallest distance in mm between two closed surfaces; if they overlap, minus the depth."""
    gaps = []
    for mesh, opposite in ((left, right), (right, left)):
        is_inside = igl.fast_winding_number(opposite.vertices, opposite.faces, mesh.vertices) > 0.5
        distance, _, _ = nearest_on(mesh.vertices, opposite)
        gaps.append(float(np.where(is_inside, -distance, distance).min()))
    return min(gaps)


def separate(
    left: TriangleMesh, right: TriangleMesh, gap_mm: float, to_right: Floats
) -> tuple[TriangleMesh, TriangleMesh, float]:
    """Move two hemispheres until the gap between them is `gap_mm`.

    They move by equal distances along `to_right` (3,), a unit vector from left to right. The third value is this
    distance in mm, 0 if the gap was wide enough. InputError if more than 10 mm would be needed.
    """
    moved = 0.0
    gap = smallest_gap(left, right)
    while gap < gap_mm:
        # an overlap is rarely deepest along this direction, so more than one step may be needed
        step = max(0.5 * (gap_mm - gap), 0.05)
        moved += step
        if moved > MAX_SEPARATION_MM:
            problem = "the hemispheres overlap too much to belong to one brain in one pose"
            found = f"an overlap beyond {2 * MAX_SEPARATION_MM:g} mm"
            raise InputError(problem, found=found, expected="hemispheres side by side")
        left = TriangleMesh(left.vertices - step * to_right, left.faces)
        right = TriangleMesh(right.vertices + step * to_right, right.faces)
        gap = smallest_gap(left, right)
    return left, right, moved
