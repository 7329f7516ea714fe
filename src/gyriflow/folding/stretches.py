"""Deformation gradients of elements, their stretches, and symmetric tensors stored as
six values."""

import numpy as np

from ..geometry.jacobians import chunks, cofactors_of
from ..geometry.triangles import Floats, Indices, Mask
from .compilation import library_of, pointer

DECLARATION = """
void deformations(long count, long points, long nodes, void *cells, void *before,
                  void *after, void *slopes, void *F);
void inverses_and_strains(long count, void *F, void *inverse, void *strains);
"""
MIN_SQUARED_STRETCH = 1e-6
"""Squared principal stretches below this count as this: those of flat elements."""
ROUND_OFF = 1e-12
"""Difference from 1 below which tissue grows by its whole stretch."""
ROWS = np.array([0, 1, 2, 0, 0, 1])
COLUMNS = np.array([0, 1, 2, 1, 2, 2])
"""Rows and columns of the six values of a symmetric tensor."""


def packed(tensors: Floats) -> Floats:
    """Return the (..., 6) values xx, yy, zz, xy, xz, yz of (..., 3, 3) symmetric
    tensors."""
    return tensors[..., ROWS, COLUMNS]


def unpacked(values: Floats) -> Floats:
    """Return the (..., 3, 3) symmetric tensors of (..., 6) values."""
    tensors = np.empty(
        (
            *values.shape[:-1],
            3,
            3,
        )
    )
    tensors[..., ROWS, COLUMNS] = values
    tensors[..., COLUMNS, ROWS] = values
    return tensors


def deformation_gradients(
    before: Floats,
    after: Floats,
    cells: Indices,
    slopes: Floats,
) -> Floats:
    """Return the (c, q, 3, 3) deformation gradients F = ∂x_after/∂x_before of
    tetrahedra at points inside them.

    Positions of the nodes are (k, 3) in one unit, `cells` (c, n) their indices; the
    elements have a volume before. `slopes` (q, n, 3) are the gradients of the nodes'
    shape functions in the regular element, at the points.
    """
    shape = len(cells), len(slopes), 3, 3
    found = np.empty(shape)
    interface, code = library_of(__file__, DECLARATION)
    arrays = []
    for array, dtype in (
        (cells, np.int32),
        (before, np.float64),
        (after, np.float64),
        (slopes, np.float64),
    ):
        values = np.ascontiguousarray(array, dtype=dtype)
        arrays.append(pointer(interface, values, dtype, values.size))
    code.deformations(
        *shape[:2],
        cells.shape[1],
        *arrays,
        pointer(interface, found, np.float64, found.size, is_written=True),
    )
    return found


def inverse_growth(
    F: Floats,
    power: Floats,
    limit: float,
) -> tuple[Floats, Mask]:
    """Return the inverse (..., 3, 3) of growth by U^power of F = R·U, with one power
    for each, and where U is limited.

    Principal values of ln U beyond the `limit` count as this. Where growth is the whole
    of U, and surely below the limit, it is F⁻¹ = U⁻¹·Rᵀ, which costs less: an isotropic
    material does not depend on the rotation.
    """
    is_whole = np.abs(power - 1) < ROUND_OFF
    inverse, strains = _inverse_and_strain(F.reshape(-1, 3, 3))
    inverse = inverse.reshape(F.shape)
    is_whole &= strains.reshape(is_whole.shape) < 1 - np.exp(-2 * limit)
    others = ~is_whole
    stretched = F[others]
    logs, axes = _principal_logs(stretched.swapaxes(-1, -2) @ stretched)
    limited = np.clip(logs, -limit, limit)
    powers = power[others][:, None]
    inverse[others] = from_principal(
        np.exp(-powers * limited),
        axes,
    )
    is_limited = np.zeros(is_whole.shape, dtype=bool)
    is_limited[others] = np.abs(logs).max(axis=-1) > limit
    return inverse, is_limited


