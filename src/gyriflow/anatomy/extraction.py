"""Masks of voxels: smoothing, topology correction, removal of parts that hang by a
stalk, and isosurfaces."""

from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.special import ndtr
from skimage.measure import marching_cubes

from ..errors import MeshError
from ..geometry.boxes import Box, box_of, widened
from ..geometry.deformations import voxel_size
from ..geometry.triangles import Floats, Mask, TriangleMesh, signed_volume, transformed
from ..geometry.voxels import INSIDE, OUTSIDE, distance_to, number_parts

PAD_VOXELS = 6
# σ of the Gaussian that smooths a mask before its isosurface is extracted
SMOOTHING_VOXELS = 1.0
LEVEL = 0.5
# slope per voxel of a mask's edge smoothed with σ = 1 voxel: 1/√(2π)
EDGE_SLOPE = 0.4
# smaller groups of outside voxels that smoothing closes are roughness of the labels
MIN_SLIT_VOXELS = 20
# a part at least this large, relative to the largest, is kept: hemispheres may not
# touch
COMPARABLE = 0.2
# the 27 cells of a 3 × 3 × 3 block, and bit masks of those that share a corner, an edge
# or a face with the middle one
CELLS = np.array(list(np.ndindex(3, 3, 3)))
CORNER_CELLS, EDGE_CELLS, FACE_CELLS = (
    sum(
        1 << place
        for place, cell in enumerate(CELLS)
        if 0 < np.abs(cell - 1).sum() <= limit
    )
    for limit in (3, 2, 1)
)
BY_CORNERS, BY_FACES = (
    [
        sum(
            1 << place
            for place, cell in enumerate(CELLS)
            if 0 < distance(cell - middle) <= 1
        )
        for middle in CELLS
    ]
    for distance in (
        lambda offset: np.abs(offset).max(),
        lambda offset: np.abs(offset).sum(),
    )
)
# voxel (i, j, k) of a block of 2 × 2 × 2 has the number 4 i + 2 j + k; these are the
# corners of its six faces, in the order around each, and its pairs of opposite corners
SQUARES = [
    [0, 4, 6, 2],
    [1, 5, 7, 3],
    [0, 4, 5, 1],
    [2, 6, 7, 3],
    [0, 2, 3, 1],
    [4, 6, 7, 5],
]
DIAGONALS = [[0, 7], [1, 6], [2, 5], [3, 4]]
# bytes 0 and 1 as the digits of a binary number
DIGITS = bytes.maketrans(b"\0\1", b"01")
# radii in voxels of the openings and closings that find bridges and tunnels
RADII = (1.0, 1.5, 2.0, 3.0, 4.5, 6.0)
# margins in voxels for examining how a change affects connectivity; the last is the
# whole volume
MARGINS = (4, 16, 64, 100_000)
# values of a field, and distances in voxels, that agree to so many decimals are equal,
# whatever the order of sums
FIELD_DECIMALS = 4
# changed voxels get the level plus or minus this value
CHANGED_STEP = 0.2
# most voxels of thin parts that touch a tissue are reached by so many dilations
N_DILATIONS = 3
# stalks are thinner than twice this
NECK_RADIUS_MM = 1.6
# limits of the stalk's cross-section and of the size of the hanging part: larger ones
# belong to the brain
MAX_NECK_MM2 = 12.0
MAX_HANGING_SHARE = 0.05
MIN_HANGING_MM3 = 15.0
# length of stalk that is removed with the hanging part
STALK_MM = 4.0


def shifted_affine(affine: Floats, first: NDArray[np.int64]) -> Floats:
    """Return the affine of a volume that was cropped or padded to begin at voxel
    `first`."""
    moved = np.array(affine, dtype=float)
    moved[:3, 3] += moved[:3, :3] @ first
    return moved


