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
    """Return each voxel's distance (mm) from the nearest voxel of a mask, between
    centres; infinite if the mask is empty.

    `size_mm` is the voxel's edge length, (3,) or the same along all axes.
    """
    anisotropy = tuple(np.broadcast_to(size_mm, 3).tolist())
    return edt.edt(np.array(~mask, order="C"), anisotropy=anisotropy)


def number_parts(mask: Mask, structure: Mask = INSIDE) -> tuple[NDArray[np.int32], int]:
    """Number the connected parts of a mask from 1, in the order of their first voxels;
    return the numbers, 0 outside the mask, and the count."""
    number, count = cc3d.connected_components(
        np.array(mask, dtype=bool, order="C"),
        # 6 or 26 neighbours
        connectivity=int(structure.sum()) - 1,
        return_N=True,
        out_dtype=np.uint32,
    )
    return number.view(np.int32), count
