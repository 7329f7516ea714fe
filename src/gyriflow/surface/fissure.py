"""The interhemispheric fissure as a curved surface, and its opening where labels of the two sides touch."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..geometry.triangles import TriangleMesh
from ..parameters.schemes import LabelScheme
from .extraction import EDGE_SLOPE
from .orientation import MidPlane, fissure_points

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

SPACING_MM = 0.5
MARGIN_MM = 5.0
# the mid-surface follows the walls over this distance, and returns to the plane where there are none
BEND_MM = 4.0
FURTHEST_MM = 5.0
# how often the mid-surface is searched for around the last one, so that it follows a midline that is shifted far
FOLLOWED = 4
# a mid-surface that is this far from its plane is reported
SHIFTED_MM = 5.0
# a fissure is shown where it is so wide a gap in its own plane: twice this many half millimetres
SHOWN_CELLS = 8
# cortex that stays on the tissue which joins the hemispheres
FLOOR_MM = 1.2


@dataclass(frozen=True, eq=False)
class Fissure:
    """The mid-surface of the interhemispheric fissure: heights in mm above the mid-sagittal plane.

    Attributes
    ----------
    plane
        The mid-sagittal plane.
    axes : (2, 3) float
        Unit vectors in the plane.
    corner : (2,) float
        In-plane coordinates of the first height.
    heights : (a, b) float
        Heights every 0.5 mm.
    """

    plane: MidPlane
    axes: Floats
    corner: Floats
    heights: Floats

    def height_above(self, points: Floats) -> Floats:
        """Returns the (n,) distances in mm from the mid-surface along the plane's normal, positive to the right."""
        index = ((points @ self.axes.T - self.corner) / SPACING_MM).T
        middle = ndimage.map_coordinates(self.heights, index, order=1, mode="nearest")
        return points @ self.plane.normal - self.plane.offset - middle

    @property
    def places(self) -> Floats:
        """The (a, b, 3) places of the heights in mm."""
        a, b = np.meshgrid(*(np.arange(n) * SPACING_MM for n in self.heights.shape), indexing="ij")
        flat = np.stack([a + self.corner[0], b + self.corner[1]], axis=-1)
        return np.asarray(flat @ self.axes + (self.plane.offset + self.heights)[..., None] * self.plane.normal)

    def hidden(self, mask: Mask, affine: Floats, gap_mm: float) -> Mask:
        """Returns where a brain's (i, j, k) mask shows no fissure within half a gap of the mid-surface, (a, b) bool."""
        voxel = float(np.linalg.norm(affine[:3, :3], axis=0).min())
        reach = max(0.5 * gap_mm, voxel)
        shown = np.zeros(self.heights.shape, dtype=bool)
        for height in np.arange(-reach, reach + 0.25 * voxel, 0.5 * voxel):
            index = _index(self.places + height * self.plane.normal, affine)
            shown |= ndimage.map_coordinates(mask.astype(np.float32), index, order=0, mode="constant") < 0.5
        # gaps here and there between touching walls show no fissure, but would leave tunnels in one that is opened
        return ~ndimage.binary_opening(shown, iterations=SHOWN_CELLS)

    def near(self, shape: tuple[int, ...], affine: Floats, reach_mm: float, where: Mask) -> Mask:
        """Returns which voxels of an (i, j, k) volume are within a distance of the mid-surface, where (a, b) holds."""
        points = np.indices(shape).reshape(3, -1).T @ affine[:3, :3].T + affine[:3, 3]
        close = np.abs(self.height_above(points)) < reach_mm
        index = np.rint((points[close] @ self.axes.T - self.corner) / SPACING_MM).astype(int)
        index = np.clip(index, 0, np.array(where.shape) - 1)
        close[close] = where[tuple(index.T)]
        return np.asarray(close).reshape(shape)


