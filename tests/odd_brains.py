"""Phantoms with differences that no configuration asks for: labels and affine in, labels on the same grid out."""

import numpy as np

from gyriflow.phantom.brain import BRAINSTEM, CALLOSUM, VENTRICLES, WHITE
from gyriflow.phantom.pathologies import CEREBRUM, SIGN, Floats, Labels, Side, positions, warp


def with_fourth_ventricle(labels: Labels, affine: Floats) -> Labels:
    """Returns the brain with its ventricles joined, through a thin aqueduct, to a fourth ventricle below the cerebrum.

    All of it has the label of the ventricles, as in the labels of atlases.
    """
    x, y, z = positions(labels, affine)
    made = labels.copy()
    below = z[np.isin(labels, CEREBRUM) & (np.abs(x) < 2.0) & (np.abs(y + 6.0) < 3.0)].min()
    brainstem = (np.hypot(x, y + 6.0) < 7.0) & (z < below) & (z > below - 24.0)
    made[brainstem & ~np.isin(labels, CEREBRUM)] = BRAINSTEM
    third = (np.abs(x) < 1.6) & (np.abs(y + 4.0) < 6.0) & (z > below + 4.0) & (z < 0.0)
    aqueduct = (np.hypot(x, y + 6.0) < 1.3) & (z > below - 14.0) & (z < below + 6.0)
    fourth = (x / 5.0) ** 2 + ((y + 6.0) / 4.0) ** 2 + ((z - below + 15.0) / 6.0) ** 2 < 1.0
    made[third | aqueduct | fourth] = VENTRICLES
    return made


def one_hemisphere(labels: Labels, affine: Floats, side: Side = "left", gap_mm: float = 1.0) -> Labels:
    """Returns one hemisphere alone, as after hemispherectomy or as hemispheres are given one by one."""
    x, _, _ = positions(labels, affine)
    made = np.where(labels == CALLOSUM, WHITE, labels)
    return np.where(SIGN[side] * x > 0.5 * gap_mm, made, 0).astype(np.int32)


def bent_midline(labels: Labels, affine: Floats, mm: float = 3.0) -> Labels:
    """Returns a brain whose fissure bends to and fro by `mm`, together with what lies beside it."""

    def came_from(place: Floats) -> Floats:
        return np.stack([place[0] - mm * np.sin(place[1] / 12.0), place[1], place[2]])

    return warp(labels, affine, came_from)


def crop(labels: Labels, affine: Floats, share: float = 0.33) -> tuple[Labels, Floats]:
    """Returns the volume without a share of the brain on top, as where the field of view ends, and its affine."""
    brain = np.isin(labels, CEREBRUM)
    up = affine[2, :3]
    axis = int(np.abs(up).argmax())
    along = np.flatnonzero(brain.any(axis=tuple(n for n in range(3) if n != axis)))
    count = round(share * len(along))
    first = np.zeros(3)
    if up[axis] > 0:
        stop = along[-1] + 1 - count
        return labels.take(range(stop), axis), affine
    first[axis] = along[0] + count
    moved = affine.copy()
    moved[:3, 3] += affine[:3, :3] @ first
    return labels.take(range(int(first[axis]), labels.shape[axis]), axis), moved