def parts_in_boxes(mask: Mask) -> Iterator[tuple[Box, Mask]]:
    """Yield for each connected part (faces, edges, corners) of a mask its box plus one
    voxel, and its mask there."""
    if not mask.any():
        return
    around = box_of(mask, 1)
    number, _ = number_parts(mask[around], OUTSIDE)
    boxes = ndimage.find_objects(number)
    for index, tight in enumerate(boxes, start=1):
        box = widened(tight, 1)
        yield _moved(box, around), number[box] == index


def _moved(box: Box, around: Box) -> Box:
    """Return the place in the whole volume of a box in a part `around` it."""
    sides = []
    for side, outer in zip(
        box,
        around,
        strict=True,
    ):
        first = outer.start
        stop = min(side.stop + first, outer.stop)
        sides.append(slice(side.start + first, stop))
    return tuple(sides)


def smooth_mask(
    mask: Mask, smoothing_voxels: float = SMOOTHING_VOXELS
) -> NDArray[np.float32]:
    """Return the mask smoothed by a Gaussian of the given σ in voxels, as a field from
    0 to 1."""
    return ndimage.gaussian_filter(mask.astype(np.float32), smoothing_voxels)


def remove_bridges(
    mask: Mask, field: NDArray[np.float32]
) -> tuple[NDArray[np.float32], int]:
    """Reopen slits of a mask that smoothing has closed; return the smoothed field and
    the number of voxels reopened.

    A slit is a group of outside voxels connected to the outside, one voxel wide: a
    sulcus or the fissure. Its voxels get the value that places the surface at its
    walls. Small groups, and slits that would pierce the mask, stay closed.
    """
    number, _ = number_parts(~mask)
    # the volume is padded, so its first voxel is outside
    inside = field > LEVEL
    closed = (number == number[0, 0, 0]) & inside
    number, gains = _parts_with_gains(inside, _euler_cells(inside), closed)
    opened = (
        np.bincount(
            number[closed],
            minlength=len(gains),
        )
        >= MIN_SLIT_VOXELS
    ) & (gains == 0)
    slits = closed & opened[number]
    # the wall lies half-way between a voxel of the slit and the next one, which has
    # this value at a slit 1 voxel wide
    wall_value = 1.0 - (ndtr(1.5 / SMOOTHING_VOXELS) - ndtr(0.5 / SMOOTHING_VOXELS))
    return np.where(slits, np.float32(1.0 - wall_value), field), int(slits.sum())


def refine(
    field: NDArray,
    affine: Floats,
    factor: int,
) -> tuple[NDArray, Floats]:
    """Interpolate an (i, j, k) field linearly to voxels `factor` times smaller; return
    it and its affine."""
    axes = affine[:3, :3]
    fine = np.array(affine, dtype=float)
    fine[:3, :3] /= factor
    # the first fine voxel's centre lies nearer to the first coarse voxel's corner
    to_corner = 0.5 * (1.0 - 1.0 / factor)
    fine[:3, 3] -= axes.sum(axis=1) * to_corner
    for axis in range(3):
        coarse = np.moveaxis(field, axis, 0)
        # beyond the outer centres the field is constant
        padded = np.concatenate([coarse[:1], coarse, coarse[-1:]])
        shape = list(field.shape)
        shape[axis] *= factor
        field = np.empty(shape, dtype=field.dtype)
        refined = np.moveaxis(field, axis, 0)
        for step in range(factor):
            # from the centre of a coarse voxel to that of a fine one in it
            offset = (step + 0.5) / factor - 0.5
            start = 0 if offset < 0 else 1
            before = padded[start : start + len(coarse)]
            after = padded[start + 1 : start + 1 + len(coarse)]
            values = after - before
            values *= offset % 1.0
            values += before
            refined[step::factor] = values
    return field, fine


def without_holes(mask: Mask, structure: Mask = INSIDE) -> Mask:
    """Fill the holes of an (i, j, k) mask: outside voxels that are not connected to the
    border, by a structure."""
    outside = np.pad(~mask, 1, constant_values=True)
    number, _ = number_parts(outside, structure)
    at_border = number[0, 0, 0]
    inner = (slice(1, -1),) * mask.ndim
    return (number != at_border)[inner]


