"""Label volumes read by their scheme: where the cerebrum is, what of it is tissue, and whether left is left."""

import logging
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..errors import InputError
from ..parameters.schemes import SCHEME_FILES, LabelScheme
from ..units import ML_PER_MM3
from .extraction import Floats, Mask, without_stalks

log = logging.getLogger(__name__)

Labels = NDArray[np.integer[Any]]

# brains of the example atlas have cortex at 86 % of their surface and more, read by wrong schemes at 48 % and less
LEAST_CORTEX_OUTSIDE = 0.5
# cortex at less than this fraction of the cerebrum's surface is reported
LITTLE_CORTEX = 0.7
# a loss beyond this fraction of a brain is reported
TOLD_LOSS = 0.005
# the directions in which a voxel of fluid looks for tissue: to the faces, edges and corners of its cell
DIRECTIONS = np.array([d for d in np.ndindex(3, 3, 3) if d != (1, 1, 1)]) - 1
# fluid belongs to the cerebrum where it sees the cerebrum's tissue in more than this part of the directions
ENCLOSED = 0.5
# the border between what is enclosed and what is not is smoothed over this many voxels
SMOOTHING = 2.0
# parts of the fluid below this share of the largest are crumbs
CRUMB = 0.02
EVERY_NEIGHBOUR = np.ones((3, 3, 3), dtype=bool)


@dataclass(frozen=True, eq=False)
class Cerebrum:
    """What of a label volume is the cerebrum.

    `tissue` (i, j, k) are the labels, with 0 in what of the cerebrum's labels is no part of it; the report has volumes
    and what was left out, in plain values for JSON.
    """

    tissue: Labels
    report: dict[str, Any]
    warnings: list[str]


def read_cerebrum(labels: Labels, affine: Floats, scheme: LabelScheme, least_cortex: float = 0.0) -> Cerebrum:
    """Returns the cerebrum without ventricles that its tissue does not enclose, and what hangs on it by thin stalks.

    InputError where the labels are not the scheme's, and where cortex is at less than `least_cortex` of the cerebrum's
    surface.
    """
    mask = cerebrum_mask(labels, scheme)
    report: dict[str, Any] = {}
    warnings = []
    if missing := missing_tissues(labels, scheme):
        report["missing_tissues"] = missing
        log.info("tissues that this brain does not have: %s", ", ".join(missing[:20]))
    if scheme.cortex and (share := require_cortex_outside(labels, scheme, least_cortex)) < LITTLE_CORTEX:
        warnings.append(f"cortex lies at only {100 * share:.0f} % of the cerebrum's surface: check the labels")
    voxel_ml = float(abs(np.linalg.det(affine[:3, :3]))) * ML_PER_MM3
    open_fluid = outside_ventricles(labels, scheme)
    kept, stalks = without_stalks(mask & ~open_fluid, affine)
    tissue = np.where(mask & ~kept, 0, labels)
    report["outside"] = {"ventricles_mL": float(open_fluid.sum() * voxel_ml), "stalks": stalks}
    lost = report["outside"]["ventricles_mL"] + sum(stalk["volume_mm3"] for stalk in stalks) * ML_PER_MM3
    if lost > 0:
        said = f"{lost:.2f} mL of the cerebrum's labels lie outside it or hang on a thin stalk: left out"
        if lost > TOLD_LOSS * mask.sum() * voxel_ml:
            warnings.append(said)
        else:
            log.info(said)
    fluid, cortex = np.isin(tissue, scheme.ventricles), np.isin(tissue, scheme.cortex)
    volumes = {"cerebrum": kept}
    if scheme.cortex:
        volumes |= {"cortex": cortex, "inside_cortex": kept & ~fluid & ~cortex}
    if scheme.ventricles:
        volumes |= {"tissue": kept & ~fluid, "ventricles": fluid}
    report["label_volumes_mL"] = {name: float(voxels.sum() * voxel_ml) for name, voxels in volumes.items()}
    return Cerebrum(tissue, report, warnings)


