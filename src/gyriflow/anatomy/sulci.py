"""Sulci that voxels keep shut, opened where fronts from the white matter of two banks meet within the cortex.

The cortex between two banks that touch is one thick sheet, and the shut sulcus is its middle (Han et al. 2004, doi
10.1016/j.neuroimage.2004.06.043). There the white matter nearest to a point changes from one bank to the other.
"""

import heapq
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..geometry.deformations import transform_points
from ..units import ML_PER_MM3
from .extraction import INSIDE, LEVEL, OUTSIDE, Floats, Mask, is_simple, main_parts, refine, shifted_affine
from .fissure import Fissure, sample
from .thickness import LEAST_VOXELS

# voxels are made as fine as this before a slit is cut between them; usual ones of 0.5 mm, exact or not, are as they are
FINE_MM = 0.55
# the points of white matter nearest to both sides of a sulcus are so many cortical thicknesses apart; under a bend or a
# thick crest they are nearer to each other
APART = 1.4
# the cortex of a bank has at least this part of its usual thickness
LEAST_BANK = 0.75
# smaller sheets are roughness of the labels; those that reach less deep below the surface, in cortical thicknesses, are
# an open sulcus' own bottom, rounded by voxels
LEAST_MM2 = 8.0
DEEP = 1.5
# voxels that are kept around a brain
MARGIN_VOXELS = 3
# the field in a slit: with 1 beside it, a slit one voxel wide comes out 0.9 voxels wide
IN_SLIT = 0.1
# cortex further from white matter than so many thicknesses lacks white matter; more than this share of it is too much
FAR, MOST_FAR = 3.0, 0.05


def open_shut_sulci(
    field: NDArray[np.float32], affine: Floats, core: Mask, fissure: Fissure | None = None
) -> tuple[NDArray[np.float32], Floats, dict[str, Any]]:
    """Return the smoothed mask of a cerebrum with its shut sulci opened by slits, its affine, and a report.

    The (i, j, k) `field` is cut to the brain and made finer, to voxels of at most 0.55 mm; its voxels are those of the
    mask `core`, the tissue inside the cortex, or a whole part of these. Slits begin outside and grow inwards over
    simple points, so that they add neither handles nor cavities, and stop where one bank's white matter begins to be
    the other's. The `fissure` parts the hemispheres: what lies between these is no sulcus. The field is returned as it
    was where no sulcus is shut, where much cortex lies far from all white matter, and where cortex is thinner than 1.5
    voxels; for the latter two the report says why as "stays_fused".
    """
    factor = int(np.ceil(np.linalg.norm(affine[:3, :3], axis=0).max() / FINE_MM))
    every = field.shape[0] // core.shape[0]
    brain, part = _around_brain(field, every)
    solid, _ = refine(main_parts(core)[0][part].astype(np.float32), affine, every * factor)
    near, grid = field[brain], shifted_affine(affine, np.array([side.start for side in brain]))
    whole, fine = refine(near, grid, factor)
    size = np.linalg.norm(fine[:3, :3], axis=0)
    inside, solid = whole > LEVEL, solid > LEVEL
    cortex = inside & ~solid
    nearest = ndimage.distance_transform_edt(~solid, sampling=size, return_distances=False, return_indices=True)
    places = np.argwhere(cortex).astype(np.int32)
    away = np.linalg.norm((nearest[:, cortex].T - places) * size, axis=1)
    beside = ndimage.binary_dilation(~inside, INSIDE)
    low, thickness = map(float, np.quantile(away[beside[cortex]], [0.25, 0.5]))
    if (far := float((away > FAR * low).mean())) > MOST_FAR:
        why = f"{100 * far:.0f} % of the cortex is further than {FAR:g} times its thickness from white matter"
        return field, affine, {"stays_fused": why}
    if (voxels := thickness / (factor * every * size.max())) < LEAST_VOXELS:
        why = f"the cortex is {voxels:.1f} voxels thick, so that roughness of the labels looks like two banks"
        return field, affine, {"stays_fused": why}
    bank = cortex.copy()
    bank[cortex] = away > LEAST_BANK * thickness
    apart = np.zeros(cortex.shape, dtype=np.float32)
    for axis in range(3):
        _mark(apart, bank, nearest, axis, APART * thickness, fine, fissure)
    # coarse voxels tell how deep a sheet reaches, at an eighth of the time
    below = ndimage.distance_transform_edt(near > LEVEL, sampling=np.linalg.norm(affine[:3, :3], axis=0))
    depth = sample(below, grid, transform_points(np.argwhere(apart > 0), fine))
    sheets, count = _deep_sheets(apart > 0, beside, size, depth, DEEP * thickness)
    if not count:
        return field, affine, {"sheets": 0, "slit_voxels": 0, "opened_mL": 0.0}
    slit = _grown(inside, sheets, cortex, apart)
    opened = np.where(slit, np.minimum(whole, np.float32(IN_SLIT)), whole)
    taken = float((whole - opened).sum(dtype=float) * size.prod() * ML_PER_MM3)
    return opened, fine, {"sheets": count, "slit_voxels": int(slit.sum()), "opened_mL": taken}


