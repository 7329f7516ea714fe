"""The elastic stretch that is carried on, and symmetric tensors as six values."""

import numpy as np

from ..geometry.triangles import Floats

UPPER = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
"""Rows and columns of the six values that a symmetric tensor is kept as."""


def packed(tensors: Floats) -> Floats:
    """Return the (..., 6) values xx, yy, zz, xy, xz, yz of (..., 3, 3) symmetric tensors."""
    return tensors[..., UPPER[0], UPPER[1]]


def unpacked(values: Floats) -> Floats:
    """Return the (..., 3, 3) symmetric tensors of (..., 6) values."""
    tensors = np.empty((*values.shape[:-1], 3, 3))
    tensors[..., UPPER[0], UPPER[1]] = values
    tensors[..., UPPER[1], UPPER[0]] = values
    return tensors


def left_stretch(Fe: Floats, power: float = 1.0) -> Floats:
    """Return V^power (..., 3, 3) of Fe = V·R: the rotation R has no stress, and an isotropic material forgets it."""
    squares, axes = np.linalg.eigh(Fe @ Fe.swapaxes(-1, -2))
    return (axes * squares[..., None, :] ** (power / 2)) @ axes.swapaxes(-1, -2)


def relaxed(V: Floats, step_gw: float, memory_gw: float) -> Floats:
    """Return (..., 3, 3) stretches after a time: the elastic strain ln V decays as exp(−t/τ), τ = `memory_gw`."""
    if np.isinf(memory_gw):
        return V
    return left_stretch(V, float(np.exp(-step_gw / memory_gw)))
