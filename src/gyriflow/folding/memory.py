"""Elastic stretch that is carried from step to step, and how it relaxes: plain NumPy on the elements of a mesh."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

UPPER = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
"""Rows and columns of the six values that a symmetric tensor is kept as."""


def packed(tensors: Floats) -> Floats:
    """Returns the (c, 6) values xx, yy, zz, xy, xz, yz of (c, 3, 3) symmetric tensors."""
    return tensors[:, UPPER[0], UPPER[1]]


def unpacked(values: Floats) -> Floats:
    """Returns the (c, 3, 3) symmetric tensors of (c, 6) values."""
    tensors = np.empty((len(values), 3, 3))
    tensors[:, UPPER[0], UPPER[1]] = values
    tensors[:, UPPER[1], UPPER[0]] = values
    return tensors


def unstretched(cells: int) -> Floats:
    """Returns the (c, 6) stretches of tissue without stress."""
    return np.tile([1.0, 1.0, 1.0, 0.0, 0.0, 0.0], (cells, 1))


def left_stretch(Fe: Floats, power: float = 1.0) -> Floats:
    """Returns V^power (c, 3, 3) of Fe = V·R: the rotation R has no stress, and an isotropic material forgets it."""
    squares, axes = np.linalg.eigh(Fe @ Fe.transpose(0, 2, 1))
    return (axes * squares[:, None, :] ** (power / 2)) @ axes.transpose(0, 2, 1)


def relaxed(V: Floats, step_gw: float, memory_gw: float) -> Floats:
    """Returns (c, 3, 3) stretches after a time: the elastic strain ln V decays as exp(−t/τ), τ = `memory_gw`."""
    if np.isinf(memory_gw):
        return V
    return left_stretch(V, float(np.exp(-step_gw / memory_gw)))