def _inverse_and_strain(F: Floats) -> tuple[Floats, Floats]:
    """Return the inverse of (n, 3, 3) matrices, and the norm (n,) of FᵀF − 1.

    Singular ones, whose strain is large, have another one in place of their inverse.
    """
    count = len(F)
    inverse = np.empty((count, 3, 3))
    strains = np.empty(count)
    interface, code = library_of(__file__, DECLARATION)
    code.inverses_and_strains(
        count,
        pointer(interface, F, np.float64, 9 * count),
        pointer(interface, inverse, np.float64, 9 * count, is_written=True),
        pointer(interface, strains, np.float64, count, is_written=True),
    )
    return inverse, strains


def _principal_logs(squared: Floats) -> tuple[Floats, Floats]:
    """Return the logarithms (..., 3) of the principal stretches, and their axes, from
    FᵀF or F·Fᵀ."""
    squares, axes = np.linalg.eigh(squared)
    return 0.5 * np.log(np.maximum(squares, MIN_SQUARED_STRETCH)), axes


def from_principal(values: Floats, axes: Floats) -> Floats:
    """Return the symmetric (..., 3, 3) matrices with eigenvalues (..., 3) and
    eigenvectors (..., 3, 3) in columns."""
    return np.asarray((axes * values[..., None, :]) @ axes.swapaxes(-1, -2))


def log_stretch(
    F: Floats,
    *,
    left: bool = False,
    limit: float = np.inf,
) -> Floats:
    """Return the Hencky strain (..., 3, 3): ln U of F = R·U, in axes before F, or the
    `left` ln V of F = V·R.

    Principal values beyond the `limit` count as this.
    """
    turned = F.swapaxes(-1, -2)
    squared = F @ turned if left else turned @ F
    logs = np.empty_like(squared)
    for chunk in chunks(len(squared)):
        logs[chunk] = _limited_logs(squared[chunk], limit)
    return logs


def _limited_logs(squared: Floats, limit: float) -> Floats:
    """Return ½ ln C (c, 3, 3) of symmetric matrices, with eigenvalues up to a limit.

    A polynomial in C through the values at its eigenvalues λ (Newton's form): the three
    are known from the invariants (Smith 1961, 10.1145/355578.366316), without axes.
    """
    ones = np.eye(3)
    C = squared.transpose(1, 2, 0)
    mean = (C[0, 0] + C[1, 1] + C[2, 2]) / 3
    B = C - mean * ones[:, :, None]
    size = np.sqrt((B**2).sum(axis=(0, 1)) / 6)
    size = np.maximum(size, 1e-9 * mean)
    half_det = (B[0] * cofactors_of(B)[0]).sum(axis=0) / (2 * size**3)
    angle = np.arccos(np.clip(half_det, -1.0, 1.0)) / 3
    a = 2 * np.cos(angle)
    c = 2 * np.cos(angle + 2 * np.pi / 3)
    ends = [a, -a - c, c]
    logs = []
    for end in ends:
        square = np.maximum(mean + size * end, MIN_SQUARED_STRETCH)
        logs.append(
            np.clip(
                0.5 * np.log(square),
                -limit,
                limit,
            )
        )
    # of (C - mean) / size
    a, b, c = ends
    gaps = [np.maximum(gap, 1e-6) for gap in (a - b, b - c, a - c)]
    first = (logs[0] - logs[1]) / gaps[0]
    second = (logs[1] - logs[2]) / gaps[1]
    curve = (first - second) / gaps[2]
    unit = B / size
    near_a = unit - a * ones[:, :, None]
    near_b = unit - b * ones[:, :, None]
    products = np.einsum("ije,jke->ike", near_a, near_b)
    found = logs[0] * ones[:, :, None] + first * near_a + curve * products
    return found.transpose(2, 0, 1)


def left_stretch(Fe: Floats, power: float = 1.0) -> Floats:
    """Return V^power (..., 3, 3) of Fe = V·R; an isotropic material does not depend on
    the rotation R."""
    squares, axes = np.linalg.eigh(Fe @ Fe.swapaxes(-1, -2))
    return from_principal(squares ** (power / 2), axes)


def relaxed(
    V: Floats,
    step_gw: float,
    memory_gw: float,
) -> Floats:
    """Return stretches (..., 3, 3) after a time: the Hencky strain ln V decays as
    exp(−t/τ), with τ = `memory_gw`."""
    if np.isinf(memory_gw):
        return V
    left = float(np.exp(-step_gw / memory_gw))
    return left_stretch(V, left)
