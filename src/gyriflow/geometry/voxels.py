"""Distances and connected parts in (i, j, k) masks of voxels."""

import cc3d
import edt
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from .triangles import Floats, Mask

# inside voxels are connected through faces only, outside voxels through edges and
# corners too
INSIDE = ndimage.generate_binary_structure(3, 1)
OUTSIDE = ndimage.generate_binary_structure(3, 3)


def distance_to(mask: Mask, size_mm: Floats | float) -> NDArray[np.float32]:
    """Return the distance (mm) of each voxel's centre from the nearest in a mask;
    infinite if it is empty.

    `size_mm` is that of a voxel, along the three axes or along all.
    """
    anisotropy = tuple(np.broadcast_to(size_mm, 3).tolist())
    return edt.edt(np.ascontiguousarray(~mask), anisotropy=anisotropy)


def connected_parts(
    mask: Mask, structure: Mask = INSIDE
) -> tuple[NDArray[np.int32], int]:
    """Number the connected parts of a mask from 1; return the number of each voxel, 0
    outside the mask, and how many there are."""
    number, count = cc3d.connected_components(
        np.ascontiguousarray(mask),
        connectivity=int(structure.sum()) - 1,
        return_N=True,
        out_dtype=np.uint32,
    )
    return number.view(np.int32), count
