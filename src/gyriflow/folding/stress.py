"""The elastic stretch kept from step to step, and symmetric tensors stored as six values."""

import numpy as np

from ..geometry.triangles import Floats

UPPER = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
"""Rows and columns of the six values of a symmetric tensor."""


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
    """Return V^power (..., 3, 3) of Fe = V·R; an isotropic material does not depend on the rotation R."""
    squares, axes = np.linalg.eigh(Fe @ Fe.swapaxes(-1, -2))
    return (axes * squares[..., None, :] ** (power / 2)) @ axes.swapaxes(-1, -2)


def relaxed(V: Floats, step_gw: float, memory_gw: float, *, keeps_volume: bool = False) -> Floats:
    """Return stretches (..., 3, 3) after a time: the Hencky strain ln V decays as exp(−t/τ), with τ = `memory_gw`.

    With `keeps_volume` only the deviator of ln V decays.
    """
    if np.isinf(memory_gw):
        return V
    left = float(np.exp(-step_gw / memory_gw)) if memory_gw else 0.0
    stretches = left_stretch(V, left)
    if keeps_volume:
        stretches = stretches * (np.linalg.det(V) ** ((1 - left) / 3))[..., None, None]
    return stretches
