"""Masks of voxels, their topology made that of balls, what hangs on them by stalks cut off, and isosurfaces."""

from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.special import ndtr
from skimage.measure import marching_cubes

from ..errors import MeshError
from ..geometry.triangles import Floats, Mask, TriangleMesh, signed_volume, transformed

PAD_VOXELS = 6
# σ of the Gaussian by which masks are smoothed before they become surfaces
SMOOTHING_VOXELS = 1.0
LEVEL = 0.5
# slope per voxel of a mask's edge smoothed with σ = 1 voxel: 1/√(2π)
EDGE_SLOPE = 0.4
# smaller groups of voxels outside a mask that smoothing closes are roughness of the labels
LEAST_SLIT_VOXELS = 20
# a part of this size of the largest is kept: two hemispheres that do not touch
COMPARABLE = 0.2
# voxels inside are joined through faces only, voxels outside through edges and corners as well
INSIDE = ndimage.generate_binary_structure(3, 1)
OUTSIDE = ndimage.generate_binary_structure(3, 3)
# the 27 places around and in a voxel, and as bits of a number those that share a corner, an edge or a face with it
CELLS = np.array(list(np.ndindex(3, 3, 3)))
AROUND, BESIDE, FACING = (
    sum(1 << place for place, cell in enumerate(CELLS) if 0 < np.abs(cell - 1).sum() <= most) for most in (3, 2, 1)
)
BY_CORNERS, BY_FACES = (
    [sum(1 << place for place, cell in enumerate(CELLS) if 0 < distance(cell - one) <= 1) for one in CELLS]
    for distance in (lambda way: np.abs(way).max(), lambda way: np.abs(way).sum())
)
# radii in voxels of the openings and closings that find what joins or pierces the mask
REACHES = (1.0, 1.5, 2.0, 3.0, 4.5, 6.0)
# how far around a change its effect on parts is looked for, in voxels: at last in the whole volume
MARGINS = (4, 16, 64, 100_000)
# distance from the level of one half at which changed voxels are put
STEP = 0.2
# stalks are thinner than twice this
NECK_RADIUS_MM = 1.6
# the stalk's cross-section, and the part that hangs on it: larger ones are no polyps but parts of a brain
MOST_NECK_MM2 = 12.0
MOST_SHARE = 0.05
LEAST_MM3 = 15.0
# how far from the hanging part its stalk is cut away with it
REACH_MM = 4.0


def crop(mask: Mask) -> tuple[tuple[slice, ...], NDArray[np.int64]]:
    """Return the slices that cut an (i, j, k) volume to the mask's contents, and the (3,) first index of the cut
    volume once it has been padded with `PAD_VOXELS`.
    """
    box = ndimage.find_objects(mask.astype(np.uint8))[0]
    return box, np.array([side.start for side in box]) - PAD_VOXELS


def shifted_affine(affine: Floats, first: NDArray[np.int64]) -> Floats:
    """Return the affine of a volume that was cut (or padded) so that it begins at voxel `first`."""
    moved = np.array(affine, dtype=float)
    moved[:3, 3] += moved[:3, :3] @ first
    return moved


def parts_in_boxes(mask: Mask) -> Iterator[tuple[tuple[slice, ...], Mask]]:
    """Yield each part of an (i, j, k) mask: its box, one voxel wider than the part, and the part's mask in it.

    Voxels at edges and corners of each other are of one part.
    """
    number, _ = ndimage.label(mask, OUTSIDE)
    for index, tight in enumerate(ndimage.find_objects(number), start=1):
        box = _wider(tight, 1)
        yield box, number[box] == index


def _wider(box: tuple[slice, ...], margin: int) -> tuple[slice, ...]:
    return tuple(slice(max(side.start - margin, 0), side.stop + margin) for side in box)


def smooth_mask(mask: Mask, smoothing_voxels: float = SMOOTHING_VOXELS) -> NDArray[np.float32]:
    """Return the mask as a field from 0 to 1, smoothed by a Gaussian of the given σ in voxels."""
    return ndimage.gaussian_filter(mask.astype(np.float32), smoothing_voxels)


