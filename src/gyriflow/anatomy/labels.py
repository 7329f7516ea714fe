"""Label volumes read by their scheme: where the cerebrum is, what of it is tissue, and whether left is left."""

import logging
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..errors import InputError
from ..settings.schemes import SCHEME_FILES, LabelScheme
from ..units import ML_PER_MM3
from .extraction import (
    COMPARABLE,
    OUTSIDE,
    PAD_VOXELS,
    Floats,
    Mask,
    crop,
    main_parts,
    parts_in_boxes,
    shifted_affine,
    smooth_mask,
    without_stalks,
)

log = logging.getLogger(__name__)

Labels = NDArray[np.integer[Any]]

# brains of the example atlas have cortex at 86 % of their surface and more, read by wrong schemes at 48 % and less
MIN_CORTEX_OUTSIDE = 0.5
# pairs of voxels of both hemispheres lie side by side as their labels say in nearly all brains
LEAST_PARTED = 0.9
# cortex at less than this fraction of the cerebrum's surface is reported
LITTLE_CORTEX = 0.7
# a loss beyond this fraction of a brain is reported
REPORTED_LOSS = 0.005
# the directions in which a voxel of fluid looks for tissue: to the faces, edges and corners of its cell
DIRECTIONS = np.array([d for d in np.ndindex(3, 3, 3) if d != (1, 1, 1)]) - 1
# fluid belongs to the cerebrum where it sees the cerebrum's tissue in more than this part of the directions
ENCLOSED = 0.5
# ventricles without labels look on it in more of them where no cortex is labelled, on which fissures look
WHOLLY = 0.93
# the border between what is enclosed and what is not is smoothed over this many voxels
SMOOTHING = 2.0
# parts of what is enclosed below this share of the largest are crumbs
CRUMB = 0.02
# the smaller hemisphere, of the larger one's volume, where labels say which side is which
SMALLEST_HEMISPHERE = 0.04
# ventricles without labels are looked for in what a closing with a ball of this radius adds to the tissue
CLOSING_MM = 6.0


