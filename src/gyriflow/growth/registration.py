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
from picsl_greedy import Greedy3D, GreedyFloat3D
from scipy.ndimage import (
    affine_transform,
    binary_dilation,
    gaussian_filter,
    map_coordinates,
)
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.alignment import angle_deg, motion
from ..geometry.deformations import (
    Deformation,
    transform_points,
    voxel_index,
    voxel_size,
)
from ..geometry.poses import LPS_TO_RAS
from ..geometry.triangles import Floats, Indices, Mask
from ..grouping import counted

log = logging.getLogger(__name__)

SMOOTHING_MM = 0.8
"""Standard deviation of the Gaussian that smooths both masks."""
MARGIN_VOXELS = 6.0
MARGIN_MM = (4.5, 6.0)
"""Margin around the cerebrum, and the least and the largest one."""
CEREBRUM_BIT = 1
CORTEX_BIT = 2
PERTURBATION_VOXELS = 0.5
PERTURBATION_SCALE = 2.0
"""Root mean square shift of perturbed boundaries along each axis, and the SD of the
Gaussian that makes it smooth."""
BRIGHT = 0.99
"""Quantile of the intensity inside the cerebrum that counts as 1."""
WEIGHTS = {"cerebrum": 0.5, "cortex": 1.0, "intensity": 0.5}
AFFINE = "-a -dof 12 -m SSD -n 60x30"
DEFORMABLE = "-m NCC 3x3x3 -wp 0"
ITERATIONS = "-n 60x40x15"
"""Rounds of the deformation at four times the voxel size, at twice, and at full
size."""
FINE_ITERATIONS = "-n 60x30x8 -noise 0.005"
"""The same for voxels below `FINE_MM`: fewer rounds suffice. They are in single
precision, whose rounding must be less than the noise that greedy adds to the
channels."""
FINE_MM = 1.0
SMOOTHING_VOXELS = (2.5, 0.8)
"""SD of the smoothing of updates and of the deformation."""
MAX_ROTATED_SHARE = 0.7
"""A rotated start is taken if its difference is below this share of that without
rotation."""
N_POINTS = 1500
"""Least number of points of the cerebrum at which starts are compared."""
_ANGLES = [
    (first, second, third)
    for first, second, third in product(
        range(0, 360, 45),
        range(-90, 91, 45),
        range(0, 360, 45),
    )
    # at a right angle the first turn and the third are about one axis
    if third == 0 or abs(second) < 90
]
_TURNS = Rotation.from_euler("xyz", _ANGLES, degrees=True).as_matrix()
START_ROTATIONS = sorted(_TURNS, key=np.trace, reverse=True)
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


VolumePair = tuple[NDArray[np.float32], NDArray[np.float32]]
"""A channel (i, j, k) of an earlier and of a later brain."""


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
    labels: Indices,
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
    masks = {CEREBRUM_BIT: _mask(labels, cerebrum, "cerebrum")}
    _require_whole(masks[CEREBRUM_BIT])
    if cortex:
        masks[CORTEX_BIT] = _mask(labels, cortex, "cortex")
    sizes = voxel_size(affine)
    voxel = float(sizes.min()) if voxel_mm is None else voxel_mm
    inside = np.argwhere(masks[CEREBRUM_BIT])
    centres = transform_points(inside, affine)
    margin = np.clip(MARGIN_VOXELS * voxel, *MARGIN_MM)
    low = centres.min(axis=0) - margin
    high = centres.max(axis=0) + margin
    # start at a voxel's centre, so that a suitable grid is not resampled
    index = np.rint(
        transform_points(
            low,
            np.linalg.inv(affine),
        )
    )
    low = transform_points(index, affine)
    shape = tuple((np.ceil((high - low) / voxel) + 1).astype(int))
    grid = np.diag([voxel, voxel, voxel, 1.0])
    grid[:3, 3] = low
    # the filter ends at four standard deviations
    reach = np.ceil((margin + 4 * SMOOTHING_MM) / sizes).astype(int)
    first = np.maximum(
        inside.min(axis=0) - reach,
        0,
    )
    last = inside.max(axis=0) + reach
    near = tuple(map(slice, first, last + 1))
    near_affine = affine.copy()
    near_affine[:3, 3] = transform_points(first, affine)

    tissue = np.zeros(shape, dtype=np.uint8)
    smoothed = {}
    for bit, mask in masks.items():
        solid = mask[near].astype(np.float32)
        tissue[_resample(solid, near_affine, grid, shape) > 0.5] |= bit
        smooth = gaussian_filter(solid, SMOOTHING_MM / sizes)
        smoothed[bit] = _resample(smooth, near_affine, grid, shape)
    intensity = None
    if image:
        intensity = _intensity(image, grid, shape, tissue & CEREBRUM_BIT > 0)
    return Channels(
        grid,
        tissue,
        smoothed[CEREBRUM_BIT],
        smoothed.get(CORTEX_BIT),
        intensity,
    )