def remove_bridges(mask: Mask, field: NDArray[np.float32], left_shut: Mask) -> tuple[NDArray[np.float32], int]:
    """Return a smoothed mask in which slits that smoothing has closed are open again, and their number of voxels.

    A slit is a group of voxels outside the mask, open to the outside: a sulcus, the fissure or the Sylvian opening,
    one voxel wide. Its voxels take the value with which the surface passes where the slit's walls are. Groups of a few
    voxels are roughness of the labels, which smoothing is for; a slit that would pierce the mask stays shut, and so
    does what is in the mask `left_shut`.
    """
    number, _ = ndimage.label(~mask)
    # the volume is padded, so its first voxel is outside
    closed = (number == number[0, 0, 0]) & (field > LEVEL) & ~left_shut
    number, gains = _parts_with_gains(field > LEVEL, closed)
    opened = (np.bincount(number[closed], minlength=len(gains)) >= LEAST_SLIT_VOXELS) & (gains == 0)
    slits = closed & opened[number]
    # half-way between a slit's voxel and the next, whose value is that beside a slit one voxel wide, lies the wall
    beside = 1.0 - (ndtr(1.5 / SMOOTHING_VOXELS) - ndtr(0.5 / SMOOTHING_VOXELS))
    return np.where(slits, np.float32(1.0 - beside), field), int(slits.sum())


def refine(field: NDArray, affine: Floats, factor: int) -> tuple[NDArray, Floats]:
    """Return an (i, j, k) field on voxels `factor` times smaller, linear in between, and their affine."""
    fine = np.array(affine, dtype=float)
    fine[:3, :3] /= factor
    # the first fine voxel's centre lies nearer to the first coarse voxel's corner
    fine[:3, 3] -= affine[:3, :3].sum(axis=1) * 0.5 * (1.0 - 1.0 / factor)
    return ndimage.zoom(field, factor, order=1, grid_mode=True, mode="nearest"), fine


def main_parts(mask: Mask, comparable: float = COMPARABLE) -> tuple[Mask, int, int]:
    """Return the mask's largest part and those of comparable size, filled, without the other parts.

    The second and third value are the number of parts dropped and the number of voxels in them.
    """
    number, count = ndimage.label(mask)
    sizes = np.bincount(number.ravel(), minlength=count + 1)
    sizes[0] = 0
    kept = (sizes >= comparable * sizes.max()) & (sizes > 0)
    dropped = ~kept & (sizes > 0)
    return ndimage.binary_fill_holes(kept[number]), int(dropped.sum()), int(sizes[dropped].sum())


def make_simple(
    field: NDArray[np.float32], comparable: float = COMPARABLE
) -> tuple[NDArray[np.float32], dict[str, Any]]:
    """Return the field with a level set of main parts only, without cavities and handles, and a report.

    Main parts are those of `comparable` times the largest one's size and more.
    """
    inside = field > LEVEL
    if not inside.any():
        raise MeshError("nothing is left of the mask after smoothing")
    kept, parts, voxels = main_parts(inside, comparable)
    field = np.where(kept, np.maximum(field, LEVEL + 1e-3), np.minimum(field, LEVEL - 1e-3)).astype(np.float32)
    field, handles_repaired = without_handles(field)
    dropped = {"parts_dropped": parts, "voxels_dropped": voxels, "voxels_filled": int((kept & ~inside).sum())}
    return unambiguous(field), dropped | handles_repaired


def isosurface(field: NDArray[np.float32], affine: Floats) -> TriangleMesh:
    """Return the outward surface in mm where an (i, j, k) field falls below one half.

    MeshError where it encloses no volume.
    """
    vertices, faces, _, _ = marching_cubes(field, LEVEL, gradient_direction="ascent")
    # an affine that mirrors (LAS, LPI, …) turns the faces inside out: transformed() turns them back
    mesh = transformed(TriangleMesh(vertices, faces), affine)
    if signed_volume(mesh) <= 0:
        raise MeshError("the surface of the mask encloses no volume", found=f"{signed_volume(mesh):.3g} mm³")
    return mesh


def handles(mask: Mask) -> int:
    """Return the number of handles of an (i, j, k) mask: parts plus cavities minus Euler number."""
    parts, outside = _pieces(np.pad(mask, 1))
    return parts + outside - 1 - _euler_number(mask)


def without_handles(field: NDArray[np.float32]) -> tuple[NDArray[np.float32], dict[str, int]]:
    """Return the (i, j, k) field with the handles of its level set above one half cut or filled, and the counts.

    Patches that an opening takes away or a closing adds are tried from the smallest to the largest. One that removes
    a handle is kept, less all voxels that can be given back without a change of topology (simple points, Bertrand and
    Malandain 1994, doi 10.1016/0167-8655(94)90046-9).
    """
    original = field > 0.5
    mask = original.copy()
    left = handles(mask)
    counts = {False: 0, True: 0}
    # at last a cut may leave voxels that reach the outside through edges and corners only
    for closed_by, reach in product((INSIDE, OUTSIDE), REACHES):
        if left == 0:
            break
        for fills, box, patch in _patches(mask, reach):
            # an earlier change may have touched this patch
            patch = patch & (mask[box] != fills)
            changed = np.where(patch, fills, mask[box])
            if left == 0 or not patch.any() or _euler_gain(mask[box], changed) <= 0:
                continue
            if removed := _change(mask, box, _least_change(mask[box], changed, field[box]), closed_by):
                left -= removed
                counts[fills] += 1
    added, cut = mask & ~original, original & ~mask
    changed = np.where(added, 0.5 + STEP, np.where(cut, 0.5 - STEP, field)).astype(field.dtype)
    return changed, {
        "bridges_cut": counts[False],
        "voxels_cut_from_bridges": int(cut.sum()),
        "tunnels_filled": counts[True],
        "voxels_filled_in_tunnels": int(added.sum()),
        "handles_left": left,
    }