def fissure_between(walls: TriangleMesh, plane: MidPlane) -> Fissure:
    """Returns the mid-surface half-way between medial walls of a closed surface that face each other."""
    axes = np.linalg.svd(plane.normal[None])[2][1:]
    flat = walls.vertices @ axes.T
    corner = flat.min(axis=0) - MARGIN_MM
    shape = tuple(np.ceil((flat.max(axis=0) + MARGIN_MM - corner) / SPACING_MM).astype(int) + 1)
    return between(walls, Fissure(plane, axes, corner, np.zeros(shape)))


def between(walls: TriangleMesh, start: Fissure) -> Fissure:
    """Returns a mid-surface moved to half-way between walls that face each other; where there are none, it stays."""
    plane, axes, corner, shape = start.plane, start.axes, start.corner, start.heights.shape
    middle = fissure_points(walls, plane.normal, plane.offset)
    height = middle @ plane.normal - plane.offset
    fissure, ends = start, np.array(shape)[:, None] - 1
    bend = BEND_MM / SPACING_MM
    for _ in range(FOLLOWED):
        near = np.abs(fissure.height_above(middle)) < FURTHEST_MM
        index = tuple(np.clip(np.rint((middle[near] @ axes.T - corner) / SPACING_MM).astype(int).T, 0, ends))
        weight, total = np.zeros(shape), np.zeros(shape)
        np.add.at(weight, index, 1.0)
        np.add.at(total, index, height[near])
        weight, total = ndimage.gaussian_filter(weight, bend), ndimage.gaussian_filter(total, bend)
        # a weight much below that of one point per cell draws the surface back to where it was
        fissure = Fissure(plane, axes, corner, (total + 0.02 * start.heights) / (weight + 0.02))
    return fissure


def open_fissure(
    field: NDArray[np.float32], affine: Floats, core: Mask, fissure: Fissure, gap_mm: float, hidden: Mask | None = None
) -> NDArray[np.float32]:
    """Returns the smoothed (i, j, k) mask with the fissure at least `gap_mm` wide down to what joins the hemispheres.

    Small fetal brains have no CSF label between their medial walls: there the cortex labels of both sides touch and
    hide the fissure. It lies half-way between the tissue inside the cortex (`core`) of the two sides, and ends where
    that tissue crosses the mid-surface (corpus callosum, deep grey matter, ventricles). With `hidden`, what
    `Fissure.hidden` returns, it is opened there only: what labels of CSF show is as wide as they say.
    """
    voxel = float(abs(np.linalg.det(affine[:3, :3])) ** (1 / 3))
    # the mid-surface, seen flat: where is the core, where is the brain
    index = _index(fissure.places, affine)
    core_there = ndimage.map_coordinates(core.astype(np.float32), index, order=1, mode="constant") > 0.5
    brain_there = ndimage.map_coordinates(field, index, order=1, mode="constant") > 0.5
    depth = ndimage.distance_transform_edt(~core_there) * SPACING_MM - FLOOR_MM
    number, _ = ndimage.label(depth > 0)
    reached = np.isin(number, np.setdiff1d(number[~brain_there], 0))
    if hidden is not None and not hidden.all():
        reached &= hidden
        depth = np.minimum(depth, ndimage.distance_transform_edt(hidden) * SPACING_MM)
    if not reached.any():
        return field
    depth = np.where(reached, depth, -ndimage.distance_transform_edt(~reached) * SPACING_MM)
    # voxels near the mid-surface: outside the opening by this distance
    grid = np.indices(field.shape).reshape(3, -1).T
    points = grid @ affine[:3, :3].T + affine[:3, 3]
    height = np.abs(fissure.height_above(points))
    near = height < gap_mm / 2 + 2.0 * voxel
    place = ((points[near] @ fissure.axes.T - fissure.corner) / SPACING_MM).T
    below = -ndimage.map_coordinates(depth, place, order=1, mode="nearest")
    outside = np.maximum(height[near] - gap_mm / 2, below)
    result = field.ravel().copy()
    result[near] = np.minimum(result[near], np.clip(0.5 + EDGE_SLOPE * outside / voxel, 0.0, 1.0))
    return result.reshape(field.shape)