def _mask(
    labels: Indices,
    numbers: Sequence[int],
    name: str,
) -> Mask:
    """Return where labels have some numbers; InputError if nowhere."""
    mask = np.isin(labels, numbers)
    if not mask.any():
        raise InputError(
            f"no voxel belongs to the {name}",
            found="other labels only",
            expected=f"labels {numbers}",
        )
    return mask


def perturb_labels(
    labels: Indices,
    seed: int,
    brain: str,
) -> Indices:
    """Return labels (i, j, k) with their boundaries shifted by a random smooth
    displacement of half a voxel.

    Brains of different names are shifted independently with the same seed, and each
    equally in all its registrations.
    """
    random = np.random.default_rng([seed, crc32(brain.encode())])
    index = np.indices(labels.shape, dtype=np.float32)
    for axis in index:
        noise = random.normal(size=labels.shape)
        shift = gaussian_filter(noise.astype(np.float32), PERTURBATION_SCALE)
        factor = PERTURBATION_VOXELS / shift.std()
        axis += factor * shift
    shifted = map_coordinates(labels, index, order=0, mode="nearest")
    return np.asarray(shifted)


def _require_whole(inside: Mask) -> None:
    # in proportion to the area of a cut through the cerebrum
    allowed = 0.02 * np.count_nonzero(inside) ** (2 / 3)
    cut = []
    for axis, name in enumerate("ijk"):
        for end, place in ((0, "0"), (-1, "last")):
            count = int(np.count_nonzero(inside.take(end, axis=axis)))
            if count > allowed:
                cut.append(f"{counted(count, 'voxel')} at {name} = {place}")
    if cut:
        raise InputError(
            "the edge of the volume cuts the cerebrum, so it cannot be registered",
            found=", ".join(cut),
            expected="a whole cerebrum",
            remedy="Leave this brain out of the registration.",
        )


def _intensity(
    image: tuple[NDArray[np.number], Floats],
    grid: Floats,
    shape: tuple[int, ...],
    inside: Mask,
) -> NDArray[np.float32]:
    values, affine = image
    values = np.asarray(values, dtype=np.float32)
    finite = np.nan_to_num(values, posinf=0, neginf=0)
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
    values: NDArray[np.float32],
    affine: Floats,
    grid: Floats,
    shape: tuple[int, ...],
) -> NDArray[np.float32]:
    index = np.linalg.inv(affine) @ grid
    resampled = affine_transform(
        values,
        index[:3, :3],
        index[:3, 3],
        output_shape=shape,
        order=1,
    )
    return np.asarray(resampled, dtype=np.float32)


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
    earlier: Channels,
    later: Channels,
    *,
    smoothing: float = 1.0,
    threads: int = 1,
) -> Registration:
    """Register an earlier brain to a later one.

    The channels that both have are compared with the weights `WEIGHTS`: sums of squares
    for the affine map, normalised cross-correlation for the deformation. It starts with
    centroids and volumes of the cerebra matched, rotated if this fits clearly better
    (`START_ROTATIONS`, `REFINED_DEG`). The result is deterministic. InputError if
    greedy fails; `register_and_measure` also measures how good the result is.
    `smoothing` is a factor of `SMOOTHING_VOXELS`.
    """
    began = time.perf_counter()
    pairs_of_volumes = _common_channels(earlier, later)
    names = tuple(pairs_of_volumes)
    turn, start = _find_start(earlier, later, pairs_of_volumes)
    # greedy starts at the identity, so the later brain is passed in its start position
    placed = np.linalg.inv(start) @ later.affine
    images = {}
    for name, (fixed, moving) in pairs_of_volumes.items():
        images[f"fixed_{name}"] = _image(fixed, earlier.affine)
        images[f"moving_{name}"] = _image(moving, placed)
    rounds = int(np.ceil(NEAR_MM / earlier.voxel_mm))
    near_cerebrum = binary_dilation(
        earlier.tissue & CEREBRUM_BIT > 0, iterations=rounds
    )
    images["where"] = _image(
        near_cerebrum.astype(np.float32),
        earlier.affine,
    )
    pairs = " ".join(
        f"-w {WEIGHTS[name]:g} -i fixed_{name} moving_{name}" for name in names
    )
    common = f"-threads {threads} -seed 1 -V 0 {pairs}"
    update, total = (f"{smoothing * voxels:g}vox" for voxels in SMOOTHING_VOXELS)
    affine = f"{AFFINE} {common} -ia-identity -o found"
    is_fine = earlier.voxel_mm < FINE_MM
    iterations = FINE_ITERATIONS if is_fine else ITERATIONS
    deformable = (
        f"{DEFORMABLE} {iterations} -s {update} {total} {common} -gm where"
        " -it found -o warp"
    )
    # single precision takes a third less, but is not deterministic on tiny grids
    greedy = GreedyFloat3D() if is_fine else Greedy3D()
    output = io.StringIO()
    try:
        greedy.execute(
            affine,
            out=output,
            err=output,
            found=None,
            **images,
        )
        greedy.execute(
            deformable,
            out=output,
            err=output,
            warp=None,
        )
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
    warp = SimpleITK.GetArrayFromImage(greedy["warp"]).transpose(2, 1, 0, 3)
    warp = warp.astype(np.float32)
    displacement = np.ascontiguousarray(warp)
    seconds = time.perf_counter() - began
    log.info("registered by %s in %.0f s", ", ".join(names), seconds)
    deformation = Deformation(matrix, displacement, earlier.affine)
    return Registration(deformation, angle_deg(turn), seconds, names)