def not_touching(mask: Mask, tissue: Mask) -> Mask:
    """Return the parts, connected by faces, of an (i, j, k) mask that do not touch a
    tissue. The mask has an empty margin of one voxel."""
    touching = mask & with_neighbours(tissue)
    for _ in range(N_DILATIONS):
        touching = mask & with_neighbours(touching)

    # the other voxels one by one
    is_touching = touching.ravel()
    voxels = np.flatnonzero(mask & ~touching)
    is_reached = np.ones(1, dtype=bool)
    while is_reached.any():
        is_reached = np.zeros(len(voxels), dtype=bool)
        for stride in (
            1,
            mask.shape[2],
            mask[0].size,
        ):
            is_reached |= is_touching[voxels - stride]
            is_reached |= is_touching[voxels + stride]
        is_touching[voxels[is_reached]] = True
        voxels = voxels[~is_reached]
    return mask & ~touching


def main_parts(
    mask: Mask,
    comparable: float = COMPARABLE,
    around: Mask | None = None,
) -> tuple[Mask, int, int]:
    """Return the mask's parts of comparable size to its largest, cavities filled; parts
    and voxels dropped.

    `around` is a mask without cavities that contains this one, where there is one.
    """
    number, count = number_parts(mask)
    sizes = np.bincount(number.ravel(), minlength=count + 1)
    sizes[0] = 0
    is_main = (sizes >= comparable * sizes.max()) & (sizes > 0)
    dropped = ~is_main & (sizes > 0)
    main = is_main[number] if dropped.any() else mask
    if around is None:
        filled = without_holes(main)
    else:
        outside = np.pad(~around, 1, constant_values=True)
        cavities = not_touching(np.pad(around & ~main, 1), outside)
        filled = main | cavities[1:-1, 1:-1, 1:-1]
    return filled, int(dropped.sum()), int(sizes[dropped].sum())


def make_simple(
    field: NDArray[np.float32], comparable: float = COMPARABLE
) -> tuple[NDArray[np.float32], dict[str, Any]]:
    """Return the field with a level set of main parts without cavities or handles, and
    a report; see `main_parts`."""
    inside = field > LEVEL
    if not inside.any():
        raise MeshError("the mask is empty after smoothing")
    main, parts, voxels = main_parts(inside, comparable)
    field = np.where(
        main, np.maximum(field, LEVEL + 1e-3), np.minimum(field, LEVEL - 1e-3)
    ).astype(np.float32)
    field, handles_repaired = _without_handles(field)
    dropped = {
        "parts_dropped": parts,
        "voxels_dropped": voxels,
        "voxels_filled": int((main & ~inside).sum()),
    }
    return unambiguous(field), dropped | handles_repaired


def isosurface(field: NDArray[np.float32], affine: Floats) -> TriangleMesh:
    """Return the outward surface in mm on which an (i, j, k) field is one half;
    MeshError if it encloses no volume."""
    vertices, faces, _, _ = marching_cubes(field, LEVEL, gradient_direction="ascent")
    # transformed() flips the faces if the affine mirrors (LAS, LPI, …)
    mesh = transformed(TriangleMesh(vertices, faces), affine)
    if signed_volume(mesh) <= 0:
        raise MeshError(
            "the surface of the mask encloses no volume",
            found=f"{signed_volume(mesh):.3g} mm³",
        )
    return mesh


def handles(mask: Mask) -> int:
    """Return the number of handles of an (i, j, k) mask: parts plus cavities minus
    Euler number."""
    parts, outside = _pieces(np.pad(mask, 1))
    return parts + outside - 1 - _euler_number(mask)


