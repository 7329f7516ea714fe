"""A synthetic fetal brain as a label volume: plausible in size and outline, no anatomy
of anyone.

Its folds are a random pattern that deepens with age.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gyriflow.units import ML_PER_MM3

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

FIRST_WEEK, LAST_WEEK = 21.0, 36.0
WHITE, VENTRICLES, CEREBELLUM, CSF, CORTEX, DEEP_GREY, BRAINSTEM, CALLOSUM = range(1, 9)

# half lengths (left-right, anterior-posterior, inferior-superior) for an ellipsoid of
# half length one in y; the proportions of the cerebrum in the atlas of Fidon et al.
# 2021 (doi 10.5281/zenodo.5524312)
PROPORTIONS = np.array([0.75, 1.0, 0.77])
# where the brain's centre lies in the world, off the origin on purpose
CENTRE_MM = np.array([4.3, -12.7, 8.9])
MARGIN_MM = 6.0
CORTEX_MM = 2.0
# voxels for finding the size: fine across the fissure
COARSE_MM = (0.4, 2.4, 2.4)
# the volume is stored with axes that point posterior, inferior, right, on purpose:
# columns of the affine
STORED_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
# the flat underside of the cerebrum, in half heights below the centre, and how much
# higher it is in front
BASE = 0.68
FRONTAL_BASE = 0.16
# sulci are where a random field of unit variance is within about this of zero
SULCUS_WIDTH = 0.5


@dataclass(frozen=True)
class Shape:
    """What a phantom's form depends on, in mm; the ventricles' size is relative to the
    brain."""

    half_length: float
    fold_depth: float
    sylvian_depth: float
    fissure: float
    ventricles: float


def cerebral_volume_ml(week: float) -> float:
    """Return the volume of a phantom's cerebrum in mL: 48 at 21 GW, as in the atlas of
    the demo."""
    t = week - 21.0
    return float(48.0 * np.exp(0.160 * t - 0.00264 * t**2))


def phantom_labels(
    week: float, *, voxel_mm: float | tuple[float, float, float] = 0.8, seed: int = 0
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Return the (i, j, k) labels of a synthetic brain of 21 to 36 GW and their (4, 4)
    affine to RAS+ mm.

    Labels are those of the scheme spina-bifida-atlas. Voxels have one edge, or three
    along x, y and z. The axes are stored in the order posterior, inferior, right. The
    same seed gives the same folds at every week, the
    deeper the older.
    """
    edges_mm = np.broadcast_to(voxel_mm, 3)
    age = (week - FIRST_WEEK) / (LAST_WEEK - FIRST_WEEK)
    shape = Shape(
        half_length=28.0 * (cerebral_volume_ml(week) / 48.0) ** (1 / 3),
        fold_depth=0.6 + 8.4 * age**1.2,
        sylvian_depth=3.0 + 11.0 * age,
        fissure=max(2.0 + 1.5 * age, 2.5 * edges_mm[0]),
        ventricles=1.0 - 0.45 * age,
    )
    # sizes are found on a coarse grid; folds and fissure keep theirs, so this takes two
    # rounds
    for _ in range(2):
        points = _grid(shape, COARSE_MM)
        volume = (
            float(_cerebrum(points, shape, seed)[0].sum())
            * np.prod(COARSE_MM)
            * ML_PER_MM3
        )
        factor = (cerebral_volume_ml(week) / volume) ** (1 / 3)
        shape = Shape(**{**vars(shape), "half_length": shape.half_length * factor})
    points = _grid(shape, tuple(edges_mm))
    labels = _tissues(points, shape, seed, edges_mm)
    # from axes R, A, S to P, I, R
    stored = labels[:, ::-1, ::-1].transpose(1, 2, 0)
    affine = np.eye(4)
    affine[:3, :3] = STORED_AXES * np.roll(edges_mm, -1)
    first = np.array(
        [points[0][0, 0, 0], points[1][0, -1, 0], points[2][0, 0, -1]], dtype=float
    )
    affine[:3, 3] = CENTRE_MM + first
    return np.ascontiguousarray(stored, dtype=np.int32), affine


