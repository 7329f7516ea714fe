"""Read a label volume by its scheme: mask and tissues of the cerebrum, checks of its
labels, their layout and sides."""

import logging
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..errors import InputError
from ..geometry.boxes import Box, box_of
from ..geometry.deformations import voxel_size
from ..geometry.voxels import OUTSIDE, distance_to, number_parts
from ..settings.schemes import SCHEME_FILES, LabelScheme
from ..units import ML_PER_MM3
from . import extraction
from .extraction import Floats, Mask
from .misplaced import AroundCerebrum, around_cerebrum, misplaced_cortex

log = logging.getLogger(__name__)

Labels = NDArray[np.integer[Any]]

# brains of the example atlas have cortex at 86 % or more of their surface; with a wrong
# scheme 48 % or less
MIN_CORTEX_OUTSIDE = 0.5
# share of voxel pairs of both hemispheres that must lie on the correct sides of each
# other
MIN_SEPARATED = 0.9
# less cortex than this at the cerebrum's surface gives a warning
LITTLE_CORTEX = 0.7
# a larger relative loss of volume gives a warning
REPORTED_LOSS = 0.005
# area of the slice at a border of the volume over that of the next one. None of 47
# volumes of the atlases of Fidon et al. 2021, CRL and Wu et al. 2021, cropped to the
# cerebrum, is taken as cut; of 1179 ends that lack up to 8 slices and more than 0.5 %
# of the brain, 3 are missed
CUT_SLICE_RATIO = 2 / 3
# from a voxel of fluid, so many rays go to the faces, edges and corners of its cell
N_RAYS = 26
# fluid belongs to the cerebrum if more than this share of its rays hits the cerebrum's
# tissue
ENCLOSED = 0.5
# the same for unlabelled ventricles if no cortex is labelled, since rays in fissures
# hit cortex
ENCLOSED_WITHOUT_CORTEX = 0.93
# smoothing of the share of rays, in voxels
RAY_SMOOTHING = 2.0
# scipy's Gaussian ends after so many standard deviations
GAUSSIAN_REACH = 4
# enclosed parts smaller than this share of the largest are ignored
MIN_PART_SHARE = 0.02
# smallest volume of a hemisphere relative to the other one, if the sides are labelled
MIN_HEMISPHERE_RATIO = 0.04
# unlabelled ventricles are searched in what a closing with a ball of this radius adds
# to the tissue
CLOSING_MM = 6.0
# share of a tissue's neighbours that are cerebrum; in 47 brains ≥ 0.89 for white matter
# and fluid, ≤ 0.33 outside
MIN_SHARE_INSIDE, MAX_SHARE_INSIDE = 0.4, 0.5
# shares of the cerebrum's tissue; in these brains 0.16 to 0.43 is cortex, 0.49 or more
# white matter
CORTEX_SHARES, WHITE_SHARES, SMALL_SHARE = (0.03, 0.6), (0.15, 1.0), 0.01
# limit of the ratio between left and right of cortex over white matter
MAX_IMBALANCE = 4.0
# share of the contacts of sided labels that are with the other side; 0.11 or less in 15
# brains, 0.69 or more if mixed
MAX_BETWEEN = 0.4
WHOLE = (slice(None),) * 3
INNER = (slice(1, -1),) * 3
"""A volume without a margin of one voxel."""
HOLE = -1
"""Value for unlabelled voxels enclosed by labels, which are neither inside nor
outside."""


@dataclass(frozen=True, eq=False)
class Cerebrum:
    """The cerebrum of a label volume, cropped with a margin of `PAD_VOXELS`.

    `mask` (i, j, k) is its mask, `tissue` the labels, 0 where they were removed; the
    (4, 4) affine is that of the cropped volume. Parts below `smallest_part` of the
    largest were removed. The report is in plain values.
    """

    mask: Mask
    tissue: Labels
    affine: Floats
    smallest_part: float
    report: dict[str, Any]
    warnings: list[str]

    @property
    def volume_mm3(self) -> float:
        return float(self.mask.sum() * abs(np.linalg.det(self.affine[:3, :3])))


