"""Open fused sulci where fronts from the white matter of two banks meet within the
cortex.

There the nearest white matter changes from one bank to the other (Han et al. 2004,
10.1016/j.neuroimage.2004.06.043).
"""

import heapq
import math
from collections import defaultdict
from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from ..geometry.boxes import Box
from ..geometry.deformations import transform_points, voxel_size
from ..geometry.voxels import OUTSIDE, distance_to, number_parts
from ..units import ML_PER_MM3
from .extraction import (
    LEVEL,
    Floats,
    Mask,
    is_simple,
    main_parts,
    refine,
    shifted_affine,
    with_neighbours,
)
from .fissure import sample

# voxels are refined to at most this size before a slit is cut; voxels of about 0.5 mm
# are kept
MAX_VOXEL_MM = 0.55
# white matter of two banks is at least this many cortical thicknesses apart, closer
# under a bend or a thick crest
MIN_BANK_DISTANCE = 1.4
# the cortex of a bank has at least this share of its usual thickness
MIN_BANK = 0.75
# smaller sheets are roughness of the labels; less deep ones (in thicknesses) the
# rounded bottom of an open sulcus
MIN_SHEET_MM2 = 8.0
MIN_SHEET_DEPTH = 1.5
# margin around a brain
MARGIN_VOXELS = 3
# value of the field in a slit; with 1 next to it, a slit of one voxel becomes 0.9
# voxels wide
SLIT_VALUE = 0.1
# the usual thickness is that of the surface nearby where this is thinner
NEARBY_MM = 15.0
# places at which it is determined, and depths of the surface that count for it
PLACES_MM, N_DEPTHS = 5.0, 10_000
# cortex further from white matter than this many thicknesses lacks white matter;
# largest share of such cortex
FAR, MAX_FAR_SHARE = 3.0, 0.05


def may_have_slits(report: Mapping[str, Any]) -> bool:
    """Return whether a surface with this report may have slits: from labels if fused
    sulci were opened, and if it was given as a surface."""
    return bool(report.get("sulci", {"sheets": 1}).get("sheets"))


def open_fused_sulci(
    field: NDArray[np.float32],
    affine: Floats,
    core: Mask,
    side_mm: NDArray[np.float32] | None = None,
) -> tuple[NDArray[np.float32], Floats, dict[str, Any]]:
    """Open the fused sulci of a cerebrum's smoothed mask by slits; return the field,
    its affine, and a report.

    The (i, j, k) `field` is refined to voxels of at most 0.55 mm; they are those of
    `core`, the tissue inside the cortex, or an integer fraction. Slits grow inward over
    simple points, so they add no handles, and end where both banks have the same white
    matter; between hemispheres (signs of `side_mm`) there are none. The field is
    unchanged if no sulcus is fused, or if much cortex is far from white matter:
    "stays_fused" in the report.
    """
    factor = int(np.ceil(voxel_size(affine).max() / MAX_VOXEL_MM))
    every = field.shape[0] // core.shape[0]
    brain, part = _around_brain(field, every)
    solid, _ = refine(
        main_parts(core)[0][part].astype(np.float32), affine, every * factor
    )
    near = field[brain]
    grid = shifted_affine(
        affine,
        np.array([side.start for side in brain]),
    )
    whole, fine = refine(near, grid, factor)
    size = np.linalg.norm(
        fine[:3, :3],
        axis=0,
    )
    inside, solid = whole > LEVEL, solid > LEVEL
    cortex = inside & ~solid
    nearest = ndimage.distance_transform_edt(
        ~solid,
        sampling=size,
        return_distances=False,
        return_indices=True,
    )
    places = np.argwhere(cortex).astype(np.int32)
    depth_mm = np.linalg.norm(
        (nearest[:, cortex].T - places) * size,
        axis=1,
    )
    at_surface = with_neighbours(~inside)
    surface = at_surface[cortex]
    if (
        far := float((depth_mm > FAR * np.quantile(depth_mm[surface], 0.25)).mean())
    ) > MAX_FAR_SHARE:
        reason = (
            f"{100 * far:.0f} % of the cortex is further than {FAR:g} times its"
            " thickness from white matter"
        )
        return field, affine, {"stays_fused": reason}
    thickness = np.zeros(cortex.shape, dtype=np.float32)
    thickness[cortex] = _usual_thickness(
        places * size, places[surface] * size, depth_mm[surface]
    )
    bank = cortex.copy()
    bank[cortex] = depth_mm > MIN_BANK * thickness[cortex]
    distance = np.zeros(cortex.shape, dtype=np.float32)
    for axis in range(3):
        _mark_sheet(
            distance,
            bank,
            nearest,
            axis,
            MIN_BANK_DISTANCE * thickness,
            size,
            None if side_mm is None else side_mm[part],
        )
    # the depth of a sheet is measured on coarse voxels, in an eighth of the time
    below = distance_to(near <= LEVEL, voxel_size(affine))
    depth = sample(
        below,
        grid,
        transform_points(np.argwhere(distance > 0), fine),
    )
    is_deep = depth > MIN_SHEET_DEPTH * thickness[distance > 0]
    sheets, count = _deep_sheets(distance > 0, at_surface, size, is_deep)
    if not count:
        return field, affine, {"sheets": 0, "slit_voxels": 0, "opened_mL": 0.0}
    slit = _grow_slits(inside, sheets, cortex, distance)
    opened = whole.copy()
    before = whole[slit]
    after = np.minimum(before, np.float32(SLIT_VALUE))
    opened[slit] = after
    lost = (before - after).sum(dtype=float)
    taken = float(lost * size.prod() * ML_PER_MM3)
    return (
        opened,
        fine,
        {
            "sheets": count,
            "slit_voxels": int(slit.sum()),
            "opened_mL": taken,
        },
    )


