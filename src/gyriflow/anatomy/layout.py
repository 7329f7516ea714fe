"""Whether labels lie as a scheme says: cortex outside, white matter and fluid inside it, the hindbrain apart."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..settings.schemes import LabelScheme
from .extraction import Floats
from .labels import LEAST_CORTEX_OUTSIDE, Labels

# of what it touches, how much is cerebrum; in 47 brains of three atlases 0.89 or more for white matter and fluid, 0.33
# or less for what is outside
LEAST_INSIDE, MOST_INSIDE = 0.4, 0.5
# of the cerebrum's tissue; in these 0.16 to 0.43 is cortex, 0.49 or more white matter
CORTEX, WHITE, SMALL = (0.03, 0.6), (0.15, 1.0), 0.01
# left to right, the ratio of the sides' cortex over that of their white matter
MOST_UNEQUAL = 4.0
HOLE = -1
"""Stands for voxels without a label that labels enclose, which are neither inside nor outside."""


@dataclass(frozen=True, eq=False)
class Layout:
    """The labels of a volume (n,), how many faces (n, n) they share, and their voxels (n,)."""

    labels: Labels
    contact: Floats
    count: NDArray[np.integer[Any]]


def layout_of(labels: Labels) -> Layout:
    """Return which labels of an (i, j, k) volume touch which; 0 is outside."""
    # the air around the head tells nothing, and is most of the volume
    for box in ndimage.find_objects((labels != 0).astype(np.int8)):
        labels = np.pad(labels[box], 1)
    labels = np.where(ndimage.binary_fill_holes(labels) & (labels == 0), HOLE, labels)
    numbers, rows = np.unique(labels, return_inverse=True)
    rows, n = rows.reshape(labels.shape), len(numbers)
    contact = np.zeros((n, n))
    for axis in range(3):
        along = np.moveaxis(rows, axis, 0)
        contact += np.bincount((along[1:] * n + along[:-1]).ravel(), minlength=n * n).reshape(n, n)
    return Layout(numbers, (contact + contact.T) * ~np.eye(n, dtype=bool), np.bincount(rows.ravel()))


def doubts_of_scheme(layout: Layout, scheme: LabelScheme) -> Iterator[str]:
    """Yield what speaks against a scheme whose labels a volume has; nothing for one that names no cortex."""
    cerebrum, cortex, white, fluid, left, right = (
        np.isin(layout.labels, numbers)
        for numbers in (
            scheme.cerebrum, scheme.cortex, scheme.white_matter, scheme.ventricles, scheme.left, scheme.right
        )
    )  # fmt: skip
    if not cortex.any():
        return
    outside, judged = ~cerebrum & (layout.labels != HOLE), layout.labels != HOLE
    size = max(int(layout.count[cerebrum & ~fluid].sum()), 1)

    def shared(some: NDArray[np.bool], others: NDArray[np.bool]) -> float:
        touched = layout.contact[some].sum(axis=0) * (judged & ~some)
        return float(touched[others].sum() / max(touched.sum(), 1))

    def named(some: NDArray[np.bool], name: str) -> str:
        numbers = [str(number) for number in layout.labels[some]]
        return f"{name} ({', '.join([*numbers[:4], *(['…'] if len(numbers) > 4 else [])])})"

    surface = layout.contact[np.ix_(cerebrum, outside)].sum(axis=1)
    at = float(surface[cortex[cerebrum]].sum() / max(surface.sum(), 1))
    if at < LEAST_CORTEX_OUTSIDE:
        yield f"{named(cortex, 'cortex')} would be at {at:.0%} of the cerebrum's surface"
    for tissue, name, (least, most) in ((cortex, "cortex", CORTEX), (white, "white matter", WHITE)):
        if tissue.any() and not least <= (share := layout.count[tissue].sum() / size) <= most:
            yield f"{named(tissue, name)} would be {share:.0%} of the cerebrum's tissue"
    for tissue, name, within in ((white, "white matter", cerebrum), (fluid, "ventricles", cerebrum & ~cortex)):
        if tissue.any() and (share := shared(tissue, within)) < LEAST_INSIDE:
            yield f"{named(tissue, name)} would lie outside: {share:.0%} of what they touch is inside"
    for number in layout.labels[outside & (layout.labels != 0)]:
        one, name = layout.labels == number, scheme.labels.get(int(number), "")
        if (share := shared(one, cerebrum & ~cortex)) > MOST_INSIDE and layout.count[one].sum() > SMALL * size:
            yield f"{named(one, name)} would lie inside: {share:.0%} of what it touches is there"
    (a, b), (c, d) = ([layout.count[tissue & side].sum() for side in (left, right)] for tissue in (cortex, white))
    # a hemisphere may be small or missing, but with all that is in it
    unequal = (a > 0) != (c > 0) or (b > 0) != (d > 0) or max(a * d, b * c) > MOST_UNEQUAL * min(a * d, b * c)
    if scheme.left and scheme.white_matter and unequal:
        yield f"left and right would have {a} and {b} voxels of cortex, {c} and {d} of white matter"