def _without_handles(
    field: NDArray[np.float32],
) -> tuple[NDArray[np.float32], dict[str, int]]:
    """Cut or fill the handles of the level set at one half of an (i, j, k) field;
    return the field and the counts.

    Patches that an opening removes or a closing adds are tried, smallest first. One
    that removes a handle is applied but for its simple points (Bertrand and Malandain
    1994, doi 10.1016/0167-8655(94)90046-9). Equal sizes are decided by the field and by
    distances, not by the order of voxels, so that a mirrored mask has mirrored
    corrections.
    """
    original = field > 0.5
    mask = original.copy()
    remaining = handles(mask)
    counts = {False: 0, True: 0}
    # in the second round a cut may leave cavities connected to the outside through
    # edges and corners only
    for closed_by, radius in product((INSIDE, OUTSIDE), RADII):
        if remaining == 0:
            break
        for _, fills, box, patch in _patches(mask, field, radius):
            # an earlier change may have touched this patch
            patch = patch & (mask[box] != fills)
            changed = np.where(patch, fills, mask[box])
            if (
                remaining == 0
                or not patch.any()
                or _euler_number(changed) <= _euler_number(mask[box])
            ):
                continue
            content = _minimal_change(mask[box], changed, field[box])
            removed = _apply(mask, box, content, closed_by)
            remaining -= removed
            counts[fills] += removed > 0
    added, cut = mask & ~original, original & ~mask
    changed = np.where(
        added, 0.5 + CHANGED_STEP, np.where(cut, 0.5 - CHANGED_STEP, field)
    ).astype(field.dtype)
    return changed, {
        "bridges_cut": counts[False],
        "voxels_cut_from_bridges": int(cut.sum()),
        "tunnels_filled": counts[True],
        "voxels_filled_in_tunnels": int(added.sum()),
        "handles_left": remaining,
    }


def unambiguous(field: NDArray[np.float32]) -> NDArray[np.float32]:
    """Adjust a field so that its isosurface connects inside voxels through faces only.

    Where inside and outside alternate around a square, or two opposite corners of a
    cube differ from the other six, marching cubes decides from the values; these are
    changed so that it never connects the inside.
    """
    mask = field > LEVEL
    blocks = _mixed_blocks(mask)
    inside = mask.ravel()[blocks]
    is_ambiguous = np.zeros_like(inside)
    for square in SQUARES:
        a, b, c, d = inside[:, square].T
        alternating = (a == c) & (b == d) & (a != b)
        is_ambiguous[:, square] |= alternating[:, None]
    n_inside = inside.sum(axis=1)
    for diagonal in DIAGONALS:
        corner, opposite = inside[:, diagonal].T
        others_differ = n_inside == np.where(corner, 2, 6)
        is_ambiguous |= ((corner == opposite) & others_differ)[:, None]
    voxels = np.unravel_index(blocks[is_ambiguous], mask.shape)
    limit = np.where(mask[voxels], 0.55, 0.05)
    separated = field.astype(np.float32)
    separated[voxels] = np.minimum(field[voxels], limit)
    return separated


def _mixed_blocks(mask: Mask) -> NDArray[np.int64]:
    """Return the (n, 8) flat indices of the voxels of each block of 2 × 2 × 2 voxels
    with some in the mask and others outside."""
    any_inside = all_inside = mask
    for axis in range(3):
        before = (slice(None),) * axis
        low = (*before, slice(None, -1))
        high = (*before, slice(1, None))
        any_inside = any_inside[low] | any_inside[high]
        all_inside = all_inside[low] & all_inside[high]
    first = np.nonzero(any_inside & ~all_inside)
    offsets = np.ravel_multi_index(np.indices((2, 2, 2)).reshape(3, 8), mask.shape)
    return np.ravel_multi_index(first, mask.shape)[:, None] + offsets


