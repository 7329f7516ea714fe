"""Find cortex labels where no cerebral cortex can be: beyond the brain, inside it,
around the ventricles; and other tissue at its surface where cortex has to be."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..geometry.deformations import transform_points, voxel_size
from ..settings.schemes import LabelScheme
from ..units import ML_PER_MM3
from .extraction import (
    INSIDE,
    OUTSIDE,
    Floats,
    Mask,
    dilated,
    shifted_affine,
    without_holes,
)

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
    *,
    is_whole: bool = False,
) -> Iterator[str]:
    """Yield a warning, with volume (mL) and place, for each kind of place where cortex
    cannot be, and for a whole cerebrum whose surface has too little of it.

    `labels` (i, j, k) have a (4, 4) affine to the coordinates in mm of places in
    messages. Nothing is yielded for a volume without cortex, or with nothing else.
    """
    around = _cropped(labels, affine, scheme)
    if around is None:
        return
    cortex = around.cortex
    fluid = np.isin(around.labels, scheme.ventricles)
    core = around.cerebrum & ~cortex & ~fluid
    outside = ~without_holes(around.cerebrum)
    enclosed = _cortex_not_touching(outside, cortex)
    is_far = cortex & ~_is_near(around, core, MAX_FROM_CORE_MM)
    detached = is_far | _cortex_not_touching(core, cortex)
    found = _pieces_in_words(detached & ~enclosed, around.affine)
    if found:
        limit = (
            "apart from the tissue inside the cortex, or further than"
            f" {MAX_FROM_CORE_MM:g} mm from it"
        )
        yield f"{found} of cortex lie {limit}: {_suspect(labels, scheme)}"

    found = _pieces_in_words(enclosed, around.affine)
    if found:
        yield (
            f"{found} of cortex lie inside the cerebrum, apart from its surface: is"
            " other tissue labelled as cortex?"
        )

    next_to_fluid = ndimage.binary_dilation(fluid, INSIDE) & ~fluid
    at_ventricles = next_to_fluid & around.cerebrum
    is_cortex = at_ventricles & cortex & ~enclosed
    share = is_cortex.sum() / max(at_ventricles.sum(), 1)
    if share > MAX_AT_VENTRICLES:
        found = (
            f"cortex lies at {100 * share:.0f} % of the ventricles' surface,"
            " at most 3 % in atlases"
        )
        yield f"{found}: is tissue around or in the ventricles labelled as cortex?"
    # the wall of a hemisphere that is alone may have no cortex
    if is_whole:
        yield from _bare_surface(around, scheme)


@dataclass(frozen=True, eq=False)
class _Cropped:
    """A volume of labels around its cerebrum, with a margin of one voxel: voxels at the
    border of a volume would have no neighbours outside.

    `is_inner` is False in the margin and at the border of the whole volume.
    """

    labels: np.ndarray
    affine: Floats
    cerebrum: Mask
    cortex: Mask
    is_inner: Mask


def _is_near(around: _Cropped, mask: Mask, distance_mm: float) -> Mask:
    """Return the mask of the voxels within a distance of a mask."""
    return dilated(mask, distance_mm, voxel_size(around.affine))


def _cropped(
    labels: np.ndarray,
    affine: Floats,
    scheme: LabelScheme,
) -> _Cropped | None:
    """Return the labels around the cerebrum; None without cortex, or with nothing
    else."""
    padded = np.pad(labels, 1)
    cerebrum = np.isin(padded, scheme.cerebrum)
    cortex = np.isin(padded, scheme.cortex)
    if not cortex.any() or cortex.sum() == cerebrum.sum():
        return None
    (box,) = ndimage.find_objects(cerebrum.astype(np.uint8))
    around = tuple(
        slice(
            side.start - 1,
            side.stop + 1,
        )
        for side in box
    )
    first = np.array([side.start - 1 for side in around])
    is_inner = np.zeros(padded.shape, dtype=bool)
    is_inner[2:-2, 2:-2, 2:-2] = True
    return _Cropped(
        padded[around],
        shifted_affine(affine, first),
        cerebrum[around],
        cortex[around],
        is_inner[around],
    )


def _bare_surface(around: _Cropped, scheme: LabelScheme) -> Iterator[str]:
    """Yield a warning, with place and labels, if much of a whole cerebrum's surface is
    far from cortex.

    Ventricles that are open, and what the border of the volume cuts, do not count.
    """
    filled = without_holes(around.cerebrum)
    surface = filled & ~ndimage.binary_erosion(filled)
    is_fluid = np.isin(around.labels, scheme.ventricles)
    is_far = ~_is_near(around, around.cortex, MAX_TO_CORTEX_MM)
    is_bare = surface & around.is_inner & ~is_fluid & is_far
    share = is_bare.sum() / surface.sum()
    if share > MAX_BARE_SHARE:
        piece, _ = ndimage.label(is_bare, OUTSIDE)
        largest = np.bincount(piece[is_bare]).argmax()
        place = _place_in_words(np.argwhere(piece == largest), around.affine)
        found = []
        for number in np.unique(around.labels[is_bare]):
            name = scheme.labels.get(int(number), "")
            found.append(f"{number} {name}".strip())
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
    voxel_mm3 = abs(np.linalg.det(affine[:3, :3]))
    number, _ = ndimage.label(mask, OUTSIDE)
    counts = np.bincount(number.ravel())
    volumes_ml = counts * (float(voxel_mm3) * ML_PER_MM3)
    volumes_ml[0] = 0.0
    pieces_ml = volumes_ml[volumes_ml >= MIN_PIECE_ML]
    if not len(pieces_ml):
        return ""
    largest = np.argwhere(number == volumes_ml.argmax())
    return f"{pieces_ml.sum():.2f} mL around {_place_in_words(largest, affine)}"


def _place_in_words(voxels: np.ndarray, affine: Floats) -> str:
    """Return the centre in mm of (n, 3) voxels."""
    place = transform_points(
        voxels.mean(axis=0, keepdims=True),
        affine,
    )[0]
    return f"({', '.join(str(round(x)) for x in place)}) mm"
