"""Deformation, strain and stress per element, from positions and the fields of a step: plain NumPy on whole arrays.

An element has one constant deformation gradient, and one value each of stiffness, growth and normal (the mean of its
vertices' values), as in the solve. Arrays of tensors are (c, 3, 3), of scalars (c,).
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]


def deformation_gradients(before: Floats, after: Floats, cells: Ints) -> Floats:
    """Returns the (c, 3, 3) deformation gradients F = ∂x_after/∂x_before of linear tetrahedra.

    Parameters
    ----------
    before, after : (k, 3) float
        Positions of the vertices in one unit.
    cells : (c, 4) int
        Their indices per element; the elements have a volume before.
    """
    # edges from the first vertex, a row each: rows after = rows before · Fᵀ
    first, second = (x[cells[:, 1:]] - x[cells[:, :1]] for x in (before, after))
    return np.asarray(np.linalg.solve(first, second), dtype=np.float64).transpose(0, 2, 1)


def elastic_part(F: Floats, V_old: Floats, dg: Floats, dr: Floats, N: Floats) -> Floats:
    """Returns the (c, 3, 3) elastic parts Fe = F·V_old·Fg⁻¹ of a step.

    Parameters
    ----------
    F
        Deformation gradients of the step.
    V_old
        Elastic stretches that remain from the steps before; one identity (3, 3) for all where stress is forgotten.
    dg, dr : (c,) float
        Growth of the step along the pial surface and across it, as stretches less 1.
    N : (c, 3) float
        Unit normals: Fg = (1 + dg)(I − N⊗N) + (1 + dr) N⊗N.
    """
    across = N[:, :, None] * N[:, None, :]
    along = np.eye(3) - across
    return F @ V_old @ (along / (1 + dg)[:, None, None] + across / (1 + dr)[:, None, None])


def cauchy_stress(Fe: Floats, mu: Floats, K: Floats) -> Floats:
    """Returns the (c, 3, 3) Cauchy stress σ = μ Je^(−5/3) dev(Fe·Feᵀ) + K (Je − 1) I in Pa.

    That is σ = 1/Je · ∂ψ/∂Fe · Feᵀ of ψ = μ/2 (tr(Feᵀ·Fe) Je^(−2/3) − 3) + K/2 (Je − 1)² per volume of the natural
    state. The model counts ψ per volume before the step's growth (docs/model.md), so that the stress in its equilibrium
    is smaller by the factor det Fg: by less than 2 % in a step of the reference parameters.

    Parameters
    ----------
    mu, K : (c,) float
        Shear and bulk modulus in Pa.
    """
    Je = np.linalg.det(Fe)
    shear = (mu * Je ** (-5 / 3))[:, None, None] * deviator(Fe @ Fe.transpose(0, 2, 1))
    return shear + (K * (Je - 1))[:, None, None] * np.eye(3)


def pressure(stress: Floats) -> Floats:
    """Returns the (c,) pressures −tr(σ)/3, positive where tissue is pressed, in the unit of the stress."""
    return -np.trace(stress, axis1=1, axis2=2) / 3


def von_mises(stress: Floats) -> Floats:
    """Returns the (c,) equivalent stresses √(3/2 dev σ : dev σ), in the unit of the stress."""
    return np.sqrt(1.5) * np.linalg.norm(deviator(stress), axis=(1, 2))


def deviator(tensors: Floats) -> Floats:
    """Returns the (c, 3, 3) tensors less a third of their trace on the diagonal."""
    return tensors - (np.trace(tensors, axis1=1, axis2=2) / 3)[:, None, None] * np.eye(3)


def principal_stretches(F: Floats) -> Floats:
    """Returns the (c, 3) principal stretches of (c, 3, 3) deformation gradients, ascending."""
    # twice as fast as singular values
    return np.sqrt(np.linalg.eigvalsh(F @ F.transpose(0, 2, 1)))


def hencky_equivalent(stretches: Floats) -> Floats:
    """Returns the (c,) equivalent strains √(2/3 dev h : dev h) of the Hencky strain h = ln V.

    It is 0 where the shape is unchanged, and the logarithm of the stretch in a bar drawn out at constant volume.

    Parameters
    ----------
    stretches : (c, 3) float
        Principal stretches, positive.
    """
    h = np.log(stretches)
    return np.sqrt(2 / 3) * np.linalg.norm(h - h.mean(axis=1, keepdims=True), axis=1)


def green_lagrange_maximum(stretches: Floats) -> Floats:
    """Returns the (c,) largest principal values of the Green-Lagrange strain (FᵀF − I)/2.

    Parameters
    ----------
    stretches : (c, 3) float
        Principal stretches, ascending.
    """
    return (stretches[:, -1] ** 2 - 1) / 2


def areal_stretch(F: Floats, N: Floats) -> Floats:
    """Returns the (c,) ratios of areas, after to before, of planes with unit normals N (c, 3) before: det F·|F⁻ᵀ·N|."""
    rows = np.linalg.solve(F.transpose(0, 2, 1), N[:, :, None])[:, :, 0]
    return np.linalg.det(F) * np.linalg.norm(rows, axis=1)


def stress_fields(Fe: Floats, mu: Floats, K: Floats) -> dict[str, Floats]:
    """Returns the equivalent stress and the pressure per element, (c,), in Pa; parameters as of `cauchy_stress`."""
    stress = cauchy_stress(Fe, mu, K)
    return {"von_mises_pa": von_mises(stress), "pressure_pa": pressure(stress)}


def strain_fields(Fe: Floats, F_total: Floats, start_normals: Floats) -> dict[str, Floats]:
    """Returns measures of strain per element, (c,), without unit.

    Parameters
    ----------
    Fe
        Elastic parts after the last step.
    F_total
        Deformation gradients from the start mesh to the present shape, growth included.
    start_normals : (c, 3) float
        Unit normals of the nearest pial surface in the start mesh.

    Returns
    -------
    dict with
        `elastic_strain` (equivalent Hencky strain), `elastic_volume_strain` (ln Je), `total_strain` (largest principal
        value of the Green-Lagrange strain), `area_stretch` (along the pial surface)
    """
    elastic, total = principal_stretches(Fe), principal_stretches(F_total)
    return {
        "elastic_strain": hencky_equivalent(elastic),
        "elastic_volume_strain": np.log(np.linalg.det(Fe)),
        "total_strain": green_lagrange_maximum(total),
        "area_stretch": areal_stretch(F_total, start_normals),
    }


def volume_ratio_fields(F_step: Floats, F_total: Floats) -> dict[str, Floats]:
    """Returns the volumes per element, (c,), over those before the last step and over those of the start mesh."""
    return {"volume_ratio_step": np.linalg.det(F_step), "volume_ratio": np.linalg.det(F_total)}