def read_cerebrum(
    labels: Labels,
    affine: Floats,
    scheme: LabelScheme,
    min_cortex: float = 0.0,
) -> Cerebrum:
    """Return the cerebrum without open ventricles, parts on thin stalks and separate
    parts.

    Holes and unlabelled ventricles get the label of the nearest tissue. InputError if
    the labels do not fit the scheme, or if cortex covers less than `min_cortex` of the
    cerebrum's surface.
    """
    numbers = _numbers_in(labels)
    require_labels(numbers, scheme)
    around = around_cerebrum(labels, affine, scheme)
    report = _missing_labels(numbers, around)
    warnings = list(misplaced_cortex(around, is_whole=min_cortex > 0))
    # without the margin that the volume may not have
    labels = around.labels[INNER]
    mask = around.cerebrum[INNER]
    affine = extraction.shifted_affine(affine, around.first + 1)
    voxel_ml = float(abs(np.linalg.det(affine[:3, :3]))) * ML_PER_MM3
    unlabelled = _unlabelled_ventricles(around)
    if scheme.cortex:
        share = _require_cortex_outside(around, min_cortex, unlabelled)
        if share < LITTLE_CORTEX:
            warnings.append(
                f"cortex lies at only {100 * share:.0f} % of the cerebrum's surface:"
                " check the labels"
            )
    if unlabelled.any():
        warnings.append(
            f"{unlabelled.sum() * voxel_ml:.2f} mL without a label of the cerebrum lie"
            " inside it and were filled: ventricles without a label?"
        )
    open_fluid = _outside_ventricles(around)[INNER]
    whole, stalks = extraction.without_stalks(
        (mask & ~open_fluid) | unlabelled,
        affine,
    )
    smallest = (
        MIN_HEMISPHERE_RATIO if scheme.left and scheme.right else extraction.COMPARABLE
    )
    main, parts, dropped = extraction.main_parts(
        whole,
        smallest,
        None if unlabelled.any() else around.filled[INNER],
    )
    if dropped > REPORTED_LOSS * main.sum():
        loss = (
            f"{dropped * voxel_ml:.2f} mL, {100 * dropped / main.sum():.1f} % of the"
            " brain"
        )
        dropped_parts = (
            "a separate part was" if parts == 1 else f"{parts} separate parts were"
        )
        warnings.append(f"{dropped_parts} dropped: {loss}")
    tissue = np.where(mask & ~main, 0, labels)
    cortex = around.cortex[INNER] & main
    holes = main & ~mask
    other = holes & ~unlabelled
    if other.sum() > REPORTED_LOSS * main.sum():
        found = _listed(
            map(int, np.unique(labels[other])),
            scheme,
        )
        warnings.append(
            f"{other.sum() * voxel_ml:.2f} mL inside the cerebrum have labels outside"
            f" it, {found}, and were filled with the tissue around: is tissue of the"
            " cerebrum labelled as these?"
        )
    _fill_from_nearest(tissue, holes, mask & main)
    # not from the cortex
    _fill_from_nearest(tissue, holes & unlabelled, mask & main & ~cortex)
    fluid_ml = float(open_fluid.sum() * voxel_ml)
    report["outside"] = {
        "ventricles_mL": fluid_ml,
        "stalks": stalks,
        "parts": parts,
        "parts_mL": float(dropped * voxel_ml),
    }
    lost = fluid_ml + sum(stalk["volume_mm3"] for stalk in stalks) * ML_PER_MM3
    if lost > REPORTED_LOSS * mask.sum() * voxel_ml:
        warnings.append(
            f"{lost:.2f} mL of the cerebrum's labels lie outside it or on a thin stalk"
            " and were left out"
        )
    fluid = main & (around.fluid[INNER] | unlabelled)
    volumes = {"cerebrum": main}
    if scheme.cortex:
        volumes |= {"cortex": cortex, "inside_cortex": main & ~fluid & ~cortex}
    if scheme.ventricles or unlabelled.any():
        volumes |= {"tissue": main & ~fluid, "ventricles": fluid}
    report["label_volumes_mL"] = {
        name: float(voxels.sum() * voxel_ml) for name, voxels in volumes.items()
    }
    report["border_share"] = _border_share(main)
    box = box_of(main)
    first = np.array([side.start for side in box]) - extraction.PAD_VOXELS
    cropped = np.pad(main[box], extraction.PAD_VOXELS)
    labelled = np.pad(tissue[box], extraction.PAD_VOXELS)
    return Cerebrum(
        cropped,
        labelled,
        extraction.shifted_affine(affine, first),
        smallest,
        report,
        warnings,
    )


