"""The growth law, how much tissue grows in a step, and the growth tensor, in which directions.

The law is plain arithmetic, for numbers and arrays; the tensor is UFL, the same for the solve and for what is written.
"""

from typing import Any

import ufl
from ufl.core.expr import Expr


def growth_increments(
    w: Any, g: Any, tangential: Any, radial: Any, core: Any, step_s: float, *, across: Any = 0.0
) -> tuple[Any, Any]:
    """Returns the increments dg along the pial surface and dr across it, as stretches less 1.

    dg = (α_TAN w + α_CORE (1 − w)) · g · Δt and dr = ((α_RAD + α_CORE)(1 − w) + α_ACROSS w) · g · Δt.

    Parameters
    ----------
    w
        Cortical weight: 1 in the cortex, 0 in the core.
    g
        1 where tissue grows, 0 where it does not.
    tangential, radial, core
        The rates α_TAN of the cortex along its surface, α_RAD of the core along the normal, and α_CORE of the core in
        all directions, in 1/s.
    step_s
        Length of the step in s.
    across
        Rate α_ACROSS of the cortex along the normal, 0 in the paper.
    """
    isotropic = core * (1 - w)
    return (tangential * w + isotropic) * (g * step_s), (radial * (1 - w) + across * w + isotropic) * (g * step_s)


def inverse_growth_tensor(dg: Expr, dr: Expr, N: Expr) -> Expr:
    """Returns Fg⁻¹ for Fg = (1 + dg)(I − N⊗N) + (1 + dr) N⊗N.

    Parameters
    ----------
    dg, dr
        Growth increments, tangential and radial.
    N
        Unit vector. The explicit inverse holds for |N| = 1 only.
    """
    across = ufl.outer(N, N)
    along = ufl.Identity(len(N)) - across
    return along / (1 + dg) + across / (1 + dr)