def dilated(mask: Mask, radius: float, size: Floats | None = None) -> Mask:
    """Dilate an (i, j, k) mask by a ball; a distance transform takes 4 to 30 times as
    long.

    The radius is in voxels, or in the unit of their (3,) `size`.
    """
    lengths = [1, 1, 1] if size is None else size.tolist()
    squares = []
    for length in lengths:
        steps = np.arange(int(radius / length) + 1)
        square = (steps * length) ** 2
        squares.append(square if size is None else square.astype(np.float32))
    across = squares[0][:, None] + squares[1]
    # from each voxel of a disc, how far the ball reaches along the last axis, or -1
    is_in_ball = across[..., None] + squares[2] <= radius**2
    reaches = is_in_ball.sum(axis=2) - 1

    # eight voxels of a column are the bits of a byte
    column = np.ascontiguousarray(mask).copy()
    columns = [np.packbits(column, axis=2)]
    for reach in range(1, reaches.max() + 1):
        column[:, :, reach:] |= mask[:, :, :-reach]
        column[:, :, :-reach] |= mask[:, :, reach:]
        columns.append(np.packbits(column, axis=2))
    ball = np.zeros_like(columns[0])
    for i, reaches_j in enumerate(reaches):
        disc = np.zeros_like(ball)
        for j, reach in enumerate(reaches_j[reaches_j >= 0]):
            for source, target in _shifts(j):
                disc[:, target] |= columns[reach][:, source]
        for source, target in _shifts(i):
            ball[target] |= disc[source]
    unpacked = np.unpackbits(
        ball,
        axis=2,
        count=mask.shape[2],
    )
    return unpacked.view(bool)


def _shifts(step: int) -> list[tuple[slice, slice]]:
    """Return the slices along an axis whose voxels are shifted, and to which, by so
    many steps down and up."""
    if step == 0:
        return [(slice(None), slice(None))]
    low = slice(None, -step)
    high = slice(step, None)
    return [(low, high), (high, low)]


def with_neighbours(
    mask: Mask,
    *,
    corners: bool = False,
) -> Mask:
    """Dilate an (i, j, k) mask by the voxels that share a face, or also an edge or a
    corner, with it; scipy's takes thirty times as long."""
    source = np.ascontiguousarray(mask)
    grown = source.copy()
    # along the last axis all rows at once; the ends of rows follow
    old = source.ravel()
    new = grown.ravel()
    new[1:] |= old[:-1]
    new[:-1] |= old[1:]
    if mask.shape[2] > 1:
        grown[:, :, 0] = source[:, :, 0] | source[:, :, 1]
        grown[:, :, -1] = source[:, :, -1] | source[:, :, -2]
    else:
        grown = source.copy()
    for axis in (1, 0):
        if corners:
            source = grown.copy()
        old = np.moveaxis(source, axis, 0)
        new = np.moveaxis(grown, axis, 0)
        new[1:] |= old[:-1]
        new[:-1] |= old[1:]
    return grown


def _patches(
    mask: Mask,
    field: NDArray[np.float32],
    radius: float,
) -> list[tuple[tuple[int, float], bool, Box, Mask]]:
    """Return size and change of the field, whether it fills, box and mask of each patch
    that a closing or an opening changes, the smallest first."""
    # outside the volume as well, which may be cropped closer than the radius
    margin = int(radius)
    inner = tuple(slice(margin, margin + length) for length in mask.shape)
    grown = dilated(np.pad(mask, margin), radius)
    closed = ~dilated(~grown, radius)[inner]
    opened = dilated(~dilated(~mask, radius), radius)
    cells = _euler_cells(mask)
    patches = []
    for fills, change in ((True, closed & ~mask), (False, mask & ~opened)):
        number, gains = _parts_with_gains(mask, cells, change)
        for box, patch in parts_in_boxes(change & (gains > 0)[number]):
            needed = np.abs(field[box][patch] - LEVEL).sum(dtype=float)
            size = int(patch.sum()), round(float(needed), FIELD_DECIMALS)
            patches.append((size, fills, box, patch))
    return sorted(patches, key=itemgetter(0))


