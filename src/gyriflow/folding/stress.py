"""Measures of the deformation and stress of elements, and the stretch that is carried on: NumPy on whole arrays.

The tensors of a step, elastic deformation and stress, come from the problem that was solved (`Problem.outcome`). Arrays
of tensors are (c, 3, 3), of scalars (c,).
"""

import numpy as np
from numpy.typing import NDArray

from ..geometry.triangles import Floats

Ints = NDArray[np.integer]
UPPER = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
"""Rows and columns of the six values that a symmetric tensor is kept as."""


def deformation_gradients(before: Floats, after: Floats, cells: Ints, slopes: Floats) -> Floats:
    """Returns the (c, q, 3, 3) deformation gradients F = ∂x_after/∂x_before of tetrahedra at points inside them.

    Positions of the nodes are (k, 3) in one unit, `cells` (c, n) their indices; the elements have a volume before.
    `slopes` (q, n, 3) are the gradients of the nodes' shape functions in the regular element, at the points.
    """
    # the transposed maps from the regular element: those after = those before · Fᵀ
    first, second = (np.matmul(slopes.transpose(0, 2, 1), x[cells][:, None]) for x in (before, after))
    return np.asarray(np.linalg.solve(first, second), dtype=np.float64).swapaxes(-1, -2)


def pressure(stress: Floats) -> Floats:
    """Returns the (c,) pressures −tr(σ)/3, positive where tissue is pressed, in the unit of the stress."""
    return -np.trace(stress, axis1=1, axis2=2) / 3


def von_mises(stress: Floats) -> Floats:
    """Returns the (c,) equivalent stresses √(3/2 dev σ : dev σ), in the unit of the stress."""
    mean = (np.trace(stress, axis1=1, axis2=2) / 3)[:, None, None] * np.eye(3)
    return np.sqrt(1.5) * np.linalg.norm(stress - mean, axis=(1, 2))


def principal_stretches(F: Floats) -> Floats:
    """Returns the (c, 3) principal stretches of (c, 3, 3) deformation gradients, ascending."""
    # twice as fast as singular values
    return np.sqrt(np.linalg.eigvalsh(F @ F.transpose(0, 2, 1)))


def hencky_equivalent(F: Floats) -> Floats:
    """Returns the (c,) equivalent strains √(2/3 dev h : dev h) of the Hencky strain h = ln V.

    It is 0 where the shape is unchanged, and the logarithm of the stretch in a bar drawn out at constant volume.
    """
    h = np.log(principal_stretches(F))
    return np.sqrt(2 / 3) * np.linalg.norm(h - h.mean(axis=1, keepdims=True), axis=1)


def green_lagrange_maximum(F: Floats) -> Floats:
    """Returns the (c,) largest principal values of the Green-Lagrange strain (FᵀF − I)/2."""
    return (principal_stretches(F)[:, -1] ** 2 - 1) / 2


def areal_stretch(F: Floats, N: Floats) -> Floats:
    """Returns the (c,) ratios of areas, after to before, of planes with unit normals N (c, 3) before: det F·|F⁻ᵀ·N|."""
    rows = np.linalg.solve(F.transpose(0, 2, 1), N[:, :, None])[:, :, 0]
    return np.linalg.det(F) * np.linalg.norm(rows, axis=1)


def packed(tensors: Floats) -> Floats:
    """Returns the (..., 6) values xx, yy, zz, xy, xz, yz of (..., 3, 3) symmetric tensors."""
    return tensors[..., UPPER[0], UPPER[1]]


def unpacked(values: Floats) -> Floats:
    """Returns the (..., 3, 3) symmetric tensors of (..., 6) values."""
    tensors = np.empty((*values.shape[:-1], 3, 3))
    tensors[..., UPPER[0], UPPER[1]] = values
    tensors[..., UPPER[1], UPPER[0]] = values
    return tensors


def left_stretch(Fe: Floats, power: float = 1.0) -> Floats:
    """Returns V^power (..., 3, 3) of Fe = V·R: the rotation R has no stress, and an isotropic material forgets it."""
    squares, axes = np.linalg.eigh(Fe @ Fe.swapaxes(-1, -2))
    return (axes * squares[..., None, :] ** (power / 2)) @ axes.swapaxes(-1, -2)


def relaxed(V: Floats, step_gw: float, memory_gw: float) -> Floats:
    """Returns (..., 3, 3) stretches after a time: the elastic strain ln V decays as exp(−t/τ), τ = `memory_gw`."""
    if np.isinf(memory_gw):
        return V
    return left_stretch(V, float(np.exp(-step_gw / memory_gw)))