def _grid(shape: Shape, voxel_mm: tuple[float, ...]) -> list[Floats]:
    """Return open x, y, z coordinates (RAS, mm from the brain's centre) of a grid
    around the whole brain."""
    half = shape.half_length * PROPORTIONS * 1.12 + MARGIN_MM
    below = half + np.array([0.0, 0.0, 0.45 * shape.half_length])
    axes = [
        np.arange(-a, b, step, dtype=np.float32)
        for a, b, step in zip(below, half, voxel_mm, strict=True)
    ]
    return list(np.meshgrid(*axes, indexing="ij", sparse=True))


def _pattern(
    directions: tuple[Floats, Floats, Floats], frequency: float, seed: int
) -> Floats:
    """Return a smooth random field of unit variance on the sphere of directions: a sum
    of plane waves."""
    random = np.random.default_rng(seed)
    waves = random.normal(size=(16, 3))
    waves *= (
        frequency
        * random.uniform(0.8, 1.2, size=(16, 1))
        / np.linalg.norm(waves, axis=1, keepdims=True)
    )
    phases = random.uniform(0.0, 2.0 * np.pi, 16)
    field = np.zeros_like(directions[0])
    for wave, phase in zip(
        waves.astype(np.float32), phases.astype(np.float32), strict=True
    ):
        field += np.cos(
            wave[0] * directions[0]
            + wave[1] * directions[1]
            + wave[2] * directions[2]
            + phase
        )
    return field / np.float32(np.sqrt(8.0))


def _cerebrum(points: list[Floats], shape: Shape, seed: int) -> tuple[Mask, Floats]:
    """Return the cerebrum's mask and the depth in mm below the smooth outline, both on
    the grid of `points`.

    Outline and folds are star-shaped around the centre and the fissure is open to the
    outside, so that the mask has no handles.
    """
    x, y, z = points
    half = (shape.half_length * PROPORTIONS).astype(np.float32)
    # wider on the right in front and on the left behind (the torque of real brains)
    p = x / (half[0] * (1 + 0.02 * np.tanh(x / 5) * y / half[1]))
    q = y / half[1]
    r = z / half[2]
    rho = np.sqrt(p**2 + q**2 + r**2) + np.float32(1e-6)
    u, v, w = p / rho, q / rho, r / rho
    # temporal lobes, narrower frontal lobes, a flat base that is higher under the
    # frontal lobes
    outline = (
        1.0
        + 0.16 * _bump(np.abs(u), v, w, (0.72, 0.22, -0.66), 0.30)
        - 0.05 * np.maximum(v, 0.0) ** 2
    )
    base = (BASE - FRONTAL_BASE / (1.0 + np.exp((0.42 - v) / 0.05))) / np.maximum(
        -w, 1e-3
    )
    outline = -0.03 * np.logaddexp(-outline / 0.03, -base / 0.03)
    depth = (outline - rho) * np.sqrt(x**2 + y**2 + z**2) / rho
    inside = depth > 0
    # folds reach only so far: the rest need not be looked at
    shell = inside & (depth < shape.fold_depth + shape.sylvian_depth)
    inside[shell] = depth[shell] > _sulcal_depth(
        (u[shell], v[shell], w[shell]), shape, seed
    )
    # a fissure that bends to and fro: with this frequency, a root of tan k = k, it has
    # no tilt on the whole
    middle = 0.01 * half[0] * np.sin(4.493 * y / half[1])
    slit = (np.abs(x - middle) < 0.5 * shape.fissure) & ~_joint(
        y / half[1], z / half[2]
    )
    return inside & ~slit, depth