def _apply(
    mask: Mask,
    box: Box,
    content: Mask,
    closed_by: Mask,
) -> int:
    """Put new content into a box of a mask if this removes handles and preserves the
    mask's parts; return the number of handles removed.

    Voxels that the change connects or separates may be connected outside the box, so
    ever wider boxes are examined. Cavities are filled; the connectivity `closed_by`
    defines them.
    """
    for margin in MARGINS:
        wide = widened(box, margin)
        inner = tuple(
            slice(a.start - b.start, a.stop - b.start)
            for a, b in zip(box, wide, strict=True)
        )
        before = mask[wide]
        after = before.copy()
        after[inner] = content
        after = without_holes(after, closed_by)
        gain = _euler_number(after) - _euler_number(before)
        # a part more, even if all that reach the border of the box are one, was cut off
        if gain <= 0 or _parts_if_framed(after) > _parts_if_framed(before):
            return 0
        if _pieces(before) == _pieces(after):
            mask[wide] = after
            return gain
        # parts may be connected outside the box
    return 0


def _parts_if_framed(mask: Mask) -> int:
    """Return the number of parts of a mask if all that reach the border of its box are
    connected."""
    framed = np.pad(mask, 1, constant_values=True)
    return number_parts(framed)[1]


def _pieces(mask: Mask) -> tuple[int, int]:
    return number_parts(mask)[1], number_parts(~mask, OUTSIDE)[1]


def _euler_cells(mask: Mask) -> NDArray[np.int8]:
    """Return each 2 × 2 × 2 block's part of the Euler number, at its first voxel; faces
    connect voxels."""
    x = _pairs(mask, 0)
    y = _pairs(mask, 1)
    z = _pairs(mask, 2)
    xy = _pairs(x, 1)
    xz = _pairs(x, 2)
    yz = _pairs(y, 2)
    xyz = _pairs(xy, 2)
    cells = mask.astype(np.int8)
    for edges in (x, y, z):
        cells -= edges
    for squares in (xy, xz, yz):
        cells += squares
    cells -= xyz
    return cells


def _pairs(mask: Mask, axis: int) -> Mask:
    """Return which voxels of a mask have a next one along an axis in it, too."""
    voxels = np.moveaxis(mask, axis, 0)
    both = np.zeros_like(voxels)
    both[:-1] = voxels[:-1] & voxels[1:]
    return np.moveaxis(both, 0, axis)


def _euler_number(mask: Mask) -> int:
    return int(_euler_cells(mask).sum(dtype=np.int64))