def cerebrum_mask(labels: Labels, scheme: LabelScheme) -> Mask:
    """Returns where the (i, j, k) labels belong to the cerebrum.

    InputError where the volume has labels that the scheme does not know, or lacks all labels of the cerebrum, of the
    cortex or of the white matter (where the scheme has these; without white matter, of all that is inside the cortex).
    """
    present = set(map(int, np.unique(labels))) - {0}
    unknown = sorted(present - set(scheme.labels))
    if unknown:
        raise InputError(
            f"the label volume has labels that the scheme {scheme.name!r} does not know",
            found=f"{_listed(unknown)} among {_listed(sorted(present))}",
            expected=_named(scheme.labels, scheme),
            remedy=f"Choose another scheme ({', '.join(SCHEME_FILES)}), or write one under schemes. Is this an "
            "image? gyriflow does not segment.",
        )
    if not present & set(scheme.cerebrum):
        raise InputError(
            "no voxel belongs to the cerebrum",
            found=f"labels {_listed(sorted(present)) or 'none but 0'}",
            expected="voxels of " + _named(scheme.cerebrum, scheme),
            remedy="Check that this is the label volume and the scheme is its own.",
        )
    inside = scheme.white_matter or tuple(set(scheme.cerebrum) - set(scheme.cortex) if scheme.cortex else ())
    for tissue, numbers in (("cortex", scheme.cortex), ("white matter", inside)):
        if numbers and not present & set(numbers):
            raise InputError(
                f"the {tissue} of the scheme {scheme.name!r} is missing from the label volume",
                found=f"labels {_listed(sorted(present))}",
                expected="voxels of " + _named(numbers, scheme),
                remedy="Choose the scheme of this volume.",
            )
    return np.isin(labels, scheme.cerebrum)


def missing_tissues(labels: Labels, scheme: LabelScheme) -> list[str]:
    """Returns the tissues of the cerebrum, such as "8 corpus callosum", that a label volume does not have."""
    present = set(map(int, np.unique(labels)))
    return [f"{number} {scheme.labels[number]}" for number in scheme.cerebrum if number not in present]


def require_cortex_outside(labels: Labels, scheme: LabelScheme, least: float = LEAST_CORTEX_OUTSIDE) -> float:
    """Returns how much of the cerebrum's surface has cortex at it, from 0 to 1.

    InputError where it is less than `least`: the scheme is another volume's, whose labels happen to be known.
    """
    cerebrum = np.pad(np.isin(labels, scheme.cerebrum), 1)
    outside = cerebrum & ~ndimage.binary_erosion(cerebrum)
    cortex = ndimage.binary_dilation(np.pad(np.isin(labels, scheme.cortex), 1))
    share = float((outside & cortex).sum() / outside.sum())
    if share < least:
        raise InputError(
            f"what the scheme {scheme.name!r} calls cortex does not lie around what it calls the cerebrum",
            found=f"cortex at {100 * share:.0f} % of the surface",
            expected=f"{100 * least:.0f} % or more",
            remedy="Choose the scheme of this volume.",
        )
    return share


def require_sides(labels: Labels, scheme: LabelScheme, affine: Floats, to_right: Floats) -> None:
    """Raises InputError where labels of the left hemisphere lie to the right of those of the right hemisphere.

    `to_right` (3,) is the direction from left to right in the coordinates that the (4, 4) affine leads to.
    """
    if not (np.isin(labels, scheme.left).any() and np.isin(labels, scheme.right).any()):
        return
    left, right = (
        float(to_right @ affine[:3, :3] @ np.argwhere(np.isin(labels, side)).mean(axis=0))
        for side in (scheme.left, scheme.right)
    )
    if left >= right:
        raise InputError(
            "labels of the left hemisphere lie on the right",
            found=f"{left - right:.1f} mm to the right of those of the right hemisphere",
            expected="left at the smaller x (RAS+)",
            remedy="The volume's affine mirrors the brain, or the scheme's sides are swapped.",
        )