def _around_brain(field: NDArray[np.float32], every: int) -> tuple[Box, Box]:
    """Return the slices of a field around a brain, and those of voxels `every` times
    larger."""
    large = [
        slice(
            max(side.start // every - MARGIN_VOXELS, 0),
            -(-side.stop // every) + MARGIN_VOXELS,
        )
        for side in ndimage.find_objects((field > LEVEL).astype(np.uint8))[0]
    ]
    fine = [
        slice(
            every * side.start,
            every * side.stop,
        )
        for side in large
    ]
    return tuple(fine), tuple(large)


def _usual_thickness(
    points: Floats,
    surface: Floats,
    depth: Floats,
) -> Floats:
    """Return the median depth in mm of the cortex at the surface around (n, 3) points,
    at most that of the brain.

    `depth` (m,) is at the (m, 3) surface points; medians are within `NEARBY_MM` of
    places `PLACES_MM` apart.
    """
    every = max(1, len(surface) // N_DEPTHS)
    # by depth, so that the median of some rows is that of their numbers
    order = every * np.argsort(depth[::every])
    tree, depth = cKDTree(surface[order]), depth[order]
    cell = tuple(np.rint(points / PLACES_MM).astype(np.int64).T)
    is_used = np.zeros(
        [axis.max() + 1 for axis in cell],
        dtype=bool,
    )
    is_used[cell] = True
    overall = float(np.median(depth))
    medians = []
    for rows in tree.query_ball_point(
        PLACES_MM * np.argwhere(is_used),
        NEARBY_MM,
        return_sorted=True,
    ):
        median = overall
        if rows:
            middle = 0.5 * (len(rows) - 1)
            below, above = rows[math.floor(middle)], rows[math.ceil(middle)]
            median = 0.5 * (depth[below] + depth[above])
        medians.append(min(median, overall))
    thickness = np.zeros(is_used.shape)
    thickness[is_used] = medians
    return thickness[cell]


def _deep_sheets(
    sheet: Mask,
    at_surface: Mask,
    size_mm: Floats,
    is_deep: Mask,
) -> tuple[Mask, int]:
    """Return the large parts of a mask from `at_surface` to places where `is_deep` (n,)
    holds, and their number."""
    number, count = number_parts(sheet, OUTSIDE)
    part, parts = number[sheet], np.arange(count + 1)
    large = (
        np.bincount(part, minlength=count + 1) * size_mm.prod() ** (2 / 3)
        >= MIN_SHEET_MM2
    )
    reached = (
        np.bincount(
            part,
            at_surface[sheet],
            minlength=count + 1,
        )
        > 0
    )
    deep = np.bincount(part, is_deep, minlength=count + 1) > 0
    is_sheet = large & reached & deep & (parts > 0)
    return is_sheet[number], int(is_sheet.sum())


def _mark_sheet(
    distance: NDArray[np.float32],
    cortex: Mask,
    nearest: NDArray[np.int32],
    axis: int,
    min_mm: NDArray[np.floating],
    size: Floats,
    side_mm: NDArray[np.float32] | None,
) -> None:
    """Set `distance` (i, j, k) to that between the banks in mm, where neighbours along
    an axis have different banks.

    Only distances above `min_mm`, and voxels that the plane half-way between the banks
    passes, are set. Both banks are on one side, by the signs of `side_mm` in voxels
    that may be an integer multiple as large.
    """
    step = np.eye(3, dtype=int)[axis]
    first = np.argwhere(cortex & np.roll(cortex, -1, axis))
    banks = [nearest[(slice(None), *voxels.T)].T for voxels in (first, first + step)]
    offset = (banks[1] - banks[0]) * size
    length = np.linalg.norm(offset, axis=1)
    differ = np.flatnonzero(length > min_mm[tuple(first.T)])
    if side_mm is not None:
        factor = distance.shape[0] / side_mm.shape[0]
        sides = []
        for bank in banks:
            places = (bank[differ].T + 0.5) / factor - 0.5
            heights = ndimage.map_coordinates(
                side_mm,
                places,
                order=1,
                mode="nearest",
            )
            sides.append(heights > 0)
        differ = differ[sides[0] == sides[1]]
    first, offset, length = first[differ], offset[differ], length[differ]
    middle = 0.5 * (banks[0] + banks[1])[differ] * size
    normal = offset / length[:, None]
    reach = 0.5 * (np.abs(normal) * size).sum(axis=1)
    for voxels in (first, first + step):
        through = np.abs(((voxels * size - middle) * normal).sum(axis=1)) <= reach
        np.maximum.at(
            distance, tuple(voxels[through].T), length[through].astype(np.float32)
        )


def _grow_slits(
    inside: Mask,
    sheet: Mask,
    cortex: Mask,
    distance: NDArray[np.float32],
) -> Mask:
    """Return the slits: voxels of a sheet into which the outside grows over simple
    points, widest banks first.

    Gaps of one voxel in the sheet are bridged, and filled again if this was not
    necessary.
    """
    layer, row = inside.shape[1] * inside.shape[2], inside.shape[2]
    offsets = product((-1, 0, 1), repeat=3)
    steps = [i * layer + j * row + k for i, j, k in offsets]
    face_steps = [-layer, -row, -1, 1, row, layer]
    places = np.flatnonzero(sheet)
    # the closing of the sheet by a block of 3 × 3 × 3 voxels
    is_near = np.zeros(inside.size, dtype=bool)
    for step in steps:
        is_near[places + step] = True
    gaps = np.flatnonzero(is_near & (cortex & ~sheet).ravel())
    for step in steps:
        gaps = gaps[is_near[gaps + step]]
    places = np.concatenate([places, gaps])
    around = places[:, None] + face_steps
    is_enclosed = inside.ravel()[around].all(axis=1)
    waiting = dict(
        zip(
            places.tolist(),
            (-distance.flat[places]).tolist(),
            strict=True,
        )
    )
    # these come into the queue when a voxel at one of their faces is taken
    enclosed = set(places[is_enclosed].tolist())
    queue = [(waiting[place], place) for place in places[~is_enclosed].tolist()]
    heapq.heapify(queue)
    # flat bytes, since reading single voxels of an array takes ten times as long
    mask, rows = bytearray(inside.tobytes()), steps[::3]
    order = []
    # voxels that are not simple come into the queue again when one around them is taken
    idle = set()
    idle_around = defaultdict(list)

    while queue:
        _, place = heapq.heappop(queue)
        if not _is_simple_at(mask, place, rows):
            idle.add(place)
            for step in steps:
                idle_around[place + step].append(place)
            continue
        mask[place] = 0
        order.append(place)
        for step in face_steps:
            near = place + step
            if near in enclosed:
                enclosed.remove(near)
                heapq.heappush(queue, (waiting[near], near))
        for near in idle_around.pop(place, ()):
            if near in idle:
                idle.remove(near)
                heapq.heappush(queue, (waiting[near], near))
    for place in reversed(order):
        if not sheet.flat[place] and _is_simple_at(mask, place, rows):
            mask[place] = 1
    return inside & (np.frombuffer(mask, dtype=np.uint8).reshape(inside.shape) == 0)


def _is_simple_at(mask: bytearray, place: int, rows: list[int]) -> bool:
    return is_simple(
        b"".join([mask[place + begin : place + begin + 3] for begin in rows])
    )
