"""Find cortex labels where no cerebral cortex can be: beyond the brain, inside it,
around the ventricles; and other tissue at its surface where cortex has to be."""

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
# at most 0.3 % of the surface of 14 of these volumes is further than this from cortex;
# 1.7 % or more where cerebellum or brainstem have a label of the cerebrum
MAX_TO_CORTEX_MM = 8.0
MAX_BARE_SHARE = 0.01


def misplaced_cortex(
    labels: np.ndarray,
    affine: Floats,
    scheme: LabelScheme,
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


def bare_surface(
    labels: np.ndarray,
    affine: Floats,
    scheme: LabelScheme,
) -> Iterator[str]:
    """Yield a warning, with place and labels, if much of a whole cerebrum's surface is
    far from cortex.

    Ventricles that are open, and what the border of the volume cuts, do not count. The
    (4, 4) affine leads from voxels (i, j, k) to the mm of the place.
    """
    cerebrum = np.pad(np.isin(labels, scheme.cerebrum), 1)
    cortex = np.pad(np.isin(labels, scheme.cortex), 1)
    if not cortex.any() or cortex.sum() == cerebrum.sum():
        return
    box = ndimage.find_objects(cerebrum.astype(np.uint8))[0]
    around = tuple(slice(side.start - 1, side.stop + 1) for side in box)
    first = np.array([side.start - 1 for side in around])
    filled = ndimage.binary_fill_holes(cerebrum[around])
    surface = filled & ~ndimage.binary_erosion(filled)

    size = np.linalg.norm(affine[:3, :3], axis=0)
    to_cortex_mm = ndimage.distance_transform_edt(~cortex[around], sampling=size)
    is_inner = np.zeros(cortex.shape, dtype=bool)
    is_inner[2:-2, 2:-2, 2:-2] = True
    numbers = np.pad(labels, 1)[around]
    is_counted = is_inner[around] & ~np.isin(numbers, scheme.ventricles)
    is_bare = surface & is_counted & (to_cortex_mm > MAX_TO_CORTEX_MM)
    share = is_bare.sum() / surface.sum()
    if share > MAX_BARE_SHARE:
        piece, _ = ndimage.label(is_bare, OUTSIDE)
        largest = np.argwhere(piece == np.bincount(piece[is_bare]).argmax())
        place = _place_in_words(largest, shifted_affine(affine, first))
        found = []
        for number in np.unique(numbers[is_bare]):
            found.append(f"{number} {scheme.labels.get(int(number), '')}".strip())
        yield (
            f"{100 * share:.1f} % of the cerebrum's surface, most of it around"
            f" {place}, lie more than {MAX_TO_CORTEX_MM:g} mm from cortex, at most"
            f" 0.3 % in atlases; found {', '.join(found)} there: is cortex not"
            " labelled, or is other tissue, such as the cerebellum, labelled as this?"
        )


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
    return f"{pieces_ml.sum():.2f} mL around {_place_in_words(largest, affine)}"


def _place_in_words(voxels: np.ndarray, affine: Floats) -> str:
    """Return the centre in mm of (n, 3) voxels."""
    place = transform_points(voxels.mean(axis=0, keepdims=True), affine)[0]
    return f"({', '.join(f'{x:.0f}' for x in place)}) mm"
