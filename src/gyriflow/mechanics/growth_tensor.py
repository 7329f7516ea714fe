"""The growth tensor of a layer that grows along and across the direction of the pial normal."""

import ufl
from ufl.core.expr import Expr


def inverse_growth_tensor(dg: Expr, dr: Expr, N: Expr) -> Expr:
    """Returns Fg⁻¹ for Fg = (1 + dg)(I − N⊗N) + (1 + dr) N⊗N.

    Parameters
    ----------
    dg, dr
        Growth stretch increments, tangential and radial.
    N
        Unit vector. The explicit inverse holds for |N| = 1 only.
    """
    across = ufl.outer(N, N)
    along = ufl.Identity(len(N)) - across
    return along / (1 + dg) + across / (1 + dr)
