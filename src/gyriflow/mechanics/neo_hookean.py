"""The slightly compressible neo-Hookean material of the paper."""

import ufl
from ufl.core.expr import Expr


def strain_energy_density(Fe: Expr, mu: Expr, K: Expr) -> Expr:
    """Returns ψ = μ/2 (tr(Feᵀ·Fe) Je^(−2/3) − 3) + K/2 (Je − 1)² in Pa.

    ψ is counted per volume of the updated reference, without the factor det Fg: the paper's choice.
    """
    Je = ufl.det(Fe)
    return mu / 2 * (ufl.inner(Fe, Fe) * Je ** (-2 / 3) - 3) + K / 2 * (Je - 1) ** 2


def bulk_to_shear_ratio(poisson_ratio: float) -> float:
    """Returns K/μ = 2(1 + ν) / (3(1 − 2ν)); ValueError unless −1 < ν < 0.5."""
    if not -1 < poisson_ratio < 0.5:
        raise ValueError(f"Poisson's ratio must lie between -1 and 0.5, found {poisson_ratio}")
    return 2 * (1 + poisson_ratio) / (3 * (1 - 2 * poisson_ratio))
