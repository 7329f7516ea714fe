"""Label volumes read by their scheme: where the cerebrum is, and whether left is left."""

import numpy as np
from numpy.typing import NDArray

from gyriflow.errors import InputError
from gyriflow.parameters.schemes import SCHEMES, LabelScheme


def cerebrum_mask(labels: NDArray[np.integer], scheme: LabelScheme) -> NDArray[np.bool_]:
    """Returns where the (i, j, k) labels belong to the cerebrum.

    InputError names the labels that the scheme does not know and the tissues of the cerebrum that are missing.
    """
    present = set(np.unique(labels).tolist()) - {0}
    known = ", ".join(f"{number} {tissue}" for number, tissue in scheme.labels.items())
    unknown = sorted(present - set(scheme.labels))
    if unknown:
        raise InputError(
            f"the label volume has labels that the scheme {scheme.name!r} does not know",
            found=f"{_listed(unknown)} among {_listed(sorted(present))}",
            expected=known,
            remedy=f"Choose another scheme ({', '.join(sorted(SCHEMES))}), or write one under schemes. Is this an "
            "image? gyriflow does not segment.",
        )
    if not present & set(scheme.cerebrum):
        raise InputError(
            "no voxel belongs to the cerebrum",
            found=f"labels {_listed(sorted(present)) or 'none but 0'}",
            expected="voxels of " + ", ".join(f"{n} {scheme.labels[n]}" for n in scheme.cerebrum),
            remedy="Check that this is the label volume and the scheme is its own.",
        )
    missing = [number for number in scheme.cerebrum if number not in present]
    if missing:
        raise InputError(
            f"tissues of the scheme {scheme.name!r} are missing from the label volume",
            found=f"labels {_listed(sorted(present))}",
            expected="also " + ", ".join(f"{number} {scheme.labels[number]}" for number in missing),
            remedy="Choose the scheme of this volume.",
        )
    return np.isin(labels, scheme.cerebrum)


def require_sides(
    labels: NDArray[np.integer], scheme: LabelScheme, affine: NDArray[np.float64], to_right: NDArray[np.float64]
) -> None:
    """Raises InputError where labels of the left hemisphere lie to the right of those of the right hemisphere.

    `to_right` (3,) is the direction from left to right in the coordinates that the (4, 4) affine leads to.
    """
    if not scheme.left:
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


def _listed(numbers: list[int]) -> str:
    shown = ", ".join(map(str, numbers[:20]))
    return f"{shown}, … ({len(numbers)} in all)" if len(numbers) > 20 else shown
