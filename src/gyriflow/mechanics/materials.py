"""Material laws of tissue. A law is one class here, and its name in the configuration;
its energy density also in C."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import ufl
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr
from ufl.variable import Label, Variable


@dataclass(frozen=True)
class Material(ABC):
    """An isotropic hyperelastic material, defined by its energy density.

    Energies are per volume of the updated reference, without the factor det Fg, as in
    the paper. Poisson's ratio ν is the same in all tissue.
    """

    poisson_ratio: float
    name: ClassVar[str]

    @property
    def bulk_to_shear_ratio(self) -> float:
        """K/μ = 2(1 + ν) / (3(1 − 2ν))."""
        return 2 * (1 + self.poisson_ratio) / (3 * (1 - 2 * self.poisson_ratio))

    @staticmethod
    @abstractmethod
    def _energy_of_invariants(
        I1: Expr,
        J: Expr,
        mu: Expr,
        K: Expr,
    ) -> Expr:
        """Return ψ in Pa of I₁ = tr(Feᵀ·Fe) and J = det Fe; μ and K, in Pa, are the
        moduli of small strains."""

    @classmethod
    def energy_density(
        cls,
        Fe: Expr,
        mu: Expr,
        K: Expr,
    ) -> Expr:
        """Return ψ in Pa of the elastic deformation Fe."""
        return cls._energy_of_invariants(
            ufl.inner(Fe, Fe),
            ufl.det(Fe),
            mu,
            K,
        )

    def cauchy_stress(
        self,
        Fe: Expr,
        mu: Expr,
        K: Expr,
    ) -> Expr:
        """Return the Cauchy stress σ = 1/Je · ∂ψ/∂Fe · Feᵀ in Pa, with ψ per volume of
        the state without stress.

        The energy that the model minimises is per volume before the step's growth
        (docs/model.md), so that the stress in its equilibrium is smaller by the factor
        det Fg, by less than 2 % in a step of the reference parameters.
        """
        # a fixed label, since a new one in each process would be compiled again
        Fe = Variable(Fe, Label(0))
        return ufl.diff(self.energy_density(Fe, mu, K), Fe) * Fe.T / ufl.det(Fe)


class NeoHookean(Material):
    """The slightly compressible neo-Hookean material of the paper, with separate
    energies of shape and volume."""

    name = "neo-hookean"

    @staticmethod
    def _energy_of_invariants(
        I1: Expr,
        J: Expr,
        mu: Expr,
        K: Expr,
    ) -> Expr:
        """Return ψ = μ/2 (I₁ J^(−2/3) − 3) + K/2 (J − 1)² in Pa."""
        return mu / 2 * (I1 * J ** (-2 / 3) - 3) + K / 2 * (J - 1) ** 2


class CompressibleNeoHookean(Material):
    """The compressible neo-Hookean material (Bonet and Wood 2008, §6.4.3), with (J −
    1)² instead of (ln J)².

    Its energy is not split into those of shape and volume.
    """

    name = "compressible-neo-hookean"

    @staticmethod
    def _energy_of_invariants(
        I1: Expr,
        J: Expr,
        mu: Expr,
        K: Expr,
    ) -> Expr:
        """Return ψ = μ/2 (I₁ − 3 − 2 ln J) + λ/2 (J − 1)² in Pa, with λ = K − 2μ/3."""
        return mu / 2 * (I1 - 3 - 2 * ufl.ln(J)) + (K - 2 * mu / 3) / 2 * (J - 1) ** 2


MATERIALS: dict[str, type[Material]] = {
    law.name: law for law in (NeoHookean, CompressibleNeoHookean)
}
"""Material laws by their names in the configuration."""


def energy_code(material: Material) -> str:
    """Return C functions of I1, J, mu and K: psi in Pa, and psi_I, psi_J, psi_II,
    psi_IJ, psi_JJ.

    They are for `folding/linear_elements.c`.
    """
    # the values are not used: the variables stand for names in C
    variables = {name: ufl.variable(ufl.as_ufl(1.0)) for name in ("I1", "J", "mu", "K")}
    I1, J = variables["I1"], variables["J"]
    psi = material._energy_of_invariants(**variables)
    slopes = ufl.diff(psi, I1), ufl.diff(psi, J)
    functions = dict(
        zip(
            ("psi", "psi_I", "psi_J"),
            (psi, *slopes),
            strict=True,
        )
    )
    functions |= {
        "psi_II": ufl.diff(slopes[0], I1),
        "psi_IJ": ufl.diff(slopes[0], J),
        "psi_JJ": ufl.diff(slopes[1], J),
    }
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
    forms = {
        "Sum": "({}+{})",
        "Product": "({}*{})",
        "Division": "({}/{})",
        "Ln": "log({})",
    }
    parts = [_in_c(part, names) for part in value.ufl_operands]
    kind = type(value).__name__
    if kind == "Power":
        base, exponent = parts
        return _power_in_c(base, float(exponent))
    return forms[kind].format(*parts)


def _power_in_c(base: str, exponent: float) -> str:
    """Return a power in C. Those below −1, of derivatives, are quotients: the compiler
    then finds one power in all of them, and that takes longer than all else."""
    if exponent < -1:
        return f"({_power_in_c(base, exponent + 1)}/{base})"
    return f"pow({base},{exponent:.15g})"