def _missing_labels(
    labels: Labels,
    around: AroundCerebrum,
) -> dict[str, Any]:
    """Return what a report says of labels of a scheme that are not among those of a
    volume."""
    scheme = around.scheme
    report: dict[str, Any] = {}
    absent = np.setdiff1d(scheme.cerebrum, labels)
    missing_tissues = [
        f"{number} {scheme.labels[number]}"
        for number in scheme.cerebrum
        if number in absent
    ]
    if missing_tissues:
        report["missing_tissues"] = missing_tissues
        names = ", ".join(missing_tissues[:20])
        log.info("tissues that this brain does not have: %s", names)
    if around.missing:
        note = (
            f"the volume has no {' and no '.join(around.missing)}: the pose is found"
            " without, if it was not left out on purpose"
        )
        report["hindbrain"] = note
        log.info(note)
    return report


def _fill_from_nearest(
    labels: Labels,
    empty: Mask,
    source: Mask,
) -> None:
    """Give empty voxels the label of the nearest one of a source."""
    for box, part in extraction.parts_in_boxes(empty):
        beside = extraction.with_neighbours(part) & ~part
        # the nearest one of a part that is enclosed by a source touches it
        if not source[box][beside].all():
            box = WHOLE
            part = empty
        nearest = ndimage.distance_transform_edt(
            ~source[box], return_distances=False, return_indices=True
        )
        labels[box][part] = labels[box][tuple(nearest[:, part])]
        if part is empty:
            return


def require_labels(labels: Labels, scheme: LabelScheme) -> None:
    """Raise InputError for labels that are not in the scheme, or if the cerebrum or a
    tissue of it is missing."""
    present = set(map(int, np.unique(labels))) - {0}
    unknown = sorted(present - set(scheme.labels))
    if unknown:
        raise InputError(
            f"the label volume has labels that are not in the scheme {scheme.name!r}",
            found=f"{_listed(unknown)} among {_listed(sorted(present))}",
            expected=_listed(scheme.labels, scheme),
            remedy=(
                "Name the scheme that the labels were made with, since another one"
                " with these numbers gives wrong tissues. There are"
                f" {', '.join(SCHEME_FILES)}; write others under schemes. Is this an"
                " image? gyriflow does not segment."
            ),
        )
    if not present & set(scheme.cerebrum):
        raise InputError(
            "no voxel belongs to the cerebrum",
            found=f"labels {_listed(sorted(present)) or 'none but 0'}",
            expected="voxels of " + _listed(scheme.cerebrum, scheme),
        )
    inside = scheme.white_matter or tuple(
        set(scheme.cerebrum) - set(scheme.cortex) if scheme.cortex else ()
    )
    for tissue, numbers in (("cortex", scheme.cortex), ("white matter", inside)):
        if numbers and not present & set(numbers):
            raise InputError(
                f"the {tissue} of the scheme {scheme.name!r} is missing from the label"
                " volume",
                found=f"labels {_listed(sorted(present))}",
                expected="voxels of " + _listed(numbers, scheme),
            )


def _require_cortex_outside(
    around: AroundCerebrum,
    minimum: float,
    unlabelled: Mask,
) -> float:
    """Return the share of the cerebrum's surface with cortex; InputError below
    `minimum`: another scheme."""
    surface = around.surface
    if unlabelled.any():
        filled = extraction.without_holes(around.cerebrum | np.pad(unlabelled, 1))
        surface = filled & extraction.with_neighbours(~filled)
    cortex = extraction.with_neighbours(around.cortex)
    share = float((surface & cortex).sum() / surface.sum())
    if share < minimum:
        raise InputError(
            f"with the scheme {around.scheme.name!r} the cortex does not surround the"
            " cerebrum",
            found=f"cortex at {100 * share:.0f} % of the surface",
            expected=f"{100 * minimum:.0f} % or more",
        )
    return share