def _parts_with_gains(
    mask: Mask, cells: NDArray[np.int8], change: Mask
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Label the parts of a `change` of the mask, whose `_euler_cells` are given; return
    the labels, and by label the change of the Euler number."""
    number, count = number_parts(change, OUTSIDE)
    gain = _euler_cells(mask ^ change) - cells
    places = np.argwhere(gain)
    last = np.array(mask.shape) - 1
    # a block's gain belongs to the part that has one of its voxels
    part = np.zeros(len(places), dtype=np.int64)
    for corner in np.ndindex(2, 2, 2):
        voxels = np.minimum(places + corner, last)
        part = np.maximum(part, number[tuple(voxels.T)])
    weights = gain[tuple(places.T)]
    gains = np.bincount(part, weights=weights, minlength=count + 1)
    return number, gains.astype(np.int64)


def _minimal_change(
    before: Mask,
    after: Mask,
    field: NDArray[np.float32],
) -> Mask:
    """Return `after` with as many voxels as possible set back to `before`, without a
    change of topology.

    Voxels whose field is far from `LEVEL` come first, of equal ones those far from the
    middle of the change.
    """
    mask = np.pad(after, 1)
    places = np.argwhere(before != after)
    from_level = np.abs(field[tuple(places.T)] - LEVEL).round(FIELD_DECIMALS)
    from_middle = np.linalg.norm(
        places - places.mean(axis=0),
        axis=1,
    ).round(FIELD_DECIMALS)
    by_priority = np.lexsort((-from_middle, -from_level))
    # in the padded mask
    places = places[by_priority] + 1
    is_progressing = True
    while is_progressing and len(places):
        waiting = []
        for i, j, k in places:
            block = mask[i - 1 : i + 2, j - 1 : j + 2, k - 1 : k + 2]
            if is_simple(block.tobytes()):
                # it differs from `before`, so flipping sets it back
                mask[i, j, k] = ~mask[i, j, k]
            else:
                waiting.append((i, j, k))
        is_progressing = len(waiting) < len(places)
        places = np.array(waiting)
    return mask[1:-1, 1:-1, 1:-1]


@lru_cache(maxsize=2**16)
def is_simple(block: bytes) -> bool:
    """Return whether the middle voxel of a 3 × 3 × 3 block can be flipped without a
    change of topology."""
    voxels = int(
        block[::-1].translate(DIGITS),
        2,
    )
    inside, outside = voxels & EDGE_CELLS, ~voxels & CORNER_CELLS
    touching = inside & FACE_CELLS
    if not touching or not outside:
        return False
    is_inside_connected = not touching & ~_connected(inside, touching, BY_FACES)
    return is_inside_connected and not outside & ~_connected(
        outside, outside, BY_CORNERS
    )


def _connected(
    places: int,
    seeds: int,
    neighbours: list[int],
) -> int:
    """Return the places (bits of an integer) that are connected to the lowest bit of
    `seeds`."""
    reached = new = seeds & -seeds
    while new:
        lowest = new & -new
        found = neighbours[lowest.bit_length() - 1] & places & ~reached
        reached |= found
        new = (new ^ lowest) | found
    return reached


def without_stalks(mask: Mask, affine: Floats) -> tuple[Mask, list[dict[str, Any]]]:
    """Remove the parts of an (i, j, k) mask that hang by a stalk; return the mask and
    each part's volume and place.

    A ball of 3.2 mm diameter cannot pass through a stalk, and its cross-section is at
    most 12 mm²; a gyrus is wider.
    """
    size = voxel_size(affine)
    wide = ~dilated(~mask, NECK_RADIUS_MM, size)
    number, count = number_parts(wide)
    if count < 2:
        return mask, []
    sizes = np.bincount(number.ravel())[1:]
    large = sizes >= MAX_HANGING_SHARE * sizes.sum()
    main = np.append(False, large)[number]
    solid = mask & dilated(main, NECK_RADIUS_MM, size)
    max_voxels = MAX_HANGING_SHARE * mask.sum()
    hanging, reach = np.zeros_like(mask), NECK_RADIUS_MM + STALK_MM
    for part, tight in enumerate(ndimage.find_objects(number)):
        if large[part]:
            continue
        box = widened(
            tight,
            int(reach / size.min()) + 2,
        )
        ball = number[box] == part + 1
        near = distance_to(ball, size) <= reach
        loose, _ = number_parts(mask[box] & ~solid[box] & near)
        cut = np.isin(
            loose,
            np.setdiff1d(loose[ball], 0),
        )
        large_enough = (
            cut.sum() * size.prod() >= MIN_HANGING_MM3 and cut.sum() < max_voxels
        )
        if (
            large_enough
            and 0
            < _contact_mm2(
                cut,
                mask[box] & ~cut,
                size,
            )
            <= MAX_NECK_MM2
        ):
            hanging[box] |= cut
    if not hanging.any():
        return mask, []
    number, count = number_parts(hanging)
    remaining = mask & ~hanging
    return remaining, [
        {
            "volume_mm3": float(part.sum() * size.prod()),
            "stalk_mm2": _contact_mm2(part, remaining, size),
            "place_mm": (
                affine[:3, :3] @ np.argwhere(part).mean(axis=0) + affine[:3, 3]
            )
            .round(1)
            .tolist(),
        }
        for part in (number == n for n in range(1, count + 1))
    ]


def _contact_mm2(
    first: Mask,
    second: Mask,
    size_mm: Floats,
) -> float:
    total = 0.0
    for axis in range(3):
        a = np.moveaxis(first, axis, 0)
        b = np.moveaxis(second, axis, 0)
        b_after_a = a[:-1] & b[1:]
        a_after_b = b[:-1] & a[1:]
        face_mm2 = np.prod(np.delete(size_mm, axis))
        total += float((b_after_a.sum() + a_after_b.sum()) * face_mm2)
    return total