def outside_ventricles(labels: Labels, scheme: LabelScheme) -> Mask:
    """Returns the voxels of the ventricles that the cerebrum's tissue does not enclose, (i, j, k) bool.

    Labels of the ventricles often go on through the aqueduct to the fourth ventricle, between brainstem and
    cerebellum. A voxel of fluid is enclosed where it looks on tissue of the cerebrum in more than half of 26
    directions, through fluid. Where the scheme has cerebellum or brainstem, only what lies at these more than at
    anything else outside is left out: a ventricle that thin tissue leaves open to the outer CSF stays whole.
    """
    fluid = np.isin(labels, scheme.ventricles)
    nothing = np.zeros(labels.shape, dtype=bool)
    if not fluid.any():
        return nothing
    tissue = np.isin(labels, scheme.cerebrum) & ~fluid
    # what labels leave empty inside is looked through as well: choroid plexus, septum
    clear = fluid | (ndimage.binary_fill_holes(tissue | fluid) & ~tissue)
    seen = ndimage.gaussian_filter(_seen(clear, tissue), SMOOTHING) / np.maximum(
        ndimage.gaussian_filter(clear.astype(np.float32), SMOOTHING), 1e-6
    )
    out = fluid & (seen <= ENCLOSED)
    # crumbs that are cut off behind what is left out go with it
    number, count = ndimage.label(fluid & ~out, EVERY_NEIGHBOUR)
    if count:
        sizes = np.bincount(number.ravel())[1:]
        crumbs = np.flatnonzero(sizes < CRUMB * sizes.max()) + 1
        out |= np.isin(number, crumbs) & ndimage.binary_propagation(
            out, EVERY_NEIGHBOUR, mask=out | np.isin(number, crumbs)
        )
    return out & np.isin(*_beside_hindbrain(out, labels, scheme))


def _beside_hindbrain(out: Mask, labels: Labels, scheme: LabelScheme) -> tuple[NDArray[np.int32], list[int]]:
    """Returns the (i, j, k) number of each part of a mask, and the numbers of those at the cerebellum or brainstem."""
    number, count = ndimage.label(out, EVERY_NEIGHBOUR)
    hindbrain = np.isin(labels, (*scheme.cerebellum, *scheme.brainstem))
    if not hindbrain.any():
        return number, list(range(1, count + 1))
    elsewhere = ~hindbrain & ~np.isin(labels, scheme.cerebrum)
    found = []
    for part, box in enumerate(ndimage.find_objects(number), start=1):
        wide = tuple(slice(max(side.start - 1, 0), side.stop + 1) for side in box)
        around = ndimage.binary_dilation(number[wide] == part, EVERY_NEIGHBOUR)
        if (around & hindbrain[wide]).sum() > (around & elsewhere[wide]).sum():
            found.append(part)
    return number, found


def _seen(clear: Mask, tissue: Mask) -> NDArray[np.float32]:
    """Returns in which part of the directions each clear voxel looks on tissue; 0 in other voxels."""
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
    return seen[1:-1, 1:-1, 1:-1]


def border_share(mask: Mask) -> tuple[float, list[str]]:
    """Returns the part of a mask's surface at the border of its volume, beyond which it is cut, and what is told."""
    surface = mask & ~ndimage.binary_erosion(mask, border_value=1)
    ends = [np.moveaxis(mask, axis, 0)[end] for axis in range(3) for end in (0, -1)]
    at_border = int(sum(end.sum() for end in ends))
    share = at_border / max(at_border + int(surface.sum()), 1)
    cut = (
        f"the cerebrum touches the border of the volume with {100 * share:.0f} % of its surface: what "
        "lies beyond is missing, and the surface is flat there"
    )
    return share, [cut] if at_border and share > TOLD_LOSS else []


def _named(numbers: Iterable[int], scheme: LabelScheme) -> str:
    chosen = list(numbers)
    shown = ", ".join(f"{number} {scheme.labels[number]}" for number in chosen[:30])
    return f"{shown}, … ({len(chosen)} in all)" if len(chosen) > 30 else shown


def _listed(numbers: list[int]) -> str:
    shown = ", ".join(map(str, numbers[:20]))
    return f"{shown}, … ({len(numbers)} in all)" if len(numbers) > 20 else shown
