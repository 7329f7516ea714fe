"""Phantoms as brains in clinics and labs are: labels and affine in, labels on the same
grid out."""

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from phantoms import (
    BRAINSTEM,
    CALLOSUM,
    CENTRE_MM,
    CEREBELLUM,
    CORTEX,
    CSF,
    DEEP_GREY,
    VENTRICLES,
    WHITE,
)

Floats = NDArray[np.float64]
Labels = NDArray[np.int32]
Side = Literal["left", "right"]

CEREBRUM = (WHITE, VENTRICLES, CORTEX, DEEP_GREY, CALLOSUM)
SIGN = {"left": -1.0, "right": 1.0}


def positions(labels: Labels, affine: Floats) -> Floats:
    """Return x, y, z of the voxels in mm from the brain's centre, RAS+, (3, i, j,
    k)."""
    index = np.indices(labels.shape).reshape(3, -1)
    return ((affine[:3, :3] @ index).T + affine[:3, 3] - CENTRE_MM).T.reshape(
        3, *labels.shape
    )


def half_extents(labels: Labels, affine: Floats) -> list[float]:
    """Return how far the cerebrum reaches from the centre along x, y and z, in mm."""
    cerebrum = np.isin(labels, CEREBRUM)
    return [np.abs(axis[cerebrum]).max() for axis in positions(labels, affine)]


def without_callosum(labels: Labels, affine: Floats) -> Labels:
    """Return a brain whose hemispheres are joined at the thalami alone: agenesis of the
    corpus callosum."""
    thalami = positions(labels, affine)[2][labels == DEEP_GREY]
    return apart(labels, affine, above_mm=thalami.mean())


def apart(
    labels: Labels, affine: Floats, gap_mm: float = 3.0, above_mm: float = -np.inf
) -> Labels:
    """Return unconnected hemispheres, with a gap of CSF between them."""
    x, _, z = positions(labels, affine)
    made = np.where(labels == CALLOSUM, WHITE, labels)
    gap = np.isin(labels, CEREBRUM) & (np.abs(x) < 0.5 * gap_mm) & (z > above_mm)
    return np.where(gap, CSF, made).astype(np.int32)