def require_sides(
    labels: Labels,
    scheme: LabelScheme,
    affine: Floats,
    to_right: Floats,
) -> None:
    """Raise InputError if, along `to_right` (3,) in mm, labels of left lie right of
    those of right, or are mixed."""
    if not (np.isin(labels, scheme.left).any() and np.isin(labels, scheme.right).any()):
        return
    left, right = (
        np.sort(np.argwhere(np.isin(labels, side)) @ (affine[:3, :3].T @ to_right))
        for side in (scheme.left, scheme.right)
    )
    if (distance := float(right.mean() - left.mean())) <= 0:
        raise InputError(
            "labels of the left hemisphere lie on the right",
            found=f"{-distance:.1f} mm to the right of those of the right hemisphere",
            expected="left at the smaller x (RAS+)",
        )
    separated = float(np.searchsorted(left, right).mean() / len(left))
    if separated < MIN_SEPARATED:
        raise InputError(
            f"with the scheme {scheme.name!r} the labels of left and right are not"
            " hemispheres",
            found=(
                "voxels of the right one to the right of those of the left one in"
                f" {100 * separated:.0f} % of pairs"
            ),
            expected=f"{100 * MIN_SEPARATED:.0f} % or more",
        )


def _outside_ventricles(around: AroundCerebrum) -> Mask:
    """Return the (i, j, k) mask of ventricles that are not enclosed by the cerebrum's
    tissue.

    Their labels often continue to the fourth ventricle. A voxel is enclosed if more
    than half of its 26 rays through fluid hit tissue. With cerebellum or brainstem in
    the scheme, only parts that mostly touch these are left out.
    """
    fluid = around.fluid
    touching = np.zeros_like(fluid)
    if not fluid.any():
        return touching
    hindbrain = around.hindbrain
    near_hindbrain = extraction.with_neighbours(hindbrain, corners=True)
    if around.has_hindbrain and not (fluid & near_hindbrain).any():
        return touching
    tissue = around.cerebrum & ~fluid
    # rays also pass unlabelled voxels inside: choroid plexus, septum
    clear = fluid | (around.filled & ~tissue)
    hits = _hits(clear, tissue)
    if not around.has_hindbrain:
        share = _smoothed(hits, clear, RAY_SMOOTHING, WHOLE)
        return fluid & (share <= ENCLOSED)

    # not beyond the volume
    elsewhere = np.pad(
        ~(hindbrain | around.cerebrum)[INNER],
        1,
    )
    # smoothing takes long: only around the hindbrain, as far as its parts go
    margin = 0
    is_cut = True
    while is_cut:
        margin += 8
        box = box_of(fluid & near_hindbrain, margin)
        share = _smoothed(hits, clear, RAY_SMOOTHING, box)
        out = fluid[box] & (share <= ENCLOSED)
        is_cut = bool(out.sum() > out[INNER].sum())
    for place, part in extraction.parts_in_boxes(out):
        beside = extraction.with_neighbours(part, corners=True)
        n_hindbrain = (beside & hindbrain[box][place]).sum()
        if n_hindbrain > (beside & elsewhere[box][place]).sum():
            touching[box][place] |= part
    return touching


def _unlabelled_ventricles(around: AroundCerebrum) -> Mask:
    """Return the (i, j, k) mask of unlabelled ventricles, without the outer margin;
    empty if any ventricle is labelled.

    More than half of the 26 rays of such a voxel hit tissue inside the cortex, almost
    all if no cortex is labelled. Less than `REPORTED_LOSS` of the cerebrum is roughness
    of the labels.
    """
    scheme = around.scheme
    cerebrum = around.cerebrum
    filled = np.zeros_like(cerebrum)
    size = voxel_size(around.affine)
    margin = int(np.ceil(CLOSING_MM / size.min())) + 2
    # volumes in a far larger unit are reported elsewhere
    if around.fluid.any() or 2 * margin > max(around.shape):
        return filled[INNER]
    box = box_of(cerebrum)
    tissue = np.pad(cerebrum[box], margin)

    # the cerebrum without its openings
    to_tissue = distance_to(tissue, size)
    near = to_tissue <= CLOSING_MM
    to_border = distance_to(~near, size)
    closed = to_border > CLOSING_MM
    inside = extraction.without_holes(closed | tissue)

    hindbrain = np.pad(around.hindbrain[box], margin)
    clear = inside & ~tissue & ~hindbrain
    cortex = np.pad(around.cortex[box], margin)
    inner_tissue = tissue & ~cortex
    hits = _hits(clear, inner_tissue)
    hit_share = _smoothed(hits, clear, 0.5 * RAY_SMOOTHING, WHOLE)
    needed = ENCLOSED if scheme.cortex else ENCLOSED_WITHOUT_CORTEX
    is_enclosed = clear & (hit_share > needed)
    number, _ = number_parts(is_enclosed, OUTSIDE)
    sizes = np.bincount(
        number.ravel(),
        minlength=2,
    )[1:]
    smallest = max(1, MIN_PART_SHARE * sizes.max())
    large = np.flatnonzero(sizes >= smallest) + 1
    enclosed = np.isin(number, large)
    if enclosed.sum() > REPORTED_LOSS * cerebrum.sum():
        without_margin = (slice(margin, -margin),) * 3
        filled[box] = enclosed[without_margin]
    return filled[INNER]


