"""A mask's topology made that of a ball: bridges across sulci cut, tunnels filled, by the least change."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import euler_number

Mask = NDArray[np.bool_]

# voxels inside are joined through faces only, voxels outside through edges and corners as well
FACES = 1
INSIDE = ndimage.generate_binary_structure(3, 1)
OUTSIDE = ndimage.generate_binary_structure(3, 3)
EDGE_NEIGHBOURS = ndimage.generate_binary_structure(3, 2)
# radii in voxels of the openings and closings that find what joins or pierces the mask
REACHES = (1.0, 1.5, 2.0, 3.0, 4.5, 6.0)
# distance from the level of one half at which changed voxels are put
STEP = 0.2


@dataclass(frozen=True, eq=False)
class TopologyRepair:
    """A field whose level set above one half has no handles, and what that took.

    Attributes
    ----------
    field : (i, j, k) float32
        The field, changed in the voxels counted below.
    bridges_cut, tunnels_filled
        Number of places where voxels were taken away or added.
    voxels_cut, voxels_filled
        Number of these voxels.
    handles_left
        Handles that remain.
    """

    field: NDArray[np.float32]
    bridges_cut: int
    tunnels_filled: int
    voxels_cut: int
    voxels_filled: int
    handles_left: int


def handles(mask: Mask) -> int:
    """Returns the number of handles of an (i, j, k) mask: parts plus cavities minus Euler number."""
    parts = ndimage.label(mask, INSIDE)[1]
    cavities = ndimage.label(~np.pad(mask, 1), OUTSIDE)[1] - 1
    return parts + cavities - int(euler_number(mask, connectivity=FACES))


def without_handles(field: NDArray[np.float32]) -> TopologyRepair:
    """Returns the (i, j, k) field with the handles of its level set above one half cut or filled.

    Patches that an opening takes away or a closing adds are tried from the smallest to the largest. One that removes
    a handle is kept, less all voxels that can be given back without a change of topology (simple points, Bertrand and
    Malandain 1994, doi 10.1016/0167-8655(94)90046-9).
    """
    original = field > 0.5
    mask = original.copy()
    left = handles(mask)
    counts = {False: 0, True: 0}
    for reach in REACHES:
        if left == 0:
            break
        for fills, box, patch in _patches(mask, reach):
            now = mask[box]
            # an earlier change may have touched this patch
            patch = patch & (now != fills)
            changed = np.where(patch, fills, now)
            if left == 0 or not patch.any() or euler_gain(now, changed) <= 0:
                continue
            trial = mask.copy()
            trial[box] = _least_change(now, changed, field[box])
            trial = ndimage.binary_fill_holes(trial)
            remaining = handles(trial)
            same_parts = ndimage.label(trial, INSIDE)[1] == ndimage.label(mask, INSIDE)[1]
            if remaining < left and same_parts:
                mask, left = trial, remaining
                counts[fills] += 1
    added, cut = mask & ~original, original & ~mask
    changed_field = field.copy()
    changed_field[added] = 0.5 + STEP
    changed_field[cut] = 0.5 - STEP
    return TopologyRepair(changed_field, counts[False], counts[True], int(cut.sum()), int(added.sum()), left)


def unambiguous(field: NDArray[np.float32]) -> NDArray[np.float32]:
    """Returns the field with diagonal neighbours set apart, so that its isosurface joins voxels by faces only.

    Where inside and outside voxels alternate around a square, or two opposite corners of a cube differ from the
    other six, marching cubes decides by the values what is joined; these values are moved so that it never is the
    inside.
    """
    mask = field > 0.5
    doubtful = np.zeros_like(mask)
    for first, second in ((0, 1), (0, 2), (1, 2)):
        inside = np.moveaxis(mask, (first, second), (0, 1))
        flags = np.moveaxis(doubtful, (first, second), (0, 1))
        a, b, c, d = inside[:-1, :-1], inside[1:, :-1], inside[1:, 1:], inside[:-1, 1:]
        alternating = (a == c) & (b == d) & (a != b)
        for view in (flags[:-1, :-1], flags[1:, :-1], flags[1:, 1:], flags[:-1, 1:]):
            view |= alternating
    ends = (slice(None, -1), slice(1, None))
    count = sum(mask[i, j, k].astype(np.int8) for i in ends for j in ends for k in ends)
    for j in (0, 1):
        for k in (0, 1):
            low, high = mask[ends[0], ends[j], ends[k]], mask[ends[1], ends[1 - j], ends[1 - k]]
            opposite = (low & high & (count == 2)) | (~low & ~high & (count == 6))
            for corner in np.ndindex(2, 2, 2):
                doubtful[tuple(ends[side] for side in corner)] |= opposite
    apart = np.where(mask, np.minimum(field, 0.55), np.minimum(field, 0.05))
    return np.where(doubtful, apart, field).astype(np.float32)


def _patches(mask: Mask, reach: float) -> list[tuple[bool, tuple[slice, ...], Mask]]:
    """Returns (fills, box, patch) for what a closing adds and an opening takes, the smallest first."""
    far_outside = ndimage.distance_transform_edt(ndimage.distance_transform_edt(~mask) <= reach) > reach
    far_inside = ndimage.distance_transform_edt(ndimage.distance_transform_edt(mask) > reach) == 0
    opened = ndimage.distance_transform_edt(far_inside) <= reach
    found = []
    for fills, difference in ((True, far_outside & ~mask), (False, mask & ~opened)):
        number, _ = ndimage.label(difference, OUTSIDE)
        for index, tight in enumerate(ndimage.find_objects(number), start=1):
            box = tuple(
                slice(max(side.start - 1, 0), min(side.stop + 1, n)) for side, n in zip(tight, mask.shape, strict=True)
            )
            patch = number[box] == index
            found.append((int(patch.sum()), fills, box, patch))
    found.sort(key=lambda item: item[0])
    return [(fills, box, patch) for _, fills, box, patch in found]


def euler_gain(before: Mask, after: Mask) -> int:
    """Returns by how much the Euler number rises; inside a box that holds the change with a margin of one voxel."""
    return int(euler_number(after, connectivity=FACES) - euler_number(before, connectivity=FACES))


def _least_change(before: Mask, after: Mask, field: NDArray[np.float32]) -> Mask:
    """Returns `after` with every voxel set back to `before` that does not change the topology.

    The clearest voxels go back first, so that what stays changed lies where the field is closest to one half.
    """
    mask = np.pad(after, 1)
    places = np.argwhere(before != after)
    places = places[np.argsort(-np.abs(field[tuple(places.T)] - 0.5), kind="stable")] + 1
    given_back = True
    while given_back and len(places):
        waiting = []
        for i, j, k in places:
            around = mask[i - 1 : i + 2, j - 1 : j + 2, k - 1 : k + 2]
            if _is_simple(around):
                mask[i, j, k] = ~mask[i, j, k]
            else:
                waiting.append((i, j, k))
        given_back = len(waiting) < len(places)
        places = np.array(waiting)
    return mask[1:-1, 1:-1, 1:-1]


def _is_simple(around: Mask) -> bool:
    """Returns whether the centre of a (3, 3, 3) neighbourhood can change sides without a change of topology."""
    inside, outside = around & EDGE_NEIGHBOURS, ~around
    inside[1, 1, 1] = outside[1, 1, 1] = False
    number, _ = ndimage.label(inside, INSIDE)
    touching = np.unique(number[INSIDE & inside])
    return len(touching) == 1 and ndimage.label(outside, OUTSIDE)[1] == 1