def holoprosencephaly(labels: Labels, affine: Floats) -> Labels:
    """Return a brain without a fissure in front, with one ventricle for two and no
    corpus callosum."""
    x, y, z = positions(labels, affine)
    made = np.where(labels == CALLOSUM, WHITE, labels)
    a, b, c = half_extents(labels, affine)
    radius = (x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2
    fused = (np.abs(x) < 6.0) & (y > 0.0) & (labels == CSF) & (radius < 0.72)
    made = np.where(fused, np.where(radius > 0.60, CORTEX, WHITE), made)
    across = (x / (0.45 * a)) ** 2 + ((y - 2.0) / (0.45 * b)) ** 2
    single = across + ((z - 2.0) / 7.0) ** 2 < 1.0
    inner = single & np.isin(made, (WHITE, VENTRICLES, CORTEX))
    return np.where(inner, VENTRICLES, made).astype(np.int32)


def warp(
    labels: Labels, affine: Floats, came_from: Callable[[Floats], Floats]
) -> Labels:
    """Return labels moved: `came_from` gives the (3, …) place, in mm from the centre,
    that each place's label has."""
    place = came_from(positions(labels, affine))
    index = (
        np.linalg.inv(affine[:3, :3])
        @ (place.reshape(3, -1).T + CENTRE_MM - affine[:3, 3]).T
    )
    nearest = np.rint(index).astype(int)
    shape = np.array(labels.shape)[:, None]
    inside = ((nearest >= 0) & (nearest < shape)).all(axis=0)
    clipped = np.clip(nearest, 0, shape - 1)
    moved = np.where(inside, labels[tuple(clipped)], 0)
    return moved.reshape(labels.shape).astype(np.int32)


def warp_across(
    labels: Labels, affine: Floats, x_from: Callable[[Floats], Floats]
) -> Labels:
    """Return labels moved along x: `x_from` gives the x that each place's label has."""
    return warp(labels, affine, lambda place: np.stack([x_from(place), *place[1:]]))


def shifted_midline(labels: Labels, affine: Floats, mm: float = 8.0) -> Labels:
    """Return a brain whose middle is pushed to the right by `mm`, its outer sides in
    place: a shift of the midline."""
    half = half_extents(labels, affine)[0]

    def x_from(place: Floats) -> Floats:
        x = place[0]
        width = np.where(x > mm, half - mm, half + mm)
        return np.where(np.abs(x) < half, (x - mm) * half / width, x)

    return warp_across(labels, affine, x_from)


def wide_hemisphere(
    labels: Labels, affine: Floats, factor: float = 1.3, *, ventricle: bool = False
) -> Labels:
    """Return a brain whose right hemisphere is wider by `factor`: hemimegalencephaly,
    or with a wide ventricle."""
    made = warp_across(
        labels, affine, lambda place: place[0] / np.where(place[0] > 0, factor, 1.0)
    )
    if ventricle:
        x, y, z = positions(made, affine)
        a, b, c = half_extents(made, affine)
        across = (x / (0.3 * a) - 1.5) ** 2 + (y / (0.6 * b)) ** 2
        fluid = across + ((z - 2.0) / (0.35 * c)) ** 2 < 1.0
        made = np.where(fluid & np.isin(made, (WHITE, DEEP_GREY)), VENTRICLES, made)
    return made.astype(np.int32)


def small_hemisphere(
    labels: Labels, affine: Floats, share: float = 0.12, side: Side = "right"
) -> Labels:
    """Return hemispheres apart, one of them shrunk to a share of its volume:
    hypoplasia."""
    whole, factor = apart(labels, affine), share ** (1 / 3)
    wall = np.array([1.5 * SIGN[side], 0.0, 0.0])[:, None, None, None]
    x, _, _ = positions(labels, affine)
    small = warp(whole, affine, lambda place: wall + (place - wall) / factor)
    return np.where(SIGN[side] * x > 0, small, whole).astype(np.int32)


def add_sides(labels: Labels, affine: Floats) -> Labels:
    """Return the labels of a phantom with sides, as in BOUNTI (`dhcp-19`); the callosum
    is white matter there."""
    x, _, _ = positions(labels, affine)
    pairs = {
        CSF: 1,
        CORTEX: 3,
        WHITE: 5,
        CALLOSUM: 5,
        VENTRICLES: 7,
        CEREBELLUM: 11,
        DEEP_GREY: 16,
    }
    made = np.where(labels == BRAINSTEM, 10, 0)
    for number, left in pairs.items():
        made = np.where(labels == number, np.where(x < 0, left, left + 1), made)
    return made.astype(np.int32)


def with_fourth_ventricle(labels: Labels, affine: Floats) -> Labels:
    """Return the brain with its ventricles joined, through a thin aqueduct, to a fourth
    ventricle below the cerebrum.

    All of it has the label of the ventricles, as in the labels of atlases.
    """
    x, y, z = positions(labels, affine)
    made = labels.copy()
    below = z[
        np.isin(labels, CEREBRUM) & (np.abs(x) < 2.0) & (np.abs(y + 6.0) < 3.0)
    ].min()
    brainstem = (np.hypot(x, y + 6.0) < 7.0) & (z < below) & (z > below - 24.0)
    made[brainstem & ~np.isin(labels, CEREBRUM)] = BRAINSTEM
    third = (np.abs(x) < 1.6) & (np.abs(y + 4.0) < 6.0) & (z > below + 4.0) & (z < 0.0)
    aqueduct = (np.hypot(x, y + 6.0) < 1.3) & (z > below - 14.0) & (z < below + 6.0)
    across = (x / 5.0) ** 2 + ((y + 6.0) / 4.0) ** 2
    fourth = across + ((z - below + 15.0) / 6.0) ** 2 < 1.0
    made[third | aqueduct | fourth] = VENTRICLES
    return made


def one_hemisphere(
    labels: Labels, affine: Floats, side: Side = "left", gap_mm: float = 1.0
) -> Labels:
    """Return one hemisphere alone, as after hemispherectomy or as hemispheres are given
    one by one."""
    x, _, _ = positions(labels, affine)
    made = np.where(labels == CALLOSUM, WHITE, labels)
    return np.where(SIGN[side] * x > 0.5 * gap_mm, made, 0).astype(np.int32)


def bent_midline(labels: Labels, affine: Floats, mm: float = 3.0) -> Labels:
    """Return a brain whose fissure bends to and fro by `mm`, together with what lies
    beside it."""
    return warp_across(
        labels, affine, lambda place: place[0] - mm * np.sin(place[1] / 12.0)
    )


def crop(labels: Labels, affine: Floats, share: float = 0.33) -> tuple[Labels, Floats]:
    """Return the volume without a share of the brain on top, as where the field of view
    ends, and its affine."""
    brain = np.isin(labels, CEREBRUM)
    up = affine[2, :3]
    axis = int(np.abs(up).argmax())
    along = np.flatnonzero(brain.any(axis=tuple(n for n in range(3) if n != axis)))
    count = round(share * len(along))
    if up[axis] > 0:
        return labels.take(range(along[-1] + 1 - count), axis), affine
    first = along[0] + count
    moved = affine.copy()
    moved[:3, 3] += affine[:3, axis] * first
    return labels.take(range(first, labels.shape[axis]), axis), moved