def _around_brain(field: NDArray[np.float32], every: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Return the slices of a field around a brain, and those of voxels `every` times larger: air costs time."""
    large = [
        slice(max(side.start // every - MARGIN_VOXELS, 0), -(-side.stop // every) + MARGIN_VOXELS)
        for side in ndimage.find_objects((field > LEVEL).astype(np.uint8))[0]
    ]
    return tuple(slice(every * side.start, every * side.stop) for side in large), tuple(large)


def _deep_sheets(apart: Mask, beside: Mask, size_mm: Floats, depth_mm: Floats, least_mm: float) -> tuple[Mask, int]:
    """Return the large parts of a mask that begin at the outside and reach so deep, and their number.

    `depth_mm` (n,) is that of the mask's voxels below the surface, `beside` where the outside is next.
    """
    number, count = ndimage.label(apart, OUTSIDE)
    part, parts = number[apart], np.arange(count + 1)
    large = np.bincount(part, minlength=count + 1) * size_mm.prod() ** (2 / 3) >= LEAST_MM2
    reached = np.bincount(part, beside[apart], minlength=count + 1) > 0
    deep = np.bincount(part, depth_mm > least_mm, minlength=count + 1) > 0
    kept = large & reached & deep & (parts > 0)
    return kept[number], int(kept.sum())


def _mark(
    apart: NDArray[np.float32],
    cortex: Mask,
    nearest: NDArray[np.int32],
    axis: int,
    least_mm: float,
    affine: Floats,
    fissure: Fissure | None,
) -> None:
    """Set `apart` (i, j, k) where neighbours along an axis have different banks: how far these are apart in mm.

    Of both voxels those are set that the plane half-way between the banks passes through: faces join these.
    """
    size, step = np.linalg.norm(affine[:3, :3], axis=0), np.eye(3, dtype=int)[axis]
    first = np.argwhere(cortex & np.roll(cortex, -1, axis))
    banks = [nearest[(slice(None), *one.T)].T for one in (first, first + step)]
    way = (banks[1] - banks[0]) * size
    length = np.linalg.norm(way, axis=1)
    two = length > least_mm
    if fissure is not None:
        sides = [fissure.height_above(transform_points(one[two], affine)) > 0 for one in banks]
        two[two] = sides[0] == sides[1]
    first, way, length, middle = first[two], way[two], length[two], (0.5 * (banks[0] + banks[1]) * size)[two]
    normal = way / length[:, None]
    reach = 0.5 * (np.abs(normal) * size).sum(axis=1)
    for one in (first, first + step):
        through = np.abs(((one * size - middle) * normal).sum(axis=1)) <= reach
        np.maximum.at(apart, tuple(one[through].T), length[through].astype(np.float32))


def _grown(inside: Mask, sheet: Mask, cortex: Mask, apart: NDArray[np.float32]) -> Mask:
    """Return what the outside gains by growing into a sheet over simple points, first where banks are furthest apart.

    Gaps of a voxel in the sheet are bridged, and given back where they were not needed.
    """
    layer, row = inside.shape[1] * inside.shape[2], inside.shape[2]
    steps = [i * layer + j * row + k for i, j, k in product((-1, 0, 1), repeat=3) if (i, j, k) != (0, 0, 0)]
    faces = (1, -1, row, -row, layer, -layer)
    rows = [i * layer + j * row - 1 for i in (-1, 0, 1) for j in (-1, 0, 1)]
    # flat bytes: single voxels of an array take ten times as long to read
    mask, of_sheet = bytearray(inside.tobytes()), sheet.tobytes()
    places = np.flatnonzero(sheet | (ndimage.binary_closing(sheet, OUTSIDE) & cortex))
    waiting = {int(place): -float(apart.flat[place]) for place in places}
    queue = [(value, place) for place, value in waiting.items()]
    queued, order = set(waiting), []
    heapq.heapify(queue)

    def simple(place: int) -> bool:
        return is_simple(b"".join([mask[place + begin : place + begin + 3] for begin in rows]))

    while queue:
        _, place = heapq.heappop(queue)
        queued.discard(place)
        if all(mask[place + step] for step in faces) or not simple(place):
            continue
        mask[place] = 0
        order.append(place)
        for step in steps:
            near = place + step
            if near in waiting and mask[near] and near not in queued:
                queued.add(near)
                heapq.heappush(queue, (waiting[near], near))
    for place in reversed(order):
        if not of_sheet[place] and simple(place):
            mask[place] = 1
    return inside & (np.frombuffer(mask, dtype=np.uint8).reshape(inside.shape) == 0)
