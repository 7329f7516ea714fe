"""Left and right by the labels of a scheme that has them for both hemispheres."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gyriflow.parameters.schemes import LabelScheme
from gyriflow.surface.fissure import BEND_MM, FURTHEST_MM, SPACING_MM, Fissure

Floats = NDArray[np.float64]


def to_the_right(labels: NDArray[np.integer], scheme: LabelScheme, affine: Floats) -> Floats:
    """Returns for each voxel the distance in mm to the left hemisphere's labels less that to the right one's.

    It is negative on the left, positive on the right, and zero half-way between the two.
    """
    size = np.linalg.norm(affine[:3, :3], axis=0)
    left, right = (
        ndimage.distance_transform_edt(~np.isin(labels, side), sampling=size) for side in (scheme.left, scheme.right)
    )
    return np.asarray(left - right)


def sampled(field: Floats, affine: Floats, points: Floats) -> Floats:
    """Returns the (n,) values of an (i, j, k) field at (n, 3) points in mm, linear between voxels."""
    inverse = np.linalg.inv(affine)
    return ndimage.map_coordinates(field, (points @ inverse[:3, :3].T + inverse[:3, 3]).T, order=1, mode="nearest")


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
    a, b = np.meshgrid(*(np.arange(n) * SPACING_MM for n in fissure.heights.shape), indexing="ij")
    flat = np.stack([a + fissure.corner[0], b + fissure.corner[1]], axis=-1)
    foot = flat @ fissure.axes + (plane.offset + fissure.heights)[..., None] * plane.normal
    steps = np.arange(-FURTHEST_MM, FURTHEST_MM + SPACING_MM, SPACING_MM)
    line = foot[None] + steps[:, None, None, None] * plane.normal
    values = sampled(side, affine, line.reshape(-1, 3)).reshape(line.shape[:3])
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