def _hits(clear: Mask, tissue: Mask) -> NDArray[np.float32]:
    """Return the share of the 26 rays from each clear voxel that hit tissue, through
    clear voxels only; the outermost voxels are not clear."""
    share = np.zeros(clear.shape, dtype=np.float32)
    if not clear.any():
        return share
    box = box_of(clear, 1)
    clear = clear[box]
    tissue = tissue[box]
    count = np.zeros(clear.shape, dtype=np.uint8)
    for axis in range(3):
        is_clear = np.moveaxis(clear, axis, 0)
        is_tissue = np.moveaxis(tissue, axis, 0)
        hits = np.moveaxis(count, axis, 0)
        # rays with a step along the axes before this one have been followed
        steps = [(0,)] * axis + [(-1, 0, 1)] * (2 - axis)
        shifts = list(product(*steps))
        forward = range(1, len(hits) - 1)
        for step, order in ((-1, forward), (1, forward[::-1])):
            sees = np.zeros(
                (len(shifts), *hits[0].shape),
                dtype=bool,
            )
            for place in order:
                # the next slice hits tissue, or sees it
                beyond = place + step
                hit = is_clear[beyond] & sees
                hit |= is_tissue[beyond]
                for ray, shift in enumerate(shifts):
                    plane = hit[ray]
                    beside = _shifted(plane, shift)
                    sees[ray][INNER[1:]] = plane[beside]
                hits[place] += sees.sum(
                    axis=0,
                    dtype=np.uint8,
                )
    share[box] = count * clear / np.float32(N_RAYS)
    return share


def _shifted(plane: Mask, shift: tuple[int, ...]) -> Box:
    """Return the part of a plane next to its inner part."""
    sides = []
    for step, size in zip(shift, plane.shape, strict=True):
        sides.append(slice(1 + step, size - 1 + step))
    return tuple(sides)


def _smoothed(
    share: NDArray[np.float32],
    clear: Mask,
    smoothing_voxels: float,
    box: Box,
) -> NDArray[np.float32]:
    """Return, in a box, values of clear voxels smoothed over these voxels."""
    reach = int(GAUSSIAN_REACH * smoothing_voxels) + 1
    wider = []
    for side, size in zip(box, share.shape, strict=True):
        start, stop, _ = side.indices(size)
        wider.append(slice(start, stop + 2 * reach))
    values = np.pad(share, reach)[tuple(wider)]
    is_clear = np.pad(clear, reach)[tuple(wider)]
    smooth = ndimage.gaussian_filter(values, smoothing_voxels)
    weight = extraction.smooth_mask(is_clear, smoothing_voxels)
    inner = (slice(reach, -reach),) * 3
    return (smooth / np.maximum(weight, 1e-6))[inner]


def _border_share(mask: Mask) -> float:
    """Return the share of an (i, j, k) mask's surface at those borders of its volume
    that cut it off.

    The slices of a rounded end grow from the first one on: the second has at least
    twice the area of the first. So a volume that ends exactly at the mask does not cut
    it off (`CUT_SLICE_RATIO`).
    """
    surface = mask & extraction.with_neighbours(~mask)
    at_border = 0
    cut_off = 0
    for axis in range(3):
        slices = np.moveaxis(mask, axis, 0)
        for end in (slices[:2], slices[:-3:-1]):
            first = int(end[0].sum())
            second = int(end[-1].sum())
            at_border += first
            if first > CUT_SLICE_RATIO * second:
                cut_off += first
    return cut_off / max(at_border + int(surface.sum()), 1)