@dataclass(frozen=True, eq=False)
class Cerebrum:
    """What of a label volume is the cerebrum, cut to that with a margin of `PAD_VOXELS`.

    `mask` (i, j, k) is where it is, `tissue` are the labels, with 0 in what of the cerebrum's labels is no part of it;
    the (4, 4) affine is that of the cut volume. Parts below `smallest_part` of the largest are none of it: where labels
    say which side is which, a hemisphere may be far smaller than the other one. The report has volumes and what was
    left out, in plain values for JSON.
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


def read_cerebrum(labels: Labels, affine: Floats, scheme: LabelScheme, least_cortex: float = 0.0) -> Cerebrum:
    """Return the cerebrum without ventricles that its tissue does not enclose, what hangs on it by thin stalks, and
    parts apart from it. Holes in it and ventricles without labels get the label of the nearest tissue.

    InputError where the labels are not the scheme's, and where cortex is at less than `least_cortex` of the cerebrum's
    surface.
    """
    mask = cerebrum_mask(labels, scheme)
    report: dict[str, Any] = {}
    warnings = []
    lacked = np.setdiff1d(scheme.cerebrum, labels)
    if missing := [f"{number} {scheme.labels[number]}" for number in scheme.cerebrum if number in lacked]:
        report["missing_tissues"] = missing
        log.info("tissues that this brain does not have: %s", ", ".join(missing[:20]))
    voxel_ml = float(abs(np.linalg.det(affine[:3, :3]))) * ML_PER_MM3
    unlabelled = unlabelled_ventricles(labels, scheme, affine)
    if scheme.cortex and (share := require_cortex_outside(labels, scheme, least_cortex, unlabelled)) < LITTLE_CORTEX:
        warnings.append(f"cortex lies at only {100 * share:.0f} % of the cerebrum's surface: check the labels")
    if unlabelled.any():
        warnings.append(
            f"{unlabelled.sum() * voxel_ml:.2f} mL without a label of the cerebrum lie inside it and were filled: "
            "ventricles without a label?"
        )
    open_fluid = outside_ventricles(labels, scheme)
    whole, stalks = without_stalks((mask & ~open_fluid) | unlabelled, affine)
    smallest = SMALLEST_HEMISPHERE if scheme.left and scheme.right else COMPARABLE
    kept, parts, apart = main_parts(whole, smallest)
    if apart > REPORTED_LOSS * kept.sum():
        lost_parts = f"{apart * voxel_ml:.2f} mL, {100 * apart / kept.sum():.1f} % of it"
        warnings.append(f"{parts} parts apart from the brain were dropped: {lost_parts}")
    tissue = np.where(mask & ~kept, 0, labels)
    outer, holes = np.isin(tissue, scheme.cortex), kept & ~mask
    for empty, named in ((holes, mask & kept), (holes & unlabelled, mask & kept & ~outer)):
        if empty.any():
            nearest = ndimage.distance_transform_edt(~named, return_distances=False, return_indices=True)
            tissue[empty] = labels[tuple(nearest[:, empty])]
    fluid_ml = float(open_fluid.sum() * voxel_ml)
    apart_ml = {"parts": parts, "parts_mL": float(apart * voxel_ml)}
    report["outside"] = {"ventricles_mL": fluid_ml, "stalks": stalks, **apart_ml}
    lost = fluid_ml + sum(stalk["volume_mm3"] for stalk in stalks) * ML_PER_MM3
    if lost > REPORTED_LOSS * mask.sum() * voxel_ml:
        warnings.append(f"{lost:.2f} mL of the cerebrum's labels lie outside it or hang on a thin stalk: left out")
    fluid = kept & (np.isin(labels, scheme.ventricles) | unlabelled)
    volumes = {"cerebrum": kept}
    if scheme.cortex:
        volumes |= {"cortex": outer, "inside_cortex": kept & ~fluid & ~outer}
    if scheme.ventricles or unlabelled.any():
        volumes |= {"tissue": kept & ~fluid, "ventricles": fluid}
    report["label_volumes_mL"] = {name: float(voxels.sum() * voxel_ml) for name, voxels in volumes.items()}
    report["border_share"] = border_share(kept)
    box, first = crop(kept)
    cut, labelled = np.pad(kept[box], PAD_VOXELS), np.pad(tissue[box], PAD_VOXELS)
    return Cerebrum(cut, labelled, shifted_affine(affine, first), smallest, report, warnings)


def cerebrum_mask(labels: Labels, scheme: LabelScheme) -> Mask:
    """Return where the (i, j, k) labels belong to the cerebrum.

    InputError where the volume has labels that the scheme does not know, or lacks all labels of the cerebrum, of the
    cortex or of the white matter (where the scheme has these; without white matter, of all that is inside the cortex).
    """
    present = set(map(int, np.unique(labels))) - {0}
    unknown = sorted(present - set(scheme.labels))
    if unknown:
        raise InputError(
            f"the label volume has labels that the scheme {scheme.name!r} does not know",
            found=f"{_listed(unknown)} among {_listed(sorted(present))}",
            expected=_listed(scheme.labels, scheme),
            remedy=f"Choose another scheme ({', '.join(SCHEME_FILES)}), or write one under schemes. Is this an "
            "image? gyriflow does not segment.",
        )
    if not present & set(scheme.cerebrum):
        raise InputError(
            "no voxel belongs to the cerebrum",
            found=f"labels {_listed(sorted(present)) or 'none but 0'}",
            expected="voxels of " + _listed(scheme.cerebrum, scheme),
        )
    inside = scheme.white_matter or tuple(set(scheme.cerebrum) - set(scheme.cortex) if scheme.cortex else ())
    for tissue, numbers in (("cortex", scheme.cortex), ("white matter", inside)):
        if numbers and not present & set(numbers):
            raise InputError(
                f"the {tissue} of the scheme {scheme.name!r} is missing from the label volume",
                found=f"labels {_listed(sorted(present))}",
                expected="voxels of " + _listed(numbers, scheme),
            )
    return np.isin(labels, scheme.cerebrum)


def require_cortex_outside(
    labels: Labels, scheme: LabelScheme, least: float = MIN_CORTEX_OUTSIDE, unlabelled: Mask | bool = False
) -> float:
    """Return how much of the cerebrum's surface has cortex at it, from 0 to 1; of it and its `unlabelled` ventricles.

    InputError where it is less than `least`: the scheme is another volume's, whose labels happen to be known.
    """
    cerebrum = ndimage.binary_fill_holes(np.pad(np.isin(labels, scheme.cerebrum) | unlabelled, 1))
    outside = cerebrum & ~ndimage.binary_erosion(cerebrum)
    cortex = ndimage.binary_dilation(np.pad(np.isin(labels, scheme.cortex), 1))
    share = float((outside & cortex).sum() / outside.sum())
    if share < least:
        raise InputError(
            f"what the scheme {scheme.name!r} calls cortex does not lie around what it calls the cerebrum",
            found=f"cortex at {100 * share:.0f} % of the surface",
            expected=f"{100 * least:.0f} % or more",
        )
    return share


def require_sides(labels: Labels, scheme: LabelScheme, affine: Floats, to_right: Floats) -> None:
    """Raise InputError where labels of the left hemisphere lie to the right of those of the right one, or among them.

    `to_right` (3,) is the direction from left to right in the coordinates that the (4, 4) affine leads to.
    """
    if not (np.isin(labels, scheme.left).any() and np.isin(labels, scheme.right).any()):
        return
    left, right = (
        np.sort(np.argwhere(np.isin(labels, side)) @ (affine[:3, :3].T @ to_right))
        for side in (scheme.left, scheme.right)
    )
    if (apart := float(right.mean() - left.mean())) <= 0:
        raise InputError(
            "labels of the left hemisphere lie on the right",
            found=f"{-apart:.1f} mm to the right of those of the right hemisphere",
            expected="left at the smaller x (RAS+)",
        )
    parted = float(np.searchsorted(left, right).mean() / len(left))
    if parted < LEAST_PARTED:
        raise InputError(
            f"what the scheme {scheme.name!r} calls left and right are no hemispheres",
            found=f"voxels of the right one to the right of those of the left one in {100 * parted:.0f} % of pairs",
            expected=f"{100 * LEAST_PARTED:.0f} % or more",
        )


def outside_ventricles(labels: Labels, scheme: LabelScheme) -> Mask:
    """Return the voxels of the ventricles that the cerebrum's tissue does not enclose, (i, j, k) bool.

    Labels of the ventricles often go on through the aqueduct to the fourth ventricle, between brainstem and
    cerebellum. A voxel of fluid is enclosed where it looks on tissue of the cerebrum in more than half of 26
    directions, through fluid. Where the scheme has cerebellum or brainstem, only what lies at these more than at
    anything else outside is left out: a ventricle that thin tissue leaves open to the outer CSF stays whole.
    """
    fluid = np.isin(labels, scheme.ventricles)
    if not fluid.any():
        return fluid
    tissue = np.isin(labels, scheme.cerebrum) & ~fluid
    # what labels leave empty inside is looked through as well: choroid plexus, septum
    clear = fluid | (ndimage.binary_fill_holes(tissue | fluid) & ~tissue)
    out = fluid & (_seen(clear, tissue, SMOOTHING) <= ENCLOSED)
    return _beside_hindbrain(out, labels, scheme)


def unlabelled_ventricles(labels: Labels, scheme: LabelScheme, affine: Floats) -> Mask:
    """Return the voxels of ventricles that have no label of the cerebrum, (i, j, k) bool; none where some have one.

    Such voxels look on tissue inside the cortex in more than half of 26 directions. Sulci, fissures and cisterns look
    on cortex, or they are open. Where no cortex is labelled, nearly all directions count. Less than `REPORTED_LOSS` of
    the cerebrum is roughness of the labels.
    """
    filled = np.zeros(labels.shape, dtype=bool)
    cerebrum = np.isin(labels, scheme.cerebrum)
    size = np.linalg.norm(affine[:3, :3], axis=0)
    margin = int(np.ceil(CLOSING_MM / size.min())) + 2
    # a far larger unit is reported elsewhere
    if np.isin(labels, scheme.ventricles).any() or 2 * margin > max(labels.shape):
        return filled
    (box,) = ndimage.find_objects(cerebrum.astype(np.uint8))
    numbers, tissue = np.pad(labels[box], margin), np.pad(cerebrum[box], margin)
    near = ndimage.distance_transform_edt(~tissue, sampling=size) <= CLOSING_MM
    closed = ndimage.distance_transform_edt(near, sampling=size) > CLOSING_MM
    hindbrain = np.isin(numbers, (*scheme.cerebellum, *scheme.brainstem))
    clear = ndimage.binary_fill_holes(closed | tissue) & ~tissue & ~hindbrain
    seen = _seen(clear, tissue & ~np.isin(numbers, scheme.cortex), 0.5 * SMOOTHING)
    number, _ = ndimage.label(clear & (seen > (ENCLOSED if scheme.cortex else WHOLLY)), OUTSIDE)
    sizes = np.bincount(number.ravel(), minlength=2)[1:]
    enclosed = np.isin(number, np.flatnonzero(sizes >= max(1, CRUMB * sizes.max())) + 1)
    if enclosed.sum() > REPORTED_LOSS * cerebrum.sum():
        filled[box] = enclosed[(slice(margin, -margin),) * 3]
    return filled


def _beside_hindbrain(out: Mask, labels: Labels, scheme: LabelScheme) -> Mask:
    hindbrain = np.isin(labels, (*scheme.cerebellum, *scheme.brainstem))
    if not hindbrain.any():
        return out
    elsewhere, beside = ~hindbrain & ~np.isin(labels, scheme.cerebrum), np.zeros_like(out)
    for box, part in parts_in_boxes(out):
        around = ndimage.binary_dilation(part, OUTSIDE)
        if (around & hindbrain[box]).sum() > (around & elsewhere[box]).sum():
            beside[box] |= part
    return beside


def _seen(clear: Mask, tissue: Mask, smoothing_voxels: float) -> NDArray[np.float32]:
    pad = np.pad(clear, 1), np.pad(tissue, 1)
    start = np.argwhere(pad[0])
    hits = np.zeros(len(start), dtype=np.int32)
    for direction in DIRECTIONS:
        places, rows = start + direction, np.arange(len(start))
        while len(rows):
            index = tuple(places.T)
            hits[rows[pad[1][index]]] += 1
            on = pad[0][index]
            places, rows = places[on] + direction, rows[on]
    seen = np.zeros(pad[0].shape, dtype=np.float32)
    seen[tuple(start.T)] = hits / len(DIRECTIONS)
    smooth = ndimage.gaussian_filter(seen[1:-1, 1:-1, 1:-1], smoothing_voxels)
    return smooth / np.maximum(smooth_mask(clear, smoothing_voxels), 1e-6)


def border_share(mask: Mask) -> float:
    """Return the part of a mask's surface that is at the border of its volume, beyond which it is cut."""
    surface = mask & ~ndimage.binary_erosion(mask, border_value=1)
    at_border = int(sum(np.moveaxis(mask, axis, 0)[end].sum() for axis in range(3) for end in (0, -1)))
    return at_border / max(at_border + int(surface.sum()), 1)


def _listed(numbers: Iterable[int], scheme: LabelScheme | None = None) -> str:
    names = [f"{number} {scheme.labels[number]}" if scheme else str(number) for number in numbers]
    shown = ", ".join(names[:30])
    return f"{shown}, … ({len(names)} in all)" if len(names) > 30 else shown