def _sulcal_depth(
    directions: tuple[Floats, Floats, Floats], shape: Shape, seed: int
) -> Floats:
    """Return how deep the folds are (mm) in each of the (n,) directions u, v, w.

    Sulci run along the zero lines of random fields, nearly the same in both
    hemispheres; on each side is a Sylvian dent, which lengthens backwards and upwards.
    """
    u, v, w = directions
    side = np.abs(u)
    sylvian = np.max(
        [
            _bump(side, v, w, (0.86, 0.42, -0.30), 0.17),
            0.95 * _bump(side, v, w, (0.95, 0.20, -0.20), 0.15),
            0.7 * _bump(side, v, w, (0.98, -0.06, -0.06), 0.12),
            0.5 * _bump(side, v, w, (0.96, -0.28, 0.08), 0.10),
        ],
        axis=0,
    )
    early = 0.85 * _pattern((side, v, w), 9.0, seed) + 0.5 * _pattern(
        (u, v, w), 9.0, seed + 1
    )
    return np.maximum(
        shape.sylvian_depth * sylvian,
        shape.fold_depth * np.exp(-((early / SULCUS_WIDTH) ** 2)),
    )


def _bump(
    u: Floats, v: Floats, w: Floats, centre: tuple[float, float, float], width: float
) -> Floats:
    """Return a bell of height one on the sphere of directions around `centre`, `width`
    in radians."""
    at = np.array(centre) / np.linalg.norm(centre)
    return np.exp(
        -((u - at[0]) ** 2 + (v - at[1]) ** 2 + (w - at[2]) ** 2) / (2.0 * width**2)
    ).astype(np.float32)


def _joint(q: Floats, r: Floats) -> Mask:
    """Return where, seen from the side, tissue joins the hemispheres: below the
    callosum down to the base."""
    arch = ((q - 0.05) / 0.50) ** 2 + ((r + 0.15) / 0.42) ** 2 < 1.0
    return arch | ((np.abs(q - 0.05) < 0.30) & (r < -0.15))


def _ellipsoid(
    points: list[Floats],
    centre: tuple[float, float, float],
    half: tuple[float, float, float],
) -> Mask:
    x, y, z = ((c - m) / h for c, m, h in zip(points, centre, half, strict=True))
    return x**2 + y**2 + z**2 < 1.0


def _tissues(
    points: list[Floats], shape: Shape, seed: int, edges_mm: Floats
) -> NDArray[np.int32]:
    """Return the labels on the grid of `points`."""
    x, y, z = points
    a, b, c = shape.half_length * PROPORTIONS
    cerebrum, outline_depth = _cerebrum(points, shape, seed)
    labels = np.zeros(cerebrum.shape, dtype=np.int32)
    labels[outline_depth > -2.5] = CSF
    labels[
        _ellipsoid(points, (0.0, -0.55 * b, -0.88 * c), (0.46 * a, 0.32 * b, 0.30 * c))
    ] = CEREBELLUM
    labels[
        _ellipsoid(points, (0.0, -0.08 * b, -0.95 * c), (0.17 * a, 0.17 * b, 0.50 * c))
    ] = BRAINSTEM
    labels[cerebrum] = WHITE
    both = [np.abs(x), y, z]
    labels[
        cerebrum
        & _ellipsoid(
            both, (0.24 * a, 0.04 * b, -0.18 * c), (0.26 * a, 0.26 * b, 0.24 * c)
        )
    ] = DEEP_GREY
    size = shape.ventricles
    ventricles = _ellipsoid(
        [both[0], y, z + 0.25 * y**2 / b],
        (0.24 * a, -0.05 * b, 0.10 * c),
        (0.13 * a * size, 0.50 * b, 0.15 * c * size),
    )
    labels[cerebrum & ventricles] = VENTRICLES
    depth = ndimage.distance_transform_edt(cerebrum, sampling=edges_mm)
    cortex = cerebrum & (depth <= CORTEX_MM)
    # no cortex where the brainstem leaves the cerebrum, nor on the callosum
    from_stem = ndimage.distance_transform_edt(labels != BRAINSTEM, sampling=edges_mm)
    stem = from_stem <= CORTEX_MM + edges_mm.max()
    labels[cortex & ~stem] = CORTEX
    arch = ((y / b - 0.05) / 0.50) ** 2 + ((z / c + 0.15) / 0.42) ** 2
    callosum = (np.abs(x) < 0.16 * a) & (arch > 0.72) & (arch < 1.02) & (z > -0.1 * c)
    labels[cerebrum & callosum] = CALLOSUM
    return labels