def _listed(numbers: Iterable[int], scheme: LabelScheme | None = None) -> str:
    names = [
        f"{number} {scheme.labels.get(number, '')}".strip() if scheme else str(number)
        for number in numbers
    ]
    text = ", ".join(names[:30])
    return f"{text}, … ({len(names)} in all)" if len(names) > 30 else text


@dataclass(frozen=True, eq=False)
class Layout:
    """The labels of a volume (n,), the numbers of voxel faces that they share (n, n),
    and of their voxels (n,)."""

    labels: Labels
    contact: Floats
    count: NDArray[np.integer[Any]]


def layout_of(labels: Labels) -> Layout:
    """Return the contacts between the labels of an (i, j, k) volume; 0 is outside."""
    # most of the volume is air around the head
    is_labelled = labels != 0
    if is_labelled.any():
        box = box_of(is_labelled)
        labels, is_labelled = labels[box], is_labelled[box]
    labels = np.pad(labels, 1)
    is_labelled = np.pad(is_labelled, 1)
    is_hole = extraction.without_holes(is_labelled) & ~is_labelled
    labels[is_hole] = HOLE
    numbers = _numbers_in(labels)
    n = len(numbers)
    rows = _ranks(labels, numbers).ravel()
    contact = np.zeros((n, n))
    # the margin touches only itself at the ends of lines
    for stride in (
        1,
        labels.shape[2],
        labels[0].size,
    ):
        voxels = np.flatnonzero(rows[stride:] != rows[:-stride])
        # a pair of labels as one number
        pairs = n * rows[voxels + stride].astype(int)
        pairs += rows[voxels]
        counts = np.bincount(pairs, minlength=n * n)
        contact += counts.reshape(n, n)
    return Layout(
        numbers,
        contact + contact.T,
        np.bincount(rows),
    )


def _numbers_in(labels: Labels) -> Labels:
    """Return the labels of a volume in order, as `np.unique`, which takes several times
    as long."""
    first = labels.min()
    span = int(labels.max()) - int(first)
    if span > labels.size:
        return np.unique(labels)
    counts = np.bincount((labels - first).ravel())
    present = np.flatnonzero(counts)
    return present.astype(labels.dtype) + first


def _ranks(labels: Labels, numbers: Labels) -> NDArray[np.integer[Any]]:
    """Return the place of each voxel's label among all labels of a volume."""
    first = numbers[0]
    last = numbers[-1]
    kind = np.min_scalar_type(len(numbers))
    if int(last) - int(first) > labels.size:
        return np.searchsorted(numbers, labels).astype(kind)
    table = np.searchsorted(
        numbers,
        np.arange(first, last + 1),
    )
    return table.astype(kind)[labels - first]


def scheme_contradictions(layout: Layout, scheme: LabelScheme) -> Iterator[str]:
    """Yield the contradictions between the arrangement of labels and a scheme; none for
    a volume without cortex."""
    tissues = {}
    for name in ("cerebrum", "cortex", "white_matter", "ventricles", "left", "right"):
        tissues[name] = np.isin(
            layout.labels,
            getattr(scheme, name),
        )
    if not tissues["cortex"].any():
        return
    yield from _wrong_shares(layout, tissues)
    yield from _wrong_places(layout, scheme, tissues)
    yield from _wrong_sides(layout, scheme, tissues)


def _with_numbers(
    layout: Layout,
    is_tissue: Mask,
    name: str,
) -> str:
    """Return the name of a tissue with the numbers of its labels."""
    numbers = [str(number) for number in layout.labels[is_tissue]]
    if len(numbers) > 4:
        numbers[4:] = ["…"]
    return f"{name} ({', '.join(numbers)})"


def _tissue_voxels(layout: Layout, tissues: Mapping[str, Mask]) -> int:
    """Return the number of voxels of the cerebrum without ventricles, at least 1."""
    is_tissue = tissues["cerebrum"] & ~tissues["ventricles"]
    return max(
        int(layout.count[is_tissue].sum()),
        1,
    )


