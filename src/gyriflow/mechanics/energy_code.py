"""A material's energy density and its derivatives by I₁ and J as C functions, for `folding/linear_elements.c`."""

import ufl
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr

from .materials import Material


def energy_code(material: Material) -> str:
    """Return C functions of I1, J, mu and K: psi in Pa, and psi_I, psi_J, psi_II, psi_IJ, psi_JJ."""
    # the values are not used: the variables stand for names in C
    variables = {name: ufl.variable(ufl.as_ufl(1.0)) for name in ("I1", "J", "mu", "K")}
    I1, J = variables["I1"], variables["J"]
    psi = material.energy_of_invariants(**variables)
    slopes = ufl.diff(psi, I1), ufl.diff(psi, J)
    functions = dict(zip(("psi", "psi_I", "psi_J"), (psi, *slopes), strict=True))
    functions |= {"psi_II": ufl.diff(slopes[0], I1), "psi_IJ": ufl.diff(slopes[0], J), "psi_JJ": ufl.diff(slopes[1], J)}
    names = {variable: name for name, variable in variables.items()}
    law = [
        f"static inline double {name}(double I1, double J, double mu, double K) "
        f"{{ return {_in_c(expand_derivatives(value), names)}; }}"
        for name, value in functions.items()
    ]
    return "\n".join(["#include <math.h>", *law, ""])


def _in_c(value: Expr, names: dict[Expr, str]) -> str:
    if value in names:
        return names[value]
    if not value.ufl_operands:
        return repr(float(value))
    forms = {"Sum": "({}+{})", "Product": "({}*{})", "Division": "({}/{})", "Power": "pow({},{})", "Ln": "log({})"}
    return forms[type(value).__name__].format(*(_in_c(part, names) for part in value.ufl_operands))
