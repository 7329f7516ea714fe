"""Which part of the ventricles belongs to the cerebrum: what its tissue encloses."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..parameters.schemes import LabelScheme

Mask = NDArray[np.bool_]

# the directions in which a voxel of fluid looks for tissue: to the faces, edges and corners of its cell
DIRECTIONS = np.array([d for d in np.ndindex(3, 3, 3) if d != (1, 1, 1)]) - 1
# fluid belongs to the cerebrum where it sees the cerebrum's tissue in more than this part of the directions
ENCLOSED = 0.5
# the border between what is enclosed and what is not is smoothed over this many voxels
SMOOTHING = 2.0
# parts of the fluid below this share of the largest are crumbs
CRUMB = 0.02
EVERY_NEIGHBOUR = np.ones((3, 3, 3), dtype=bool)


def outside_ventricles(labels: NDArray[np.integer], scheme: LabelScheme) -> Mask:
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


def _beside_hindbrain(
    out: Mask, labels: NDArray[np.integer], scheme: LabelScheme
) -> tuple[NDArray[np.int32], list[int]]:
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
