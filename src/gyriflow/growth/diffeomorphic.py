"""Diffeomorphic registration of two brains' volumes with greedy (Yushkevich et al. 2016, pyushkevich/greedy)."""

import io
import logging
import time
from dataclasses import dataclass
from itertools import product

import numpy as np
import SimpleITK
from numpy.typing import NDArray
from picsl_greedy import Greedy3D
from scipy.ndimage import binary_dilation, map_coordinates
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.alignment import motion
from ..geometry.deformations import Deformation, transform_points
from ..geometry.poses import LPS_TO_RAS
from ..geometry.triangles import Floats
from .channels import CEREBRUM_BIT, Channels

log = logging.getLogger(__name__)

WEIGHTS = {"cerebrum": 0.5, "cortex": 1.0, "intensity": 0.5}

AFFINE = "-a -dof 12 -m SSD -n 60x30"
DEFORMABLE = "-m NCC 3x3x3 -n 60x40x15 -wp 0"
SMOOTHING_VOXELS = (2.5, 0.8)
"""SD of the smoothing of updates and of the deformation."""

MAX_ROTATED_SHARE = 0.7
"""A rotated start is taken if its difference is below this share of that without rotation."""

N_POINTS = 3000
"""Number of points of the cerebrum at which starts are compared."""

_ANGLES = list(product(range(0, 360, 45), range(-90, 91, 45), range(0, 360, 45)))
START_ROTATIONS: Floats = Rotation.from_euler("xyz", _ANGLES, degrees=True).as_matrix()
START_ROTATIONS = START_ROTATIONS[np.argsort(-np.trace(START_ROTATIONS, axis1=1, axis2=2), kind="stable")]
"""Rotations of the start, the identity first. Every rotation is within about 35 degrees of one of them."""
REFINED_DEG = (20.0, 10.0, 5.0)
"""Steps by which the best of them is then rotated about the three axes, in turn."""

NEAR_MM = 3.0
"""Margin around the cerebrum for comparing brains during deformation."""


@dataclass(frozen=True, eq=False)
class Registration:
    """A deformation from the earlier brain to the later one.

    `turned_deg` is the angle by which the later brain was rotated before the affine registration; `channels` are those
    that were compared.
    """

    deformation: Deformation
    turned_deg: float
    seconds: float
    channels: tuple[str, ...]


def register(earlier: Channels, later: Channels, *, smoothing: float = 1.0, threads: int = 1) -> Registration:
    """Register an earlier brain to a later one.

    The channels that both have are compared with the weights `WEIGHTS`: sums of squares for the affine map, normalised
    cross-correlation for the deformation. It starts with centroids and volumes of the cerebra matched, rotated if
    this fits clearly better (`START_ROTATIONS`, `REFINED_DEG`). The result is deterministic. InputError if greedy
    fails; `registration_quality.measure_quality` measures how good the result is. `smoothing` is a factor of
    `SMOOTHING_VOXELS`.
    """
    began = time.perf_counter()
    names = tuple(name for name in WEIGHTS if getattr(earlier, name) is not None and getattr(later, name) is not None)
    turn, start = _find_start(earlier, later, names)
    images = {f"fixed_{name}": _image(getattr(earlier, name), earlier.affine) for name in names}
    # greedy starts at the identity, so the later brain is passed in its start position
    placed = np.linalg.inv(start) @ later.affine
    images |= {f"moving_{name}": _image(getattr(later, name), placed) for name in names}
    rounds = int(np.ceil(NEAR_MM / earlier.voxel_mm))
    near_cerebrum = binary_dilation(earlier.tissue & CEREBRUM_BIT > 0, iterations=rounds)
    images["where"] = _image(near_cerebrum.astype(np.float32), earlier.affine)
    pairs = " ".join(f"-w {WEIGHTS[name]:g} -i fixed_{name} moving_{name}" for name in names)
    common = f"-threads {threads} -seed 1 -V 0"
    greedy = Greedy3D()
    output = io.StringIO()
    try:
        greedy.execute(f"{AFFINE} {common} {pairs} -ia-identity -o found", out=output, err=output, found=None, **images)
        smooth = "-s " + " ".join(f"{smoothing * voxels:g}vox" for voxels in SMOOTHING_VOXELS)
        options = f"{DEFORMABLE} {smooth} {common} {pairs} -gm where -it found"
        greedy.execute(f"{options} -o warp", out=output, err=output, warp=None)
    except RuntimeError as error:
        raise InputError(
            f"greedy cannot register the brains: {error}",
            found=f"channels {', '.join(names)}" + output.getvalue()[-500:],
            remedy="Look at both label volumes: are they of the same kind of brain, whole and in mm?",
        ) from error
    # greedy returns matrices in RAS; all else is in LPS
    matrix = start @ LPS_TO_RAS @ np.asarray(greedy["found"], dtype=float) @ LPS_TO_RAS
    # SimpleITK's arrays have reversed axes
    warp = SimpleITK.GetArrayFromImage(greedy["warp"]).transpose(2, 1, 0, 3).astype(np.float32)
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


def _find_start(earlier: Channels, later: Channels, names: tuple[str, ...]) -> tuple[Floats, Floats]:
    (first, first_size), (second, second_size) = _place(earlier), _place(later)
    scale = (second_size / first_size) ** (1 / 3)
    index = np.argwhere(earlier.cerebrum > 0.01)
    index = index[:: max(1, len(index) // N_POINTS)]
    points = transform_points(index, earlier.affine)

    def start_of(turn: Floats) -> Floats:
        return motion(scale * turn, second - scale * turn @ first)

    def difference(turn: Floats) -> float:
        at = transform_points(transform_points(points, start_of(turn)), np.linalg.inv(later.affine)).T
        squares = [
            WEIGHTS[name]
            * np.square(getattr(earlier, name)[tuple(index.T)] - map_coordinates(getattr(later, name), at, order=1))
            for name in names
        ]
        return float(np.sum([square.mean() for square in squares]))

    turn = min(START_ROTATIONS, key=difference)
    for step in REFINED_DEG:
        nearby = Rotation.from_euler("xyz", list(product((0, -step, step), repeat=3)), degrees=True)
        turn = min(nearby.as_matrix() @ turn, key=difference)
    if difference(turn) >= MAX_ROTATED_SHARE * difference(np.eye(3)):
        turn = np.eye(3)
    return turn, start_of(turn)


def _place(brain: Channels) -> tuple[Floats, float]:
    index = np.argwhere(brain.tissue & CEREBRUM_BIT > 0)
    return transform_points(index, brain.affine).mean(axis=0), len(index) * brain.voxel_mm**3