def _wrong_shares(layout: Layout, tissues: Mapping[str, Mask]) -> Iterator[str]:
    """Yield tissues that would be too much or too little of the cerebrum or of its
    surface."""
    cerebrum = tissues["cerebrum"]
    cortex = tissues["cortex"]
    outside = ~cerebrum & (layout.labels != HOLE)
    surface = layout.contact[np.ix_(cerebrum, outside)].sum(axis=1)
    cortex_share = float(surface[cortex[cerebrum]].sum() / max(surface.sum(), 1))
    if cortex_share < MIN_CORTEX_OUTSIDE:
        yield (
            f"{_with_numbers(layout, cortex, 'cortex')} would cover {cortex_share:.0%}"
            " of the cerebrum's surface"
        )
    for is_tissue, name, (lowest, highest) in (
        (cortex, "cortex", CORTEX_SHARES),
        (tissues["white_matter"], "white matter", WHITE_SHARES),
    ):
        share = float(layout.count[is_tissue].sum() / _tissue_voxels(layout, tissues))
        if is_tissue.any() and not lowest <= share <= highest:
            yield (
                f"{_with_numbers(layout, is_tissue, name)} would be {share:.0%} of the"
                " cerebrum's tissue"
            )


def _wrong_places(
    layout: Layout,
    scheme: LabelScheme,
    tissues: Mapping[str, Mask],
) -> Iterator[str]:
    """Yield inner tissues that would lie outside, and other labels that would lie
    inside."""
    cerebrum = tissues["cerebrum"]
    within_cortex = cerebrum & ~tissues["cortex"]
    for is_tissue, name, around in (
        (tissues["white_matter"], "white matter", cerebrum),
        (tissues["ventricles"], "ventricles", within_cortex),
    ):
        share = _contact_share(layout, is_tissue, around)
        if is_tissue.any() and share < MIN_SHARE_INSIDE:
            yield (
                f"{_with_numbers(layout, is_tissue, name)} would lie outside:"
                f" {share:.0%} of their neighbours are inside"
            )
    smallest = SMALL_SHARE * _tissue_voxels(layout, tissues)
    is_other = ~cerebrum & ~np.isin(
        layout.labels,
        (HOLE, 0),
    )
    for number in layout.labels[is_other]:
        is_tissue = layout.labels == number
        share = _contact_share(layout, is_tissue, within_cortex)
        if share > MAX_SHARE_INSIDE and layout.count[is_tissue].sum() > smallest:
            name = scheme.labels.get(int(number), "")
            yield (
                f"{_with_numbers(layout, is_tissue, name)} would lie inside:"
                f" {share:.0%} of its neighbours are there"
            )


def _contact_share(
    layout: Layout,
    is_tissue: Mask,
    neighbours: Mask,
) -> float:
    """Return the share of the contacts of a tissue that are with some neighbours."""
    is_other = (layout.labels != HOLE) & ~is_tissue
    contacts = layout.contact[is_tissue].sum(axis=0) * is_other
    return float(contacts[neighbours].sum() / max(contacts.sum(), 1))


def _wrong_sides(
    layout: Layout,
    scheme: LabelScheme,
    tissues: Mapping[str, Mask],
) -> Iterator[str]:
    """Yield sides that would be mixed, or have unequal parts of cortex and white
    matter."""
    left = tissues["left"]
    right = tissues["right"]
    # of both sides: what touches the other one, too
    between = 2 * layout.contact[np.ix_(left, right)].sum()
    contacts = layout.contact[np.ix_(left | right, tissues["cerebrum"])].sum()
    if between > MAX_BETWEEN * contacts:
        yield (
            f"left and right would be mixed: {between / contacts:.0%} of their contacts"
            " are with the other side"
        )
    if not scheme.left or not scheme.white_matter:
        return

    left_cortex, right_cortex, left_white, right_white = (
        int(layout.count[tissues[tissue] & side].sum())
        for tissue in ("cortex", "white_matter")
        for side in (left, right)
    )
    # a hemisphere may be small or missing, but with all of its tissues
    is_incomplete = (left_cortex > 0) != (left_white > 0) or (
        (right_cortex > 0) != (right_white > 0)
    )
    products = sorted((left_cortex * right_white, right_cortex * left_white))
    if is_incomplete or products[1] > MAX_IMBALANCE * products[0]:
        yield (
            f"left and right would have {left_cortex} and {right_cortex} voxels of"
            f" cortex, {left_white} and {right_white} of white matter"
        )
