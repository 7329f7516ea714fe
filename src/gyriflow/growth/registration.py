"""Diffeomorphic registration of two brains' volumes with greedy (Yushkevich et al.
2016, pyushkevich/greedy).

Brains are compared by channels: smoothed masks and intensities on a grid of cubic
voxels. The quality is measured by the overlap, the folding of the map, and the
displacement at its rim.
"""

import io
import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from zlib import crc32

import numpy as np
import SimpleITK
from numpy.typing import NDArray
from picsl_greedy import Greedy3D
from scipy.ndimage import (
    affine_transform,
    binary_dilation,
    gaussian_filter,
    map_coordinates,
)
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.alignment import motion
from ..geometry.deformations import Deformation, carry, determinants, transform_points
from ..geometry.poses import LPS_TO_RAS
from ..geometry.triangles import Floats

log = logging.getLogger(__name__)

SMOOTHING_MM = 0.8
"""Standard deviation of the Gaussian that smooths both masks."""
MARGIN_MM = 6.0
"""Margin around the cerebrum."""
CEREBRUM_BIT, CORTEX_BIT = 1, 2
PERTURBATION_VOXELS, PERTURBATION_SCALE = 0.5, 2.0
"""Root mean square shift of perturbed boundaries along each axis, and the SD of the
Gaussian that makes it smooth."""
BRIGHT = 0.99
"""Quantile of the intensity inside the cerebrum that counts as 1."""
WEIGHTS = {"cerebrum": 0.5, "cortex": 1.0, "intensity": 0.5}
AFFINE = "-a -dof 12 -m SSD -n 60x30"
DEFORMABLE = "-m NCC 3x3x3 -n 60x40x15 -wp 0"
SMOOTHING_VOXELS = (2.5, 0.8)
"""SD of the smoothing of updates and of the deformation."""
MAX_ROTATED_SHARE = 0.7
"""A rotated start is taken if its difference is below this share of that without
rotation."""
N_POINTS = 3000
"""Number of points of the cerebrum at which starts are compared."""
_ANGLES = list(product(range(0, 360, 45), range(-90, 91, 45), range(0, 360, 45)))
START_ROTATIONS: Floats = Rotation.from_euler("xyz", _ANGLES, degrees=True).as_matrix()
START_ROTATIONS = START_ROTATIONS[
    np.argsort(-np.trace(START_ROTATIONS, axis1=1, axis2=2), kind="stable")
]
"""Rotations of the start, the identity first. Every rotation is within about 35 degrees
of one of them."""
REFINED_DEG = (20.0, 10.0, 5.0)
"""Steps by which the best of them is then rotated about the three axes, in turn."""
NEAR_MM = 3.0
"""Margin around the cerebrum for comparing brains during deformation."""
MIN_DICE = {"cerebrum": 0.95, "cortex": 0.60}
"""Below these overlaps a registration is refused. Overlap of a cortex of one voxel is
low."""
MAX_FOLDED = 0.005
"""Largest share of the cerebrum's volume where the map may fold."""


@dataclass(frozen=True, eq=False)
class Channels:
    """A brain on a grid (i, j, k) of cubic voxels along the axes of RAS+.

    `affine` (4, 4) leads from index to position in mm. `tissue` has the bits
    `CEREBRUM_BIT` and `CORTEX_BIT` of the unsmoothed masks; `cerebrum` and `cortex` are
    smoothed masks from 0 to 1; `intensity` is that of the image, scaled so that the
    brightest parts of the cerebrum are about 1.
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

    `labels` (i, j, k) are on any grid, rotated or sheared; `affine` (4, 4) leads from
    index to RAS+ mm; `cerebrum` and `cortex` are their label numbers. `image` has
    intensities and their own affine. `voxel_mm` is the voxel size of the new grid; by
    default the volume's smallest one.

    InputError if no voxel belongs to the cerebrum or to a named cortex, if the edge of
    the volume cuts the cerebrum, or if the image does not cover it.
    """
    inside = np.isin(labels, cerebrum)
    if not inside.any():
        raise InputError(
            "no voxel belongs to the cerebrum",
            found="other labels only",
            expected=f"labels {cerebrum}",
        )
    _require_whole(inside)
    sizes = np.linalg.norm(affine[:3, :3], axis=0)
    voxel = float(sizes.min()) if voxel_mm is None else voxel_mm
    centres = transform_points(np.argwhere(inside), affine)
    low, high = centres.min(axis=0) - MARGIN_MM, centres.max(axis=0) + MARGIN_MM
    # start at a voxel's centre, so that a suitable grid is not resampled
    low = transform_points(
        np.rint(transform_points(low, np.linalg.inv(affine))), affine
    )
    shape = tuple((np.ceil((high - low) / voxel) + 1).astype(int))
    grid = np.diag([voxel, voxel, voxel, 1.0])
    grid[:3, 3] = low

    masks = {CEREBRUM_BIT: inside}
    if cortex:
        masks[CORTEX_BIT] = np.isin(labels, cortex)
        if not masks[CORTEX_BIT].any():
            raise InputError(
                "no voxel belongs to the cortex",
                found="other labels only",
                expected=f"labels {cortex}",
            )
    tissue = np.zeros(shape, dtype=np.uint8)
    smoothed = {}
    for bit, mask in masks.items():
        solid = mask.astype(np.float32)
        tissue[_resample(solid, affine, grid, shape) > 0.5] |= bit
        smoothed[bit] = _resample(
            gaussian_filter(solid, SMOOTHING_MM / sizes), affine, grid, shape
        )
    intensity = (
        _intensity(image, grid, shape, tissue & CEREBRUM_BIT > 0) if image else None
    )
    return Channels(
        grid, tissue, smoothed[CEREBRUM_BIT], smoothed.get(CORTEX_BIT), intensity
    )


