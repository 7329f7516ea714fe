"""Boxes of voxels around what a volume contains."""

import numpy as np

from .triangles import Mask

Box = tuple[slice, ...]
"""The range of voxels along each of three axes."""


def box_of(mask: Mask, margin: int = 0) -> Box:
    """Return the box around a mask (i, j, k) that is not empty, wider by some voxels
    where the volume has them."""
    sides = []
    for others in ((1, 2), (0, 2), (0, 1)):
        places = np.flatnonzero(mask.any(axis=others))
        sides.append(
            slice(
                int(places[0]),
                int(places[-1]) + 1,
            )
        )
    return widened(tuple(sides), margin)


def widened(box: Box, margin: int) -> Box:
    """Return a box wider by some voxels, which begins in the volume and may end beyond
    it."""
    sides = []
    for side in box:
        start = max(side.start - margin, 0)
        sides.append(slice(start, side.stop + margin))
    return tuple(sides)
