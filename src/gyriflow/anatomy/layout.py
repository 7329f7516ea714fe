"""Check the arrangement of labels against a scheme: cortex outside, white matter and fluid inside."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..settings.schemes import LabelScheme
from .extraction import Floats
from .labels import MIN_CORTEX_OUTSIDE, Labels

# share of a tissue's neighbours that are cerebrum; in 47 brains ≥ 0.89 for white matter and fluid, ≤ 0.33 outside
MIN_INSIDE, MAX_OUTSIDE = 0.4, 0.5
# shares of the cerebrum's tissue; in these brains 0.16 to 0.43 is cortex, 0.49 or more white matter
CORTEX, WHITE, SMALL = (0.03, 0.6), (0.15, 1.0), 0.01
# limit of the ratio between left and right of cortex over white matter
MAX_IMBALANCE = 4.0
# share of the contacts of sided labels that are with the other side; 0.11 or less in 15 brains, 0.69 or more if mixed
MAX_BETWEEN = 0.4
HOLE = -1
"""Value for unlabelled voxels enclosed by labels, which are neither inside nor outside."""


@dataclass(frozen=True, eq=False)
class Layout:
    """The labels of a volume (n,), the numbers of voxel faces that they share (n, n), and of their voxels (n,)."""

    labels: Labels
    contact: Floats
    count: NDArray[np.integer[Any]]


def layout_of(labels: Labels) -> Layout:
    """Return the contacts between the labels of an (i, j, k) volume; 0 is outside."""
    # most of the volume is air around the head
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


def scheme_contradictions(layout: Layout, scheme: LabelScheme) -> Iterator[str]:
    """Yield the contradictions between the arrangement of labels and a scheme; none for a scheme without cortex."""
    cerebrum, cortex, white, fluid, left, right = (
        np.isin(layout.labels, getattr(scheme, name))
        for name in ("cerebrum", "cortex", "white_matter", "ventricles", "left", "right")
    )
    if not cortex.any():
        return
    outside, counted = ~cerebrum & (layout.labels != HOLE), layout.labels != HOLE
    size = max(int(layout.count[cerebrum & ~fluid].sum()), 1)

    def contact_share(tissue: NDArray[np.bool], neighbours: NDArray[np.bool]) -> float:
        contacts = layout.contact[tissue].sum(axis=0) * (counted & ~tissue)
        return float(contacts[neighbours].sum() / max(contacts.sum(), 1))

    def with_numbers(tissue: NDArray[np.bool], name: str) -> str:
        numbers = [str(number) for number in layout.labels[tissue]]
        return f"{name} ({', '.join([*numbers[:4], *(['…'] if len(numbers) > 4 else [])])})"

    surface = layout.contact[np.ix_(cerebrum, outside)].sum(axis=1)
    cortex_share = float(surface[cortex[cerebrum]].sum() / max(surface.sum(), 1))
    if cortex_share < MIN_CORTEX_OUTSIDE:
        yield f"{with_numbers(cortex, 'cortex')} would cover {cortex_share:.0%} of the cerebrum's surface"
    for tissue, name, (low, high) in ((cortex, "cortex", CORTEX), (white, "white matter", WHITE)):
        if tissue.any() and not low <= (share := layout.count[tissue].sum() / size) <= high:
            yield f"{with_numbers(tissue, name)} would be {share:.0%} of the cerebrum's tissue"
    for tissue, name, within in ((white, "white matter", cerebrum), (fluid, "ventricles", cerebrum & ~cortex)):
        if tissue.any() and (share := contact_share(tissue, within)) < MIN_INSIDE:
            yield f"{with_numbers(tissue, name)} would lie outside: {share:.0%} of their neighbours are inside"
    for number in layout.labels[outside & (layout.labels != 0)]:
        tissue, name = layout.labels == number, scheme.labels.get(int(number), "")
        share = contact_share(tissue, cerebrum & ~cortex)
        if share > MAX_OUTSIDE and layout.count[tissue].sum() > SMALL * size:
            yield f"{with_numbers(tissue, name)} would lie inside: {share:.0%} of its neighbours are there"
    between = 2 * layout.contact[np.ix_(left, right)].sum()
    contacts = layout.contact[np.ix_(left | right, cerebrum)].sum()
    if between > MAX_BETWEEN * contacts:
        yield f"left and right would be mixed: {between / contacts:.0%} of their contacts are with the other side"
    (a, b), (c, d) = ([layout.count[tissue & side].sum() for side in (left, right)] for tissue in (cortex, white))
    # a hemisphere may be small or missing, but with all of its tissues
    is_unequal = (a > 0) != (c > 0) or (b > 0) != (d > 0) or max(a * d, b * c) > MAX_IMBALANCE * min(a * d, b * c)
    if scheme.left and scheme.white_matter and is_unequal:
        yield f"left and right would have {a} and {b} voxels of cortex, {c} and {d} of white matter"
