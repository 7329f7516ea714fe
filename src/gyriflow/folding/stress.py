"""Measures of the deformation and stress of elements: plain NumPy on whole arrays.

The tensors of a step, elastic deformation and stress, come from the problem that was solved (`Problem.outcome`). Arrays
of tensors are (c, 3, 3), of scalars (c,).
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]


def deformation_gradients(before: Floats, after: Floats, cells: Ints, slopes: Floats) -> Floats:
    """Returns the (c, q, 3, 3) deformation gradients F = ∂x_after/∂x_before of tetrahedra at points inside them.

    Parameters
    ----------
    before, after : (k, 3) float
        Positions of the nodes in one unit.
    cells : (c, n) int
        Their indices per element; the elements have a volume before.
    slopes : (q, n, 3) float
        Gradients of the nodes' shape functions in the regular element, at the points.
    """
    # the transposed maps from the regular element: those after = those before · Fᵀ
    first, second = (np.matmul(slopes.transpose(0, 2, 1), x[cells][:, None]) for x in (before, after))
    return np.asarray(np.linalg.solve(first, second), dtype=np.float64).swapaxes(-1, -2)


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


def stress_fields(stress: Floats) -> dict[str, Floats]:
    """Returns the equivalent stress and the pressure per element, (c,), in Pa, of Cauchy stresses (c, 3, 3) in Pa."""
    return {"von_mises_pa": von_mises(stress), "pressure_pa": pressure(stress)}


def elastic_strain_fields(Fe: Floats) -> dict[str, Floats]:
    """Returns measures per element, (c,), of elastic parts (c, 3, 3) of the deformation: what growth has not made.

    `elastic_strain` is the equivalent Hencky strain, `elastic_volume_strain` ln Je.
    """
    return {
        "elastic_strain": hencky_equivalent(principal_stretches(Fe)),
        "elastic_volume_strain": np.log(np.linalg.det(Fe)),
    }


def total_strain_fields(F_total: Floats, start_normals: Floats) -> dict[str, Floats]:
    """Returns measures per element, (c,), of the deformation since the start, growth included.

    Parameters
    ----------
    F_total
        Deformation gradients from the start mesh to the present shape.
    start_normals : (c, 3) float
        Unit normals of the nearest pial surface in the start mesh.

    Returns
    -------
    dict with
        `total_strain` (largest principal value of the Green-Lagrange strain), `area_stretch` (along the pial surface)
    """
    return {
        "total_strain": green_lagrange_maximum(principal_stretches(F_total)),
        "area_stretch": areal_stretch(F_total, start_normals),
    }


def volume_ratio_fields(F_step: Floats, F_total: Floats) -> dict[str, Floats]:
    """Returns the volumes per element, (c,), over those before the last step and over those of the start mesh."""
    return {"volume_ratio_step": np.linalg.det(F_step), "volume_ratio": np.linalg.det(F_total)}