def perturb_labels(
    labels: NDArray[np.integer], seed: int, brain: str
) -> NDArray[np.integer]:
    """Return labels (i, j, k) with their boundaries shifted by a random smooth
    displacement of half a voxel.

    Brains of different names are shifted independently with the same seed, and each
    equally in all its registrations.
    """
    random = np.random.default_rng([seed, crc32(brain.encode())])
    index = np.indices(labels.shape, dtype=np.float32)
    for axis in index:
        shift = gaussian_filter(
            random.normal(size=labels.shape).astype(np.float32), PERTURBATION_SCALE
        )
        axis += PERTURBATION_VOXELS / shift.std() * shift
    return np.asarray(
        map_coordinates(labels, index, order=0, mode="nearest"), dtype=labels.dtype
    )


def _require_whole(inside: NDArray[np.bool_]) -> None:
    sides = {
        f"{'ijk'[axis]} = {'last' if end else 0}": int(
            np.count_nonzero(np.take(inside, end, axis=axis))
        )
        for axis in range(3)
        for end in (0, -1)
    }
    cut = {
        side: count
        for side, count in sides.items()
        if count > 0.02 * np.count_nonzero(inside) ** (2 / 3)
    }
    if cut:
        raise InputError(
            "the edge of the volume cuts the cerebrum, so it cannot be registered",
            found=", ".join(f"{count} voxels at {side}" for side, count in cut.items()),
            expected="a whole cerebrum",
            remedy="Leave this brain out of the registration.",
        )


def _intensity(
    image: tuple[NDArray[np.number], Floats],
    grid: Floats,
    shape: tuple[int, ...],
    inside: NDArray[np.bool_],
) -> NDArray[np.float32]:
    values, affine = image
    finite = np.nan_to_num(
        np.asarray(values, dtype=np.float32), nan=0.0, posinf=0.0, neginf=0.0
    )
    intensity = _resample(finite, affine, grid, shape)
    bright = float(np.quantile(intensity[inside], BRIGHT))
    covered = float((intensity[inside] != 0).mean())
    if bright <= 0 or covered < 0.9:
        raise InputError(
            "the image does not show the cerebrum of the labels",
            found=(
                f"{covered:.0%} of the cerebrum with an intensity, 99 % quantile"
                f" {bright:.3g}"
            ),
            expected="positive intensities everywhere",
            remedy=(
                "Check that the image belongs to the labels, or register by the labels"
                " alone."
            ),
        )
    return intensity / np.float32(bright)


def _resample(
    values: NDArray[np.float32], affine: Floats, grid: Floats, shape: tuple[int, ...]
) -> NDArray[np.float32]:
    index = np.linalg.inv(affine) @ grid
    return np.asarray(
        affine_transform(
            values, index[:3, :3], index[:3, 3], output_shape=shape, order=1
        ),
        dtype=np.float32,
    )


@dataclass(frozen=True, eq=False)
class Registration:
    """A deformation from the earlier brain to the later one.

    `turned_deg` is the angle by which the later brain was rotated before the affine
    registration; `channels` are those that were compared.
    """

    deformation: Deformation
    turned_deg: float
    seconds: float
    channels: tuple[str, ...]


