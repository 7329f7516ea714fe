"""Small waves on a growing slab: the model's steps, linearised around the flat state
without other approximations.

The slab is flat and wide, clamped at its base and held at its sides. Its surface has
waves h·cos(kx), so small that they do not interact. Every change in a step is then a
function of depth times cos(kx) or sin(kx), and the step is a system in depth alone: the
first-order terms of the model's own step, with its finite growth, weights that follow
the surface, surface normals, compressible material and remembered stress. Derivatives
are complex steps, exact to rounding.

Tensors contain amplitudes as imaginary parts: of cos(kx) on the diagonal, of sin(kx) at
xz and zx. Lengths are in cortical thicknesses H, shear moduli relative to the core, and
time is the growth of the cortex since the start.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cholesky_banded, solve_banded

Floats = NDArray[np.float64]

TINY = 1e-30
"""The complex step; the error is of second order."""
ENTRIES = ((0, 0), (0, 2), (2, 0), (2, 2))
"""Entries xx, xz, zx, zz of a gradient in the plane of a wave."""


@dataclass(frozen=True)
class Slab:
    """A slab and its resolution.

    Attributes
    ----------
    contrast
        Shear modulus of the cortex over that of the core.
    memory
        Growth during which stress relaxes; 0 releases it at each step, infinity keeps
        it.
    steepness
        Steepness of the cortical weight, 10 in the model; infinite for a sharp border.
    thickness
        1, or infinity if the whole slab is cortex.
    finest
        Height of the elements near the surface.
    """

    contrast: float
    poisson_ratio: float = 0.45
    depth: float = 24.0
    memory: float = 0.0
    steepness: float = 10.0
    thickness: float = 1.0
    finest: float = 0.02


@dataclass(frozen=True, eq=False)
class Waves:
    """State of the waves after some growth.

    Attributes
    ----------
    z : (n + 1,) float
        Heights of the flat slab's nodes, from the base to the surface.
    stretch : (n, 3) float
        Elastic stretch V of the flat slab's elements: xx, yy, zz.
    wavenumber : (k,) float
    moved : (k, n + 1, 2) float
        Amplitudes of the nodes' positions: of sin(kx) along x, of cos(kx) along z.
    stretched : (k, n, 3, 3) float
        Amplitudes of V.
    """

    z: Floats
    stretch: Floats
    wavenumber: Floats
    moved: Floats
    stretched: Floats

    @property
    def height(self) -> Floats:
        """Amplitudes (k,) of the surface."""
        return self.moved[:, -1, 1]


class Fields(NamedTuple):
    """State at the start of a step in each element of each wave, (k, n, …): flat values
    plus imaginary amplitudes.

    `place` is the gradient of the present shape x(X) over the flat slab X.
    """

    place: NDArray
    stretch: NDArray
    mu: NDArray
    growth: NDArray
    normal: NDArray


def at_start(slab: Slab, wavenumber: Floats) -> Waves:
    """Return waves of height 1 on a slab without stress."""
    heights = [slab.finest]
    while sum(heights) < slab.depth:
        heights.append(
            heights[-1] * (1 + 1.5 * slab.finest if sum(heights) > 2 else 1.0)
        )
    z = -np.concatenate([[0.0], np.cumsum(heights)])[::-1]
    # only below the cortex, so that its border stays between two elements
    z = np.where(z < -2, -2 + (z + 2) * (slab.depth - 2) / (-z[0] - 2), z)
    moved = np.zeros((len(wavenumber), len(z), 2))
    # without stress, it does not matter how the inside follows the surface
    moved[:, :, 1] = (1 - z / z[0]) ** 2
    count = len(z) - 1
    return Waves(
        z,
        np.ones((count, 3)),
        np.asarray(wavenumber),
        moved,
        np.zeros((len(wavenumber), count, 3, 3)),
    )


def weight(slab: Slab, depth: NDArray) -> NDArray:
    """Return the cortical weight w = 1/(1 + exp(s (d/H − 1))) at depths d, complex ones
    included."""
    if np.isinf(slab.thickness):
        return np.ones_like(depth)
    if np.isinf(slab.steepness):
        return (depth.real < 1).astype(depth.dtype)
    exponent = slab.steepness * (depth - 1)
    return 1 / (1 + np.exp(np.where(exponent.real > 200, 200, exponent)))


def fields_of(slab: Slab, waves: Waves, growth: float) -> Fields:
    """Return the fields of a step with this growth of the cortex."""
    middle, _ = values_in_elements(waves.moved, waves.z)
    # depth of a moved element below the wavy surface
    depth = waves.z[-1] - (waves.z[1:] + waves.z[:-1]) / 2 + 0j
    w = weight(slab, depth + 1j * TINY * (waves.height[:, None] - middle[:, :, 1]))
    normal = np.zeros((*w.shape, 3), dtype=complex)
    normal[..., 2] = 1.0
    normal[..., 0] = 1j * TINY * (waves.wavenumber * waves.height)[:, None]
    stretch = waves.stretch[:, :, None] * np.eye(3) + 1j * TINY * waves.stretched
    mu = 1 + (slab.contrast - 1) * w
    place = np.eye(3) + 1j * TINY * gradient(waves, waves.moved)
    return Fields(
        place, stretch, mu[..., None, None], growth * w[..., None, None], normal
    )


def values_in_elements(nodal: Floats, z: Floats) -> tuple[Floats, Floats]:
    """Return means and slopes along z, in the elements, of (k, n + 1, 2) values at the
    nodes."""
    return (nodal[:, 1:] + nodal[:, :-1]) / 2, np.diff(nodal, axis=1) / np.diff(z)[
        :, None
    ]


def gradient(waves: Waves, nodal: Floats) -> Floats:
    """Return the amplitudes (k, n, 3, 3) of the gradient of (p sin kx, q cos kx) with
    (k, n + 1, 2) values p, q."""
    middle, slope = values_in_elements(nodal, waves.z)
    amplitudes = np.zeros((*middle.shape[:2], 3, 3))
    amplitudes[..., 0, 0] = waves.wavenumber[:, None] * middle[..., 0]
    amplitudes[..., 2, 0] = -waves.wavenumber[:, None] * middle[..., 1]
    amplitudes[..., [0, 2], 2] = slope
    return amplitudes


def elastic_parts(after: NDArray, fields: Fields) -> tuple[NDArray, NDArray]:
    """Return B = G⁻¹·V·Fg⁻¹ and Fe = A·B; A and G are the gradients of the shapes after
    and before a step."""
    along_normal = fields.normal[..., :, None] * fields.normal[..., None, :]
    growth_inverse = (np.eye(3) - along_normal) / (1 + fields.growth) + along_normal
    before = np.linalg.inv(fields.place) @ fields.stretch @ growth_inverse
    return before, after @ before


def stress(slab: Slab, after: NDArray, fields: Fields) -> NDArray:
    """Return ∂/∂A of the energy ψ(Fe)·det G/det V per volume of the flat slab."""
    mu = fields.mu
    ratio = 2 * (1 + slab.poisson_ratio) / (3 * (1 - 2 * slab.poisson_ratio))
    before, Fe = elastic_parts(after, fields)
    J = np.linalg.det(Fe)[..., None, None]
    cofactor = np.swapaxes(np.linalg.inv(Fe), -1, -2)
    trace = (Fe**2).sum(axis=(-1, -2))[..., None, None]
    by_Fe = (
        mu * J ** (-2 / 3) * (Fe - trace / 3 * cofactor)
        + ratio * mu * (J - 1) * J * cofactor
    )
    volumes = np.linalg.det(fields.place) / np.linalg.det(fields.stretch)
    return by_Fe @ np.swapaxes(before, -1, -2) * volumes[..., None, None]


def flat_step(slab: Slab, fields: Fields) -> tuple[Floats, Floats]:
    """Return the gradients (n, 3, 3) of a step of the flat slab, which rises freely,
    and its tangents by `ENTRIES`."""
    flat = Fields(*(values[0].real for values in fields))
    A = np.tile(np.eye(3), (len(flat.mu), 1, 1))

    def slopes(i: int, j: int) -> Floats:
        moved = A.astype(complex)
        moved[:, i, j] += 1j * TINY
        return stress(slab, moved, flat).imag / TINY

    for _ in range(8):
        A[:, 2, 2] -= stress(slab, A, flat)[:, 2, 2] / slopes(2, 2)[:, 2, 2]
    rows, columns = np.transpose(ENTRIES)
    return A, np.stack([slopes(i, j)[:, rows, columns] for i, j in ENTRIES], axis=2)


def banded_system(
    waves: Waves, index: int, tangents: Floats, forces: Floats
) -> tuple[Floats, Floats]:
    """Return stiffness (9 bands) and load of one wave, the base fixed, from tangents
    and stresses by `ENTRIES`."""
    k, dz = waves.wavenumber[index], np.diff(waves.z)
    B = np.zeros((len(dz), 4, 4))  # of p, q at the lower and p, q at the upper node
    B[:, 0, [0, 2]] = k / 2
    B[:, 2, [1, 3]] = -k / 2
    B[:, [1, 3], [0, 1]] = -1 / dz[:, None]
    B[:, [1, 3], [2, 3]] = 1 / dz[:, None]
    stiffness = np.einsum("e,eri,ers,esj->eij", dz, B, tangents, B)
    loads = np.einsum("e,eri,er->ei", dz, B, forces)
    bands, load = np.zeros((9, 2 * len(waves.z))), np.zeros(2 * len(waves.z))
    first = 2 * np.arange(len(dz))
    for i in range(4):
        np.add.at(load, first + i, loads[:, i])
        for j in range(4):
            np.add.at(bands, (4 + i - j, first + j), stiffness[:, i, j])
    return bands[:, 2:], load[2:]


def step(slab: Slab, waves: Waves, growth: float) -> Waves:
    """Return the waves after a step with this growth of the cortex."""
    fields = fields_of(slab, waves, growth)
    A, tangents = flat_step(slab, fields)
    rows, columns = np.transpose(ENTRIES)
    still = A + 1j * TINY * gradient(waves, waves.moved)
    forces = stress(slab, still, fields)[:, :, rows, columns].imag / TINY
    u = np.zeros_like(waves.moved)
    for index in range(len(u)):
        bands, load = banded_system(waves, index, tangents, forces[index])
        u[index, 1:] = solve_banded((4, 4), bands, -load).reshape(-1, 2)
    z = waves.z[0] + np.concatenate([[0.0], np.cumsum(A[:, 2, 2] * np.diff(waves.z))])
    after = replace(waves, z=z, moved=waves.moved + u)
    if slab.memory == 0:
        return after
    _, Fe = elastic_parts(still + 1j * TINY * gradient(waves, u), fields)
    stretch, amplitudes = relaxed_stretch(Fe, float(np.exp(-growth / slab.memory)))
    return replace(after, stretch=stretch, stretched=amplitudes)


def relaxed_stretch(Fe: NDArray, part: float) -> tuple[Floats, Floats]:
    """Return V^part of the flat slab (n, 3) and its amplitudes (k, n, 3, 3), V² =
    Fe·Feᵀ.

    The derivative of a power of a tensor at a diagonal one multiplies its entries by
    divided differences.
    """
    b = np.diagonal(Fe[0].real, axis1=1, axis2=2) ** 2
    gap = b[:, :, None] - b[:, None, :]
    near = np.abs(gap) < 1e-9
    power = b ** (part / 2)
    at_once = part / 2 * b[:, :, None] ** (part / 2 - 1)
    divided = np.where(
        near,
        at_once,
        (power[:, :, None] - power[:, None, :]) / np.where(near, 1.0, gap),
    )
    return power, divided * (Fe @ np.swapaxes(Fe, -1, -2)).imag / TINY


def amplifications(slab: Slab, wavenumber: Floats, growth: float, steps: int) -> Floats:
    """Return the (steps + 1, k) heights of waves over those at the start, after equal
    steps."""
    waves, heights = at_start(slab, wavenumber), [np.ones(len(wavenumber))]
    for _ in range(steps):
        waves = step(slab, waves, growth)
        heights.append(waves.height)
    return np.array(heights)


def growth_rates(slab: Slab, wavenumber: Floats, growth: float = 1e-6) -> Floats:
    """Return the (k,) rates ln(h'/h)/growth of the first step; without stress memory,
    they are those of all steps."""
    return np.log(amplifications(slab, wavenumber, growth, 1)[1]) / growth


def critical_growth(
    slab: Slab, wavenumber: Floats, growth: float, max_growth: float
) -> Floats:
    """Return the growth at which the flat slab becomes unstable to each wave; NaN if it
    is beyond `max_growth`.

    With stress kept, the tangent of a step without growth is then no longer positive
    definite.
    """
    waves = at_start(slab, wavenumber)
    found = np.full(len(wavenumber), np.nan)
    grown = 0.0
    while np.isnan(found).any() and grown <= max_growth:
        _, tangents = flat_step(slab, fields_of(slab, waves, 0.0))
        for index in np.flatnonzero(np.isnan(found)):
            bands, _ = banded_system(
                waves, index, tangents, np.zeros((len(tangents), 4))
            )
            try:
                cholesky_banded(bands[4:], lower=True)
            except LinAlgError:
                found[index] = grown
        waves = step(slab, waves, growth)
        grown = (1 + grown) * (1 + growth) - 1
    return found