def unambiguous(field: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the field with diagonal neighbours set apart, so that its isosurface joins voxels by faces only.

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


def dilated(mask: Mask, radius: float) -> Mask:
    """Return the voxels of an (i, j, k) volume within a radius, in voxels and at most 10, of those of the mask.

    Squared distances are summed axis by axis, in bytes: a distance transform takes ten times the time and memory.
    """
    squared = np.where(mask, 0, int(radius**2) + 1).astype(np.uint8)
    for axis in range(3):
        nearest = squared.copy()
        new, old = np.moveaxis(nearest, axis, 0), np.moveaxis(squared, axis, 0)
        for step in range(1, int(radius) + 1):
            np.minimum(new[step:], old[:-step] + step**2, out=new[step:])
            np.minimum(new[:-step], old[step:] + step**2, out=new[:-step])
        squared = nearest
    return squared <= radius**2


def _patches(mask: Mask, reach: float) -> list[tuple[bool, tuple[slice, ...], Mask]]:
    closed = ~dilated(~dilated(mask, reach), reach)
    opened = dilated(~dilated(~mask, reach), reach)
    patches = []
    for fills, change in ((True, closed & ~mask), (False, mask & ~opened)):
        number, gains = _parts_with_gains(mask, change)
        patches += [(fills, box, patch) for box, patch in parts_in_boxes(change & (gains > 0)[number])]
    return sorted(patches, key=lambda item: item[2].sum())


def _change(mask: Mask, box: tuple[slice, ...], changed: Mask, closed_by: Mask) -> int:
    """Change a mask in a box where this removes handles and leaves its parts as they are; return how many it removes.

    What it joins or parts may be joined elsewhere as well, which is looked for in ever wider boxes. Cavities, out of
    which no neighbours of `closed_by` lead, are filled.
    """
    for margin in MARGINS:
        wide = _wider(box, margin)
        inner = tuple(slice(a.start - b.start, a.stop - b.start) for a, b in zip(box, wide, strict=True))
        before, after = mask[wide], mask[wide].copy()
        after[inner] = changed
        after = ndimage.binary_fill_holes(after, closed_by)
        gain = _euler_gain(before, after)
        # the frame joins all that reaches the box's border
        framed = [ndimage.label(np.pad(one, 1, constant_values=True), INSIDE)[1] for one in (before, after)]
        if gain <= 0 or framed[0] < framed[1]:
            return 0
        if _pieces(before) == _pieces(after):
            mask[wide] = after
            return gain
    return 0


def _pieces(mask: Mask) -> tuple[int, int]:
    return ndimage.label(mask, INSIDE)[1], ndimage.label(~mask, OUTSIDE)[1]


def _euler_cells(mask: Mask) -> NDArray[np.int8]:
    """Return what each (i, j, k) voxel adds to the Euler number, with the seven next ones along the axes.

    Voxels that are joined by faces have that of a complex of points, edges, squares and cubes.
    """
    x, y, z = (_pairs(mask, axis) for axis in range(3))
    xy, xz, yz = _pairs(x, 1), _pairs(x, 2), _pairs(y, 2)
    return mask.astype(np.int8) - x - y - z + xy + xz + yz - _pairs(xy, 2)


def _pairs(mask: Mask, axis: int) -> Mask:
    ends = np.moveaxis(mask, axis, -1)
    both = ends & np.concatenate([ends[..., 1:], np.zeros_like(ends[..., :1])], axis=-1)
    return np.moveaxis(both, -1, axis)


def _euler_number(mask: Mask) -> int:
    return int(_euler_cells(mask).sum(dtype=np.int64))


def _euler_gain(before: Mask, after: Mask) -> int:
    return _euler_number(after) - _euler_number(before)


def _parts_with_gains(mask: Mask, change: Mask) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the numbers of the parts of a `change` of the mask, and by number the Euler number that each one adds.

    The parts touch neither at edges nor at corners, so that one cell of eight voxels sees one of them only.
    """
    number, count = ndimage.label(change, OUTSIDE)
    gain = _euler_cells(mask ^ change) - _euler_cells(mask)
    places, last = np.argwhere(gain), np.array(mask.shape) - 1
    part = np.zeros(len(places), dtype=np.int64)
    for corner in np.ndindex(2, 2, 2):
        part = np.maximum(part, number[tuple(np.minimum(places + corner, last).T)])
    gains = np.bincount(part, weights=gain[tuple(places.T)], minlength=count + 1)
    return number, gains.astype(np.int64)


def _least_change(before: Mask, after: Mask, field: NDArray[np.float32]) -> Mask:
    """Return `after` with every voxel set back to `before` that does not change the topology.

    The clearest voxels go back first, so that what stays changed lies where the field is closest to one half.
    """
    mask = np.pad(after, 1)
    places = np.argwhere(before != after)
    places = places[np.argsort(-np.abs(field[tuple(places.T)] - 0.5), kind="stable")] + 1
    given_back = True
    while given_back and len(places):
        waiting = []
        for i, j, k in places:
            if is_simple(mask[i - 1 : i + 2, j - 1 : j + 2, k - 1 : k + 2].tobytes()):
                mask[i, j, k] = ~mask[i, j, k]
            else:
                waiting.append((i, j, k))
        given_back = len(waiting) < len(places)
        places = np.array(waiting)
    return mask[1:-1, 1:-1, 1:-1]


@lru_cache(maxsize=2**16)
def is_simple(around: bytes) -> bool:
    """Return whether the middle one of 3 × 3 × 3 voxels can change sides without a change of topology."""
    voxels = sum(1 << place for place, value in enumerate(around) if value)
    inside, outside = voxels & BESIDE, ~voxels & AROUND
    facing = inside & FACING
    if not facing or not outside:
        return False
    return not facing & ~_joined(inside, facing, BY_FACES) and not outside & ~_joined(outside, outside, BY_CORNERS)


def _joined(places: int, beginning: int, neighbours: list[int]) -> int:
    """Return those of the places, bits of a number, that neighbours join to the lowest bit of the beginning."""
    reached = new = beginning & -beginning
    while new:
        lowest = new & -new
        found = neighbours[lowest.bit_length() - 1] & places & ~reached
        reached |= found
        new = (new ^ lowest) | found
    return reached


def without_stalks(mask: Mask, affine: Floats) -> tuple[Mask, list[dict[str, Any]]]:
    """Return the (i, j, k) mask without what hangs on it by stalks, and each part's volume, stalk and place in mm.

    A part hangs where a ball of 3.2 mm across cannot pass from the rest to it, and no more than 12 mm² join it to the
    rest: a gyrus, which may be as thin, is joined along its length.
    """
    size = np.linalg.norm(affine[:3, :3], axis=0)
    depth = ndimage.distance_transform_edt(mask, sampling=size)
    number, count = ndimage.label(depth > NECK_RADIUS_MM, INSIDE)
    if count < 2:
        return mask, []
    sizes = np.bincount(number.ravel())[1:]
    large = sizes >= MOST_SHARE * sizes.sum()
    main = np.isin(number, np.flatnonzero(large) + 1)
    solid = mask & (ndimage.distance_transform_edt(~main, sampling=size) <= NECK_RADIUS_MM)
    most = MOST_SHARE * mask.sum()
    hanging, reach = np.zeros_like(mask), NECK_RADIUS_MM + REACH_MM
    for part, tight in enumerate(ndimage.find_objects(number)):
        if large[part]:
            continue
        box = _wider(tight, int(reach / size.min()) + 2)
        ball = number[box] == part + 1
        near = ndimage.distance_transform_edt(~ball, sampling=size) <= reach
        loose, _ = ndimage.label(mask[box] & ~solid[box] & near, INSIDE)
        cut = np.isin(loose, np.setdiff1d(loose[ball], 0))
        large_enough = cut.sum() * size.prod() >= LEAST_MM3 and cut.sum() < most
        if large_enough and 0 < _contact_mm2(cut, mask[box] & ~cut, size) <= MOST_NECK_MM2:
            hanging[box] |= cut
    number, count = ndimage.label(hanging, INSIDE)
    left = mask & ~hanging
    return left, [
        {
            "volume_mm3": float(part.sum() * size.prod()),
            "stalk_mm2": _contact_mm2(part, left, size),
            "place_mm": (affine[:3, :3] @ np.argwhere(part).mean(axis=0) + affine[:3, 3]).round(1).tolist(),
        }
        for part in (number == n for n in range(1, count + 1))
    ]


def _contact_mm2(one: Mask, other: Mask, size_mm: Floats) -> float:
    total = 0.0
    for axis in range(3):
        a, b = np.moveaxis(one, axis, 0), np.moveaxis(other, axis, 0)
        faces = (a[:-1] & b[1:]).sum() + (b[:-1] & a[1:]).sum()
        total += float(faces * np.prod(np.delete(size_mm, axis)))
    return total
