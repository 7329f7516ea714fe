"""Label volumes read by their scheme: where the cerebrum is, and whether left is left."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..errors import InputError
from ..parameters.schemes import SCHEMES, LabelScheme

# brains of the example atlas have cortex at 86 % of their surface and more, read by wrong schemes at 48 % and less
LEAST_CORTEX_OUTSIDE = 0.5


def cerebrum_mask(labels: NDArray[np.integer], scheme: LabelScheme) -> NDArray[np.bool_]:
    """Returns where the (i, j, k) labels belong to the cerebrum.

    InputError where the volume has labels that the scheme does not know, or lacks all labels of the cerebrum, of the
    cortex or of the white matter (where the scheme has these; without white matter, of all that is inside the cortex).
    """
    present = set(np.unique(labels).tolist()) - {0}
    unknown = sorted(present - set(scheme.labels))
    if unknown:
        raise InputError(
            f"the label volume has labels that the scheme {scheme.name!r} does not know",
            found=f"{_listed(unknown)} among {_listed(sorted(present))}",
            expected=_named(scheme.labels, scheme),
            remedy=f"Choose another scheme ({', '.join(sorted(SCHEMES))}), or write one under schemes. Is this an "
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


def missing_tissues(labels: NDArray[np.integer], scheme: LabelScheme) -> list[str]:
    """Returns the tissues of the cerebrum, such as "8 corpus callosum", that a label volume does not have."""
    present = set(np.unique(labels).tolist())
    return [f"{number} {scheme.labels[number]}" for number in scheme.cerebrum if number not in present]


def require_cortex_outside(
    labels: NDArray[np.integer], scheme: LabelScheme, least: float = LEAST_CORTEX_OUTSIDE
) -> float:
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


def require_sides(
    labels: NDArray[np.integer], scheme: LabelScheme, affine: NDArray[np.float64], to_right: NDArray[np.float64]
) -> None:
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


def _named(numbers: Iterable[int], scheme: LabelScheme) -> str:
    chosen = list(numbers)
    shown = ", ".join(f"{number} {scheme.labels[number]}" for number in chosen[:30])
    return f"{shown}, … ({len(chosen)} in all)" if len(chosen) > 30 else shown


def _listed(numbers: list[int]) -> str:
    shown = ", ".join(map(str, numbers[:20]))
    return f"{shown}, … ({len(numbers)} in all)" if len(numbers) > 20 else shown
