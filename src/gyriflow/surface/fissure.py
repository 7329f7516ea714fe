"""The interhemispheric fissure as a curved surface, and its opening where labels of the two sides touch."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.surface.extraction import EDGE_SLOPE
from gyriflow.surface.orientation import MidPlane, fissure_points

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

SPACING_MM = 0.5
MARGIN_MM = 5.0
# the mid-surface follows the walls over this distance, and returns to the plane where there are none
BEND_MM = 4.0
FURTHEST_MM = 5.0
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

    def near(self, shape: tuple[int, ...], affine: Floats, reach_mm: float) -> Mask:
        """Returns which voxels of an (i, j, k) volume are within a distance of the mid-surface."""
        points = np.indices(shape).reshape(3, -1).T @ affine[:3, :3].T + affine[:3, 3]
        return np.asarray(np.abs(self.height_above(points)) < reach_mm).reshape(shape)


def fissure_between(walls: TriangleMesh, plane: MidPlane) -> Fissure:
    """Returns the mid-surface half-way between medial walls of a closed surface that face each other."""
    axes = np.linalg.svd(plane.normal[None])[2][1:]
    flat = walls.vertices @ axes.T
    corner = flat.min(axis=0) - MARGIN_MM
    shape = tuple(np.ceil((flat.max(axis=0) + MARGIN_MM - corner) / SPACING_MM).astype(int) + 1)
    middle = fissure_points(walls, plane.normal, plane.offset)
    height = middle @ plane.normal - plane.offset
    near = np.abs(height) < FURTHEST_MM
    index = tuple(np.rint((middle[near] @ axes.T - corner) / SPACING_MM).astype(int).T)
    weight, total = np.zeros(shape), np.zeros(shape)
    np.add.at(weight, index, 1.0)
    np.add.at(total, index, height[near])
    bend = BEND_MM / SPACING_MM
    weight, total = ndimage.gaussian_filter(weight, bend), ndimage.gaussian_filter(total, bend)
    # a weight much below that of one point per cell draws the surface back to the plane
    return Fissure(plane, axes, corner, total / (weight + 0.02))


def opened(
    field: NDArray[np.float32], affine: Floats, core: Mask, fissure: Fissure, gap_mm: float
) -> NDArray[np.float32]:
    """Returns the smoothed (i, j, k) mask with the fissure at least `gap_mm` wide down to what joins the hemispheres.

    Small fetal brains have no CSF label between their medial walls: there the cortex labels of both sides touch and
    hide the fissure. It lies half-way between the tissue inside the cortex (`core`) of the two sides, and ends where
    that tissue crosses the mid-surface (corpus callosum, deep grey matter, ventricles).
    """
    voxel = float(abs(np.linalg.det(affine[:3, :3])) ** (1 / 3))
    # the mid-surface, seen flat: where is the core, where is the brain
    a, b = np.meshgrid(*(np.arange(n) * SPACING_MM for n in fissure.heights.shape), indexing="ij")
    flat = np.stack([a + fissure.corner[0], b + fissure.corner[1]], axis=-1)
    on_surface = flat @ fissure.axes + (fissure.plane.offset + fissure.heights)[..., None] * fissure.plane.normal
    inverse = np.linalg.inv(affine)
    index = np.moveaxis(on_surface @ inverse[:3, :3].T + inverse[:3, 3], -1, 0)
    core_there = ndimage.map_coordinates(core.astype(np.float32), index, order=1, mode="constant") > 0.5
    brain_there = ndimage.map_coordinates(field, index, order=1, mode="constant") > 0.5
    depth = ndimage.distance_transform_edt(~core_there) * SPACING_MM - FLOOR_MM
    number, _ = ndimage.label(depth > 0)
    reached = np.isin(number, np.setdiff1d(number[~brain_there], 0))
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
