"""The pial surface of a mask of voxels, as an isosurface of the smoothed mask."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import marching_cubes

from gyriflow.errors import MeshError
from gyriflow.geometry.triangles import TriangleMesh, signed_volume, transformed

PAD_VOXELS = 6
LEVEL = 0.5


def cropped(mask: NDArray[np.bool_], pad: int = PAD_VOXELS) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Returns the (i, j, k) mask cut to its contents with `pad` empty voxels around, and its (3,) first index."""
    box = ndimage.find_objects(mask.astype(np.uint8))[0]
    first = np.array([side.start for side in box]) - pad
    return np.pad(mask[box], pad), first


def shifted_affine(affine: NDArray[np.float64], first: NDArray[np.int64]) -> NDArray[np.float64]:
    """Returns the affine of a volume that was cut (or padded) so that it begins at voxel `first`."""
    moved = affine.copy()
    moved[:3, 3] += affine[:3, :3] @ first
    return moved


def smoothed_mask(mask: NDArray[np.bool_], smoothing_voxels: float) -> NDArray[np.float32]:
    """Returns the mask as a field from 0 to 1, smoothed by a Gaussian of the given σ in voxels."""
    return ndimage.gaussian_filter(mask.astype(np.float32), smoothing_voxels)


def main_parts(mask: NDArray[np.bool_], comparable: float = 0.2) -> tuple[NDArray[np.bool_], int, int]:
    """Returns the mask's largest part and those of comparable size, filled, without the other parts.

    Two hemispheres that do not touch are both kept: a part counts as comparable from `comparable` of the largest.
    The second and third value are the number of parts dropped and the number of voxels in them.
    """
    number, count = ndimage.label(mask)
    sizes = np.bincount(number.ravel(), minlength=count + 1)
    sizes[0] = 0
    kept = sizes >= comparable * sizes.max()
    dropped = ~kept & (sizes > 0)
    return ndimage.binary_fill_holes(kept[number]), int(dropped.sum()), int(sizes[dropped].sum())


def isosurface(field: NDArray[np.float32], affine: NDArray[np.float64]) -> TriangleMesh:
    """Returns the outward surface in mm where an (i, j, k) field falls below one half.

    MeshError where it encloses no volume.
    """
    vertices, faces, _, _ = marching_cubes(field, LEVEL, gradient_direction="ascent")
    # an affine that mirrors (LAS, LPI, …) turns the faces inside out: transformed() turns them back
    mesh = transformed(TriangleMesh(vertices, faces), affine)
    if signed_volume(mesh) <= 0:
        raise MeshError("the surface of the mask encloses no volume", found=f"{signed_volume(mesh):.3g} mm³")
    return mesh