def register(
    earlier: Channels, later: Channels, *, smoothing: float = 1.0, threads: int = 1
) -> Registration:
    """Register an earlier brain to a later one.

    The channels that both have are compared with the weights `WEIGHTS`: sums of squares
    for the affine map, normalised cross-correlation for the deformation. It starts with
    centroids and volumes of the cerebra matched, rotated if this fits clearly better
    (`START_ROTATIONS`, `REFINED_DEG`). The result is deterministic. InputError if
    greedy fails; `measure_quality` measures how good the result is. `smoothing` is a
    factor of `SMOOTHING_VOXELS`.
    """
    began = time.perf_counter()
    names = tuple(
        name
        for name in WEIGHTS
        if getattr(earlier, name) is not None and getattr(later, name) is not None
    )
    turn, start = _find_start(earlier, later, names)
    images = {
        f"fixed_{name}": _image(getattr(earlier, name), earlier.affine)
        for name in names
    }
    # greedy starts at the identity, so the later brain is passed in its start position
    placed = np.linalg.inv(start) @ later.affine
    images |= {f"moving_{name}": _image(getattr(later, name), placed) for name in names}
    rounds = int(np.ceil(NEAR_MM / earlier.voxel_mm))
    near_cerebrum = binary_dilation(
        earlier.tissue & CEREBRUM_BIT > 0, iterations=rounds
    )
    images["where"] = _image(near_cerebrum.astype(np.float32), earlier.affine)
    pairs = " ".join(
        f"-w {WEIGHTS[name]:g} -i fixed_{name} moving_{name}" for name in names
    )
    common = f"-threads {threads} -seed 1 -V 0"
    greedy = Greedy3D()
    output = io.StringIO()
    try:
        greedy.execute(
            f"{AFFINE} {common} {pairs} -ia-identity -o found",
            out=output,
            err=output,
            found=None,
            **images,
        )
        smooth = "-s " + " ".join(
            f"{smoothing * voxels:g}vox" for voxels in SMOOTHING_VOXELS
        )
        options = f"{DEFORMABLE} {smooth} {common} {pairs} -gm where -it found"
        greedy.execute(f"{options} -o warp", out=output, err=output, warp=None)
    except RuntimeError as error:
        raise InputError(
            f"greedy cannot register the brains: {error}",
            found=f"channels {', '.join(names)}" + output.getvalue()[-500:],
            remedy=(
                "Look at both label volumes: are they of the same kind of brain, whole"
                " and in mm?"
            ),
        ) from error
    # greedy returns matrices in RAS; all else is in LPS
    matrix = start @ LPS_TO_RAS @ np.asarray(greedy["found"], dtype=float) @ LPS_TO_RAS
    # SimpleITK's arrays have reversed axes
    warp = (
        SimpleITK.GetArrayFromImage(greedy["warp"])
        .transpose(2, 1, 0, 3)
        .astype(np.float32)
    )
    seconds = time.perf_counter() - began
    log.info("registered by %s in %.0f s", ", ".join(names), seconds)
    return Registration(
        Deformation(matrix, np.ascontiguousarray(warp), earlier.affine),
        float(np.degrees(Rotation.from_matrix(turn).magnitude())),
        seconds,
        names,
    )


def _image(values: NDArray[np.float32], affine: Floats) -> SimpleITK.Image:
    image = SimpleITK.GetImageFromArray(np.ascontiguousarray(values.transpose(2, 1, 0)))
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    image.SetSpacing(spacing.tolist())
    image.SetDirection((affine[:3, :3] / spacing).ravel().tolist())
    image.SetOrigin(affine[:3, 3].tolist())
    return image


