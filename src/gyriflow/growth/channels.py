"""Channels for registration: smoothed masks and intensities of a brain on a grid of cubic voxels."""

from collections.abc import Sequence
from dataclasses import dataclass
from zlib import crc32

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import affine_transform, gaussian_filter, map_coordinates

from ..errors import InputError
from ..geometry.deformations import transform_points
from ..geometry.triangles import Floats

SMOOTHING_MM = 0.8
"""Standard deviation of the Gaussian that smooths both masks."""

MARGIN_MM = 6.0
"""Margin around the cerebrum."""

CEREBRUM_BIT, CORTEX_BIT = 1, 2

PERTURBATION_VOXELS, PERTURBATION_SCALE = 0.5, 2.0
"""Root mean square shift of perturbed boundaries along each axis, and the SD of the Gaussian that makes it smooth."""

BRIGHT = 0.99
"""Quantile of the intensity inside the cerebrum that counts as 1."""


@dataclass(frozen=True, eq=False)
class Channels:
    """A brain on a grid (i, j, k) of cubic voxels along the axes of RAS+.

    `affine` (4, 4) leads from index to position in mm. `tissue` has the bits `CEREBRUM_BIT` and `CORTEX_BIT` of the
    unsmoothed masks; `cerebrum` and `cortex` are smoothed masks from 0 to 1; `intensity` is that of the image, scaled
    so that the brightest parts of the cerebrum are about 1.
    """

    affine: Floats
    tissue: NDArray[np.uint8]
    cerebrum: NDArray[np.float32]
    cortex: NDArray[np.float32] | None = None
    intensity: NDArray[np.float32] | None = None

    @property
    def voxel_mm(self) -> float:
        """Edge length of a voxel."""
        return float(self.affine[0, 0])


def channels(
    labels: NDArray[np.integer],
    affine: Floats,
    *,
    cerebrum: Sequence[int],
    cortex: Sequence[int] = (),
    image: tuple[NDArray[np.number], Floats] | None = None,
    voxel_mm: float | None = None,
) -> Channels:
    """Return the channels of a brain from its label volume and, if given, its image.

    `labels` (i, j, k) are on any grid, rotated or sheared; `affine` (4, 4) leads from index to RAS+ mm; `cerebrum` and
    `cortex` are their label numbers. `image` has intensities and their own affine. `voxel_mm` is the voxel size of the
    new grid; by default the volume's smallest one.

    InputError if no voxel belongs to the cerebrum or to a named cortex, if the edge of the volume cuts the cerebrum, or
    if the image does not cover it.
    """
    inside = np.isin(labels, cerebrum)
    if not inside.any():
        raise InputError("no voxel belongs to the cerebrum", found="other labels only", expected=f"labels {cerebrum}")
    _require_whole(inside)
    sizes = np.linalg.norm(affine[:3, :3], axis=0)
    voxel = float(sizes.min()) if voxel_mm is None else voxel_mm
    centres = transform_points(np.argwhere(inside), affine)
    low, high = centres.min(axis=0) - MARGIN_MM, centres.max(axis=0) + MARGIN_MM
    # start at a voxel's centre, so that a suitable grid is not resampled
    low = transform_points(np.rint(transform_points(low, np.linalg.inv(affine))), affine)
    shape = tuple((np.ceil((high - low) / voxel) + 1).astype(int))
    grid = np.diag([voxel, voxel, voxel, 1.0])
    grid[:3, 3] = low

    masks = {CEREBRUM_BIT: inside}
    if cortex:
        masks[CORTEX_BIT] = np.isin(labels, cortex)
        if not masks[CORTEX_BIT].any():
            raise InputError("no voxel belongs to the cortex", found="other labels only", expected=f"labels {cortex}")
    tissue = np.zeros(shape, dtype=np.uint8)
    smoothed = {}
    for bit, mask in masks.items():
        solid = mask.astype(np.float32)
        tissue[_resample(solid, affine, grid, shape) > 0.5] |= bit
        smoothed[bit] = _resample(gaussian_filter(solid, SMOOTHING_MM / sizes), affine, grid, shape)
    intensity = _intensity(image, grid, shape, tissue & CEREBRUM_BIT > 0) if image else None
    return Channels(grid, tissue, smoothed[CEREBRUM_BIT], smoothed.get(CORTEX_BIT), intensity)


def perturb_labels(labels: NDArray[np.integer], seed: int, brain: str) -> NDArray[np.integer]:
    """Return labels (i, j, k) with their boundaries shifted by a random smooth displacement of half a voxel.

    Brains of different names are shifted independently with the same seed, and each equally in all its registrations.
    """
    random = np.random.default_rng([seed, crc32(brain.encode())])
    index = np.indices(labels.shape, dtype=np.float32)
    for axis in index:
        shift = gaussian_filter(random.normal(size=labels.shape).astype(np.float32), PERTURBATION_SCALE)
        axis += PERTURBATION_VOXELS / shift.std() * shift
    return np.asarray(map_coordinates(labels, index, order=0, mode="nearest"), dtype=labels.dtype)


def _require_whole(inside: NDArray[np.bool_]) -> None:
    sides = {
        f"{'ijk'[axis]} = {'last' if end else 0}": int(np.count_nonzero(np.take(inside, end, axis=axis)))
        for axis in range(3)
        for end in (0, -1)
    }
    cut = {side: count for side, count in sides.items() if count > 0.02 * np.count_nonzero(inside) ** (2 / 3)}
    if cut:
        raise InputError(
            "the edge of the volume cuts the cerebrum, so it cannot be registered",
            found=", ".join(f"{count} voxels at {side}" for side, count in cut.items()),
            expected="a whole cerebrum",
            remedy="Leave this brain out of the registration.",
        )


def _intensity(
    image: tuple[NDArray[np.number], Floats], grid: Floats, shape: tuple[int, ...], inside: NDArray[np.bool_]
) -> NDArray[np.float32]:
    values, affine = image
    finite = np.nan_to_num(np.asarray(values, dtype=np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    intensity = _resample(finite, affine, grid, shape)
    bright = float(np.quantile(intensity[inside], BRIGHT))
    covered = float((intensity[inside] != 0).mean())
    if bright <= 0 or covered < 0.9:
        raise InputError(
            "the image does not show the cerebrum of the labels",
            found=f"{covered:.0%} of the cerebrum with an intensity, 99 % quantile {bright:.3g}",
            expected="positive intensities everywhere",
            remedy="Check that the image belongs to the labels, or register by the labels alone.",
        )
    return intensity / np.float32(bright)


def _resample(values: NDArray[np.float32], affine: Floats, grid: Floats, shape: tuple[int, ...]) -> NDArray[np.float32]:
    index = np.linalg.inv(affine) @ grid
    return np.asarray(
        affine_transform(values, index[:3, :3], index[:3, 3], output_shape=shape, order=1), dtype=np.float32
    )