def _common_channels(earlier: Channels, later: Channels) -> dict[str, VolumePair]:
    """Return the volumes of the channels that both brains have, by name."""
    common = {}
    for name in WEIGHTS:
        first = getattr(earlier, name)
        second = getattr(later, name)
        if first is not None and second is not None:
            common[name] = (first, second)
    return common


def _image(values: NDArray[np.float32], affine: Floats) -> SimpleITK.Image:
    """Return a volume as SimpleITK has it, with reversed axes."""
    reversed_values = np.ascontiguousarray(values.transpose(2, 1, 0))
    image = SimpleITK.GetImageFromArray(reversed_values)
    linear = affine[:3, :3]
    spacing = np.linalg.norm(linear, axis=0)
    image.SetSpacing(spacing.tolist())
    image.SetDirection((linear / spacing).ravel().tolist())
    image.SetOrigin(affine[:3, 3].tolist())
    return image


def _find_start(
    earlier: Channels,
    later: Channels,
    volumes: Mapping[str, VolumePair],
) -> tuple[Floats, Floats]:
    """Return the (3, 3) rotation of a start, and the start as a (4, 4) affine map."""
    first, first_size = _centre_and_size(earlier)
    second, second_size = _centre_and_size(later)
    scale = (second_size / first_size) ** (1 / 3)
    index = np.argwhere(earlier.cerebrum > 0.01)
    every = max(1, len(index) // N_POINTS)
    index = index[::every]
    offsets = transform_points(index, earlier.affine) - first
    at_points = {name: fixed[tuple(index.T)] for name, (fixed, _) in volumes.items()}

    def difference(turn: Floats) -> float:
        moved = second + scale * offsets @ turn.T
        places = voxel_index(moved, later.affine)
        means = []
        for name, (_, moving) in volumes.items():
            there = map_coordinates(moving, places, order=1)
            squares = np.square(at_points[name] - there)
            means.append((WEIGHTS[name] * squares).mean())
        return float(np.sum(means))

    turn = min(START_ROTATIONS, key=difference)
    for step in REFINED_DEG:
        angles = list(
            product(
                (0, -step, step),
                repeat=3,
            )
        )
        nearby = Rotation.from_euler("xyz", angles, degrees=True)
        turn = min(nearby.as_matrix() @ turn, key=difference)
    if difference(turn) >= MAX_ROTATED_SHARE * difference(np.eye(3)):
        turn = np.eye(3)
    return turn, motion(scale * turn, second - scale * turn @ first)


def _centre_and_size(brain: Channels) -> tuple[Floats, float]:
    """Return the centroid (3,) in mm and the volume in mm³ of the cerebrum."""
    points = _cerebrum_mm(brain)
    volume = len(points) * brain.voxel_mm**3
    return points.mean(axis=0), volume


def _cerebrum_mm(brain: Channels) -> Floats:
    """Return the (n, 3) places in mm of the voxels of the cerebrum."""
    index = np.argwhere(brain.tissue & CEREBRUM_BIT > 0)
    return transform_points(index, brain.affine)


def _measure_quality(
    earlier: Channels,
    later: Channels,
    deformation: Deformation,
) -> dict[str, float]:
    """Measure the quality of a deformation between two brains, on the earlier one's
    grid, from their unsmoothed masks.

    dice_cerebrum and dice_cortex are the overlap 2|A∩B|/(|A| + |B|) of the masks of the
    earlier brain with those of the later brain carried back, NaN without a cortex. The
    Jacobian determinant of the map in the earlier cerebrum is described by its minimum
    (least_determinant), the share of the volume where it is ≤ 0 (folded_share), the
    standard deviation of its logarithm elsewhere (log_growth_sd), and its mean, the
    ratio of volumes (volume_ratio). rim_mm and inside_mm are 95 % quantiles of the
    displacement at the rim of the grid and in the cerebrum; the rim should have less,
    since nothing is compared there.
    """
    index = np.indices(earlier.tissue.shape).reshape(3, -1).T
    moved = transform_points(index, earlier.affine)
    moved += deformation.displacement.reshape(-1, 3)
    to_later = np.linalg.inv(later.affine) @ deformation.matrix
    places = transform_points(moved, to_later).T
    dice_cortex = float("nan")
    if earlier.cortex is not None and later.cortex is not None:
        dice_cortex = _dice(earlier, later, CORTEX_BIT, places)
    inside = earlier.tissue & CEREBRUM_BIT > 0
    growth = _volume_changes(deformation, inside)
    lengths = np.linalg.norm(deformation.displacement, axis=-1)
    rim = np.ones(lengths.shape, dtype=bool)
    rim[1:-1, 1:-1, 1:-1] = False
    log_growth = np.log(growth[growth > 0])
    return {
        "dice_cerebrum": _dice(earlier, later, CEREBRUM_BIT, places),
        "dice_cortex": dice_cortex,
        "least_determinant": float(growth.min()),
        "folded_share": float((growth <= 0).mean()),
        "log_growth_sd": float(log_growth.std()),
        "volume_ratio": float(growth.mean()),
        "rim_mm": float(np.quantile(lengths[rim], 0.95)),
        "inside_mm": float(np.quantile(lengths[inside], 0.95)),
    }


def _volume_changes(deformation: Deformation, inside: Mask) -> Floats:
    """Return the (n,) local changes of volume at the points of the map's grid that are
    `inside` (central differences); ≤ 0 where it folds."""
    slopes = []
    for axis in range(3):
        slope = np.gradient(deformation.displacement, axis=axis)
        slopes.append(slope[inside])
    by_index = np.stack(slopes, axis=-1)
    voxel = deformation.affine[:3, :3]
    by_position = by_index @ np.linalg.inv(voxel)
    of_displacement = np.linalg.det(np.eye(3) + by_position)
    linear = deformation.matrix[:3, :3]
    return of_displacement * np.linalg.det(linear)


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
    quality = _measure_quality(earlier, later, found.deformation)
    if not (is_filled and quality["dice_cortex"] < MIN_DICE["cortex"]):
        return found, quality
    log.warning(
        "the cortex filled from surfaces is not that of the labels (Dice %.2f, expected"
        " %.2f or more): registered without cortex",
        quality["dice_cortex"],
        MIN_DICE["cortex"],
    )
    return register_and_measure(
        replace(earlier, cortex=None),
        replace(later, cortex=None),
        is_filled=False,
        smoothing=smoothing,
        threads=threads,
    )


def require_good(
    quality: Mapping[str, float],
    *,
    pair: str,
    only_warn: bool = False,
) -> None:
    """Raise InputError, with all measures, if a registration of a named `pair` of
    brains must not be used.

    With `only_warn`, log a warning instead.
    """
    faults = []
    for mask, limit in MIN_DICE.items():
        dice = quality[f"dice_{mask}"]
        if dice < limit:
            faults.append(f"Dice of the {mask} {dice:.3f} below {limit:g}")
    folded = quality["folded_share"]
    if folded > MAX_FOLDED:
        faults.append(
            f"the map folds in {folded:.2%} of the cerebrum, above {MAX_FOLDED:.2%}"
        )
    if not faults:
        return
    error = InputError(
        f"the registration {pair} has failed: {'; '.join(faults)}",
        found=", ".join(f"{name} {value:.3g}" for name, value in quality.items()),
        expected="two brains that differ by some weeks of growth",
        remedy=(
            "Look at both label volumes; leave out the one that does not fit, or use"
            " brains of closer weeks."
        ),
    )
    if not only_warn:
        raise error
    log.warning("%s", error)


def _dice(
    earlier: Channels,
    later: Channels,
    bit: int,
    places: Floats,
) -> float:
    first = (earlier.tissue & bit > 0).ravel()
    mask = later.tissue & bit > 0
    second = (
        map_coordinates(
            mask.astype(np.float32),
            places,
            order=1,
        )
        > 0.5
    )
    total = first.sum() + second.sum()
    return float(2 * (first & second).sum() / max(total, 1))
