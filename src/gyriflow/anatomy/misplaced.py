"""Find cortex labels where no cerebral cortex can be: beyond the brain, inside it,
around the ventricles."""

from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from ..geometry.deformations import transform_points
from ..settings.schemes import LabelScheme
from ..units import ML_PER_MM3
from .extraction import INSIDE, OUTSIDE, Floats, Mask, shifted_affine

# Limits are from 47 label volumes of three atlases, 21 to 38 GW
# (`benchmarks/misplaced_cortex.py`). no cortex lies further from the tissue inside it;
# also not where labels fuse the banks of sulci
MAX_FROM_CORE_MM = 6.0
# smaller pieces are strays of a segmentation that do not change a measure
MIN_PIECE_ML = 0.05
# share of the ventricles' surface that may be cortex: 3.3 % or less in these volumes,
# 58 % or more with a faulty layer
MAX_AT_VENTRICLES = 0.05


def misplaced_cortex(
    labels: np.ndarray, affine: Floats, scheme: LabelScheme
) -> Iterator[str]:
    """Yield a warning, with volume (mL) and place, for each kind of place where cortex
    cannot be.

    `labels` (i, j, k) have a (4, 4) affine to the coordinates in mm of places in
    messages. Nothing is yielded for a volume without cortex, or with nothing else.
    """
    cerebrum = np.isin(labels, scheme.cerebrum)
    cortex = np.isin(labels, scheme.cortex)
    if not cortex.any() or cortex.sum() == cerebrum.sum():
        return
    box = ndimage.find_objects(cerebrum.astype(np.uint8))[0]
    # with a margin: voxels at the border of the volume would have no neighbours outside
    first = np.array([side.start - 1 for side in box])
    cropped_labels = np.pad(labels[box], 1)
    cerebrum = np.pad(cerebrum[box], 1)
    cortex = np.pad(cortex[box], 1)
    cropped_affine = shifted_affine(affine, first)
    fluid = np.isin(cropped_labels, scheme.ventricles)

    size = np.linalg.norm(affine[:3, :3], axis=0)
    core = cerebrum & ~cortex & ~fluid
    outside = ~ndimage.binary_fill_holes(cerebrum)
    enclosed = _cortex_not_touching(outside, cortex)
    from_core_mm = ndimage.distance_transform_edt(~core, sampling=size)
    is_far = cortex & (from_core_mm > MAX_FROM_CORE_MM)
    detached = is_far | _cortex_not_touching(core, cortex)
    if found := _pieces_in_words(detached & ~enclosed, cropped_affine):
        limit = (
            "apart from the tissue inside the cortex, or further than"
            f" {MAX_FROM_CORE_MM:g} mm from it"
        )
        yield f"{found} of cortex lie {limit}: {_suspect(labels, scheme)}"

    if found := _pieces_in_words(enclosed, cropped_affine):
        yield (
            f"{found} of cortex lie inside the cerebrum, apart from its surface: is"
            " other tissue labelled as cortex?"
        )

    at_ventricles = ndimage.binary_dilation(fluid, INSIDE) & cerebrum & ~fluid
    share = (at_ventricles & cortex & ~enclosed).sum() / max(at_ventricles.sum(), 1)
    if share > MAX_AT_VENTRICLES:
        found = (
            f"cortex lies at {100 * share:.0f} % of the ventricles' surface,"
            " at most 3 % in atlases"
        )
        yield f"{found}: is tissue around or in the ventricles labelled as cortex?"


def hindbrain_note(labels: np.ndarray, scheme: LabelScheme) -> str:
    """Return a note if the scheme has labels of cerebellum or brainstem and the volume
    has none of these; else ''."""
    missing = _missing_hindbrain(labels, scheme)
    if not missing:
        return ""
    return (
        f"the volume has no {' and no '.join(missing)}: the pose is found without, if"
        " it was not left out on purpose"
    )


def _suspect(labels: np.ndarray, scheme: LabelScheme) -> str:
    missing = _missing_hindbrain(labels, scheme)
    if missing:
        return (
            f"the volume has no label of the {' and the '.join(missing)}: labelled as"
            " cortex?"
        )
    return "is other tissue labelled as cortex there?"


def _missing_hindbrain(labels: np.ndarray, scheme: LabelScheme) -> list[str]:
    tissues = {"cerebellum": scheme.cerebellum, "brainstem": scheme.brainstem}
    return [
        name
        for name, numbers in tissues.items()
        if numbers and not np.isin(labels, numbers).any()
    ]


def _cortex_not_touching(tissue: Mask, cortex: Mask) -> Mask:
    """Return the connected pieces of the cortex that do not touch a tissue."""
    number, _ = ndimage.label(cortex, INSIDE)
    touching = np.unique(number[ndimage.binary_dilation(tissue, INSIDE)])
    return cortex & ~np.isin(number, touching)


def _pieces_in_words(mask: Mask, affine: Floats) -> str:
    """Return the volume of a mask's pieces of at least `MIN_PIECE_ML`, and the place of
    the largest; or ''."""
    voxel_ml = float(abs(np.linalg.det(affine[:3, :3]))) * ML_PER_MM3
    number, _ = ndimage.label(mask, OUTSIDE)
    volumes_ml = np.bincount(number.ravel()) * voxel_ml
    volumes_ml[0] = 0.0
    pieces_ml = volumes_ml[volumes_ml >= MIN_PIECE_ML]
    if not len(pieces_ml):
        return ""
    largest = np.argwhere(number == volumes_ml.argmax())
    place = transform_points(largest.mean(axis=0, keepdims=True), affine)[0]
    return (
        f"{pieces_ml.sum():.2f} mL around ({', '.join(f'{x:.0f}' for x in place)}) mm"
    )
