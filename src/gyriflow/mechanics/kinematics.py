"""Kinematics of finite growth: F = Fe·Fg (Rodriguez et al. 1994)."""

import ufl
from ufl.core.expr import Expr


def deformation_gradient(u: Expr) -> Expr:
    """Returns F = I + ∇u of the displacement u, with respect to the current mesh (the updated reference)."""
    return ufl.Identity(len(u)) + ufl.grad(u)


def elastic_deformation(F: Expr, Fg_inverse: Expr) -> Expr:
    """Returns the elastic part Fe = F·Fg⁻¹."""
    return F * Fg_inverse
