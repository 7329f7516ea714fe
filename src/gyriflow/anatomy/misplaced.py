"""Find cortex labels where no cerebral cortex can be: beyond the brain, inside it,
around the ventricles; and other tissue at its surface where cortex has to be."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.boxes import box_of
from ..geometry.deformations import transform_points, voxel_size
from ..geometry.voxels import OUTSIDE, number_parts
from ..settings.schemes import LabelScheme
from ..units import ML_PER_MM3
from .extraction import (
    Floats,
    Mask,
    dilated,
    not_touching,
    shifted_affine,
    with_neighbours,
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


@dataclass(frozen=True, eq=False)
class AroundCerebrum:
    """A volume of labels, cropped to the cerebrum and a margin of one voxel, if it has
    that, and one more.

    `shape` is that of the whole volume, `first` the voxel of it with which the cropped
    one begins. The masks are of tissues of the scheme, of the cerebrum with its holes
    `filled`, and of the `surface` of that. The whole volume may have labels of the
    hindbrain, but for the `missing` ones of cerebellum and brainstem.
    """

    shape: tuple[int, ...]
    first: np.ndarray
    labels: np.ndarray
    affine: Floats
    scheme: LabelScheme
    has_hindbrain: bool
    missing: list[str]
    cerebrum: Mask
    cortex: Mask
    fluid: Mask
    hindbrain: Mask
    filled: Mask
    surface: Mask


def around_cerebrum(
    labels: np.ndarray, affine: Floats, scheme: LabelScheme
) -> AroundCerebrum:
    """Return an (i, j, k) volume with a (4, 4) affine around its cerebrum, of which it
    has to have a voxel."""
    box = box_of(_has_label(labels, scheme.cerebrum), 1)
    first = np.array([side.start - 1 for side in box])
    cropped = np.pad(labels[box], 1)
    hindbrain = np.zeros(cropped.shape, dtype=bool)
    has_hindbrain = False
    missing = []
    for name in ("cerebellum", "brainstem"):
        numbers = getattr(scheme, name)
        tissue = _has_label(cropped, numbers)
        hindbrain |= tissue
        # it may lie below the cropped volume
        if tissue.any() or _has_label(labels, numbers).any():
            has_hindbrain = True
        elif numbers:
            missing.append(name)
    cerebrum = _has_label(cropped, scheme.cerebrum)
    filled = without_holes(cerebrum)
    return AroundCerebrum(
        labels.shape,
        first,
        cropped,
        shifted_affine(affine, first),
        scheme,
        has_hindbrain,
        missing,
        cerebrum=cerebrum,
        cortex=_has_label(cropped, scheme.cortex),
        fluid=_has_label(cropped, scheme.ventricles),
        hindbrain=hindbrain,
        filled=filled,
        surface=filled & with_neighbours(~filled),
    )


def _has_label(labels: np.ndarray, numbers: Sequence[int]) -> Mask:
    """Return where a volume has one of some labels, as `np.isin`, which takes several
    times as long."""
    lowest = labels.min(initial=0)
    highest = labels.max(initial=0)
    if lowest < 0 or highest > 255:
        return np.isin(labels, numbers)
    # a table of all bytes
    is_wanted = np.isin(np.arange(256), numbers)
    values = labels.astype(np.uint8)
    found = values.tobytes().translate(is_wanted.tobytes())
    mask = np.frombuffer(found, dtype=bool)
    return mask.reshape(labels.shape)


def misplaced_cortex(
    around: AroundCerebrum,
    *,
    is_whole: bool = False,
) -> Iterator[str]:
    """Yield a warning, with volume (mL) and place, for each kind of place where cortex
    cannot be, and for a whole cerebrum whose surface has too little of it.

    Nothing is yielded for a volume without cortex, or with nothing else.
    """
    cortex = around.cortex
    fluid = around.fluid
    if not cortex.any() or not (around.cerebrum & ~cortex).any():
        return
    core = around.cerebrum & ~cortex & ~fluid
    enclosed = not_touching(cortex, ~around.filled)
    is_far = cortex & ~_is_near(around, core, MAX_FROM_CORE_MM)
    detached = is_far | not_touching(cortex, core)
    found = _pieces_in_words(detached & ~enclosed, around.affine)
    if found:
        limit = (
            "apart from the tissue inside the cortex, or further than"
            f" {MAX_FROM_CORE_MM:g} mm from it"
        )
        yield f"{found} of cortex lie {limit}: {_suspect(around)}"

    found = _pieces_in_words(enclosed, around.affine)
    if found:
        yield (
            f"{found} of cortex lie inside the cerebrum, apart from its surface: is"
            " other tissue labelled as cortex?"
        )

    at_ventricles = with_neighbours(fluid) & ~fluid & around.cerebrum
    is_cortex = at_ventricles & cortex & ~enclosed
    share = is_cortex.sum() / max(
        int(at_ventricles.sum()),
        1,
    )
    if share > MAX_AT_VENTRICLES:
        found = (
            f"cortex lies at {100 * share:.0f} % of the ventricles' surface,"
            " at most 3 % in atlases"
        )
        yield f"{found}: is tissue around or in the ventricles labelled as cortex?"
    # the wall of a hemisphere that is alone may have no cortex
    if is_whole:
        yield from _bare_surface(around)


def _is_near(
    around: AroundCerebrum,
    mask: Mask,
    distance_mm: float,
) -> Mask:
    """Return the mask of the voxels within a distance of a mask."""
    return dilated(mask, distance_mm, voxel_size(around.affine))


def _bare_surface(around: AroundCerebrum) -> Iterator[str]:
    """Yield a warning, with place and labels, if much of a whole cerebrum's surface is
    far from cortex.

    Ventricles that are open, and what the border of the volume cuts, do not count.
    """
    is_inner = np.zeros_like(around.surface)
    is_inner[2:-2, 2:-2, 2:-2] = True
    surface = around.surface
    is_bare = surface & is_inner & ~around.fluid & ~around.cortex
    n_max = MAX_BARE_SHARE * surface.sum()
    if is_bare.sum() <= n_max:
        return
    size = voxel_size(around.affine)
    box = box_of(
        is_bare,
        int(MAX_TO_CORTEX_MM / size.min()) + 1,
    )
    is_bare[box] &= ~_is_near(
        around,
        around.cortex[box],
        MAX_TO_CORTEX_MM,
    )
    if is_bare.sum() > n_max:
        piece, _ = number_parts(is_bare, OUTSIDE)
        largest = np.bincount(piece[is_bare]).argmax()
        place = _place_in_words(np.argwhere(piece == largest), around.affine)
        share = is_bare.sum() / surface.sum()
        found = []
        for number in np.unique(around.labels[is_bare]):
            name = around.scheme.labels.get(int(number), "")
            found.append(f"{number} {name}".strip())
        yield (
            f"{100 * share:.1f} % of the cerebrum's surface, most of it around"
            f" {place}, lie more than {MAX_TO_CORTEX_MM:g} mm from cortex, at most"
            f" 0.3 % in atlases; found {', '.join(found)} there: is cortex not"
            " labelled, or is other tissue, such as the cerebellum, labelled as this?"
        )


def _suspect(around: AroundCerebrum) -> str:
    if around.missing:
        return (
            f"the volume has no label of the {' and the '.join(around.missing)}:"
            " labelled as cortex?"
        )
    return "is other tissue labelled as cortex there?"


def _pieces_in_words(mask: Mask, affine: Floats) -> str:
    """Return the volume of a mask's pieces of at least `MIN_PIECE_ML`, and the place of
    the largest; or ''."""
    voxel_ml = float(abs(np.linalg.det(affine[:3, :3]))) * ML_PER_MM3
    if mask.sum() * voxel_ml < MIN_PIECE_ML:
        return ""
    number, _ = number_parts(mask, OUTSIDE)
    volumes_ml = np.bincount(number.ravel()) * voxel_ml
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