def _index(places: Floats, affine: Floats) -> Floats:
    """Returns the (3, a, b) indices of voxels at (a, b, 3) places in mm."""
    inverse = np.linalg.inv(affine)
    return np.moveaxis(places @ inverse[:3, :3].T + inverse[:3, 3], -1, 0)


def to_the_right(labels: NDArray[np.integer], scheme: LabelScheme, affine: Floats) -> Floats:
    """Returns for each voxel the distance in mm to the left hemisphere's labels less that to the right one's.

    It is negative on the left, positive on the right, and zero half-way between the two.
    """
    size = np.linalg.norm(affine[:3, :3], axis=0)
    left, right = (
        ndimage.distance_transform_edt(~np.isin(labels, side), sampling=size) for side in (scheme.left, scheme.right)
    )
    return np.asarray(left - right)


def sample(field: Floats, affine: Floats, points: Floats) -> Floats:
    """Returns the (n,) values of an (i, j, k) field at (n, 3) points in mm, linear between voxels."""
    inverse = np.linalg.inv(affine)
    return ndimage.map_coordinates(field, (points @ inverse[:3, :3].T + inverse[:3, 3]).T, order=1, mode="nearest")


def plane_between_labels(side: Floats, affine: Floats, brain: Mask) -> MidPlane:
    """Returns the plane through the places half-way between the labels of the two sides, in and around a brain.

    It is for brains whose hemispheres are too unequal for a plane of mirror symmetry. `side` is what `to_the_right`
    returns, `brain` (i, j, k) where the brain is.
    """
    size = np.linalg.norm(affine[:3, :3], axis=0)
    near = ndimage.distance_transform_edt(~brain, sampling=size) < MARGIN_MM
    places = np.argwhere(near & (np.abs(side) < size.max())) @ affine[:3, :3].T + affine[:3, 3]
    centre = places.mean(axis=0)
    _, axes = np.linalg.eigh(np.cov(places.T))
    normal = axes[:, 0]
    heights = (np.argwhere(near) @ affine[:3, :3].T + affine[:3, 3] - centre) @ normal
    normal = normal * np.sign(np.corrcoef(heights, side[near])[0, 1])
    scatter = float(np.sqrt(np.mean(((places - centre) @ normal) ** 2)))
    return MidPlane(normal, float(normal @ centre), float("nan"), len(places), scatter)


def fissure_between_labels(side: Floats, affine: Floats, fissure: Fissure) -> Fissure:
    """Returns the mid-surface moved to half-way between the labels of the two sides.

    Where that is more than 5 mm away, it stays the mid-surface between facing walls, `fissure`.

    Parameters
    ----------
    side : (i, j, k) float
        What `to_the_right` returns.
    affine : (4, 4) float
        Voxel index to position in mm.
    """
    plane = fissure.plane
    steps = np.arange(-FURTHEST_MM, FURTHEST_MM + SPACING_MM, SPACING_MM)
    line = fissure.places[None] + steps[:, None, None, None] * plane.normal
    values = sample(side, affine, line.reshape(-1, 3)).reshape(line.shape[:3])
    crossing = (values[:-1] < 0) & (values[1:] >= 0)
    share = -values[:-1] / np.where(crossing, values[1:] - values[:-1], 1.0)
    moves = np.where(crossing, steps[:-1, None, None] + share * SPACING_MM, np.inf)
    nearest = np.abs(moves).argmin(axis=0)
    move = np.take_along_axis(moves, nearest[None], axis=0)[0]
    found = np.isfinite(move)
    bend = 0.25 * BEND_MM / SPACING_MM
    weight = ndimage.gaussian_filter(found.astype(float), bend)
    total = ndimage.gaussian_filter(np.where(found, move, 0.0), bend)
    return Fissure(plane, fissure.axes, fissure.corner, fissure.heights + total / (weight + 0.02))