def _find_start(
    earlier: Channels, later: Channels, names: tuple[str, ...]
) -> tuple[Floats, Floats]:
    (first, first_size), (second, second_size) = _place(earlier), _place(later)
    scale = (second_size / first_size) ** (1 / 3)
    index = np.argwhere(earlier.cerebrum > 0.01)
    index = index[:: max(1, len(index) // N_POINTS)]
    points = transform_points(index, earlier.affine)

    def start_of(turn: Floats) -> Floats:
        return motion(scale * turn, second - scale * turn @ first)

    def difference(turn: Floats) -> float:
        at = transform_points(
            transform_points(points, start_of(turn)), np.linalg.inv(later.affine)
        ).T
        squares = [
            WEIGHTS[name]
            * np.square(
                getattr(earlier, name)[tuple(index.T)]
                - map_coordinates(getattr(later, name), at, order=1)
            )
            for name in names
        ]
        return float(np.sum([square.mean() for square in squares]))

    turn = min(START_ROTATIONS, key=difference)
    for step in REFINED_DEG:
        nearby = Rotation.from_euler(
            "xyz", list(product((0, -step, step), repeat=3)), degrees=True
        )
        turn = min(nearby.as_matrix() @ turn, key=difference)
    if difference(turn) >= MAX_ROTATED_SHARE * difference(np.eye(3)):
        turn = np.eye(3)
    return turn, start_of(turn)


def _place(brain: Channels) -> tuple[Floats, float]:
    index = np.argwhere(brain.tissue & CEREBRUM_BIT > 0)
    return (
        transform_points(index, brain.affine).mean(axis=0),
        len(index) * brain.voxel_mm**3,
    )


def measure_quality(
    earlier: Channels, later: Channels, deformation: Deformation
) -> dict[str, float]:
    """Measure the quality of a deformation between two brains from their unsmoothed
    masks.

    dice_cerebrum and dice_cortex are the overlap 2|A∩B|/(|A| + |B|) of the masks of the
    earlier brain with those of the later brain carried back, NaN without a cortex. The
    Jacobian determinant of the map in the earlier cerebrum, on the deformation's own
    grid, is described by its minimum (least_determinant), the share of the volume where
    it is ≤ 0 (folded_share), the standard deviation of its logarithm elsewhere
    (log_growth_sd), and its mean, the ratio of volumes (volume_ratio). rim_mm and
    inside_mm are 95 % quantiles of the displacement at the rim of the grid and in the
    cerebrum; the rim should have less, since nothing is compared there.
    """
    grid = transform_points(
        np.indices(earlier.tissue.shape).reshape(3, -1).T, earlier.affine
    )
    places = transform_points(carry(deformation, grid), np.linalg.inv(later.affine)).T
    inside = earlier.tissue & CEREBRUM_BIT > 0
    with_cortex = earlier.cortex is not None and later.cortex is not None
    growth = determinants(deformation)
    index = transform_points(
        transform_points(np.argwhere(inside), earlier.affine),
        np.linalg.inv(deformation.affine),
    )
    growth = map_coordinates(growth, index.T, order=1, mode="nearest")
    lengths = np.linalg.norm(deformation.displacement, axis=-1)
    rim = np.ones(lengths.shape, dtype=bool)
    rim[1:-1, 1:-1, 1:-1] = False
    return {
        "dice_cerebrum": _dice(earlier, later, CEREBRUM_BIT, places),
        "dice_cortex": (
            _dice(earlier, later, CORTEX_BIT, places) if with_cortex else float("nan")
        ),
        "least_determinant": float(growth.min()),
        "folded_share": float((growth <= 0).mean()),
        "log_growth_sd": float(np.log(growth[growth > 0]).std()),
        "volume_ratio": float(growth.mean()),
        "rim_mm": float(np.quantile(lengths[rim], 0.95)),
        "inside_mm": float(
            np.quantile(
                map_coordinates(lengths, index.T, order=1, mode="nearest"), 0.95
            )
        ),
    }


def register_and_measure(
    earlier: Channels,
    later: Channels,
    *,
    is_filled: bool,
    smoothing: float = 1.0,
    threads: int = 1,
) -> tuple[Registration, dict[str, float]]:
    """Register two brains by `register` and measure the quality.

    If the cortex of one `is_filled` from surfaces, it may be far from that of labels,
    which are coarse or of another kind. If both overlap too little, the brains are
    registered without cortex, with a warning.
    """
    found = register(earlier, later, smoothing=smoothing, threads=threads)
    quality = measure_quality(earlier, later, found.deformation)
    if not (is_filled and quality["dice_cortex"] < MIN_DICE["cortex"]):
        return found, quality
    overlap = (
        f"Dice {quality['dice_cortex']:.2f}, expected {MIN_DICE['cortex']:.2f} or more"
    )
    log.warning(
        "the cortex filled from surfaces is not that of the labels (%s): registered"
        " without cortex",
        overlap,
    )
    brains = [replace(brain, cortex=None) for brain in (earlier, later)]
    return register_and_measure(
        *brains, is_filled=False, smoothing=smoothing, threads=threads
    )


def require_good(
    quality: Mapping[str, float], *, pair: str, only_warn: bool = False
) -> None:
    """Raise InputError, with all measures, if a registration of a named `pair` of
    brains must not be used.

    With `only_warn`, log a warning instead.
    """
    faults = [
        f"Dice of the {mask} {quality[f'dice_{mask}']:.3f} below {limit:g}"
        for mask, limit in MIN_DICE.items()
        if quality[f"dice_{mask}"] < limit
    ]
    if (folded := quality["folded_share"]) > MAX_FOLDED:
        faults.append(
            f"the map folds in {folded:.2%} of the cerebrum, above {MAX_FOLDED:.2%}"
        )
    if faults:
        numbers = ", ".join(f"{name} {value:.3g}" for name, value in quality.items())
        error = InputError(
            f"the registration {pair} has failed: {'; '.join(faults)}",
            found=numbers,
            expected="two brains that differ by some weeks of growth",
            remedy=(
                "Look at both label volumes; leave out the one that does not fit, or"
                " use brains of closer weeks."
            ),
        )
        if not only_warn:
            raise error
        log.warning("%s", error)


def _dice(earlier: Channels, later: Channels, bit: int, places: Floats) -> float:
    first = (earlier.tissue & bit > 0).ravel()
    second = (
        map_coordinates((later.tissue & bit > 0).astype(np.float32), places, order=1)
        > 0.5
    )
    both = int(np.count_nonzero(first & second))
    total = int(np.count_nonzero(first)) + int(np.count_nonzero(second))
    return 2 * both / max(total, 1)
