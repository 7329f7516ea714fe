"""Material laws of tissue. A law is one class here, and its name in the configuration."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import ufl
from ufl.core.expr import Expr
from ufl.variable import Label, Variable


@dataclass(frozen=True)
class Material(ABC):
    """An isotropic hyperelastic material, defined by its energy density.

    Energies are per volume of the updated reference, without the factor det Fg, as in the paper. Poisson's ratio ν is
    the same in all tissue.
    """

    poisson_ratio: float
    name: ClassVar[str]

    @property
    def bulk_to_shear_ratio(self) -> float:
        """K/μ = 2(1 + ν) / (3(1 − 2ν))."""
        return 2 * (1 + self.poisson_ratio) / (3 * (1 - 2 * self.poisson_ratio))

    @staticmethod
    @abstractmethod
    def energy_of_invariants(I1: Expr, J: Expr, mu: Expr, K: Expr) -> Expr:
        """Return ψ in Pa of I₁ = tr(Feᵀ·Fe) and J = det Fe; μ and K, in Pa, are the moduli of small strains."""

    @classmethod
    def energy_density(cls, Fe: Expr, mu: Expr, K: Expr) -> Expr:
        """Return ψ in Pa of the elastic deformation Fe."""
        return cls.energy_of_invariants(ufl.inner(Fe, Fe), ufl.det(Fe), mu, K)

    def cauchy_stress(self, Fe: Expr, mu: Expr, K: Expr) -> Expr:
        """Return the Cauchy stress σ = 1/Je · ∂ψ/∂Fe · Feᵀ in Pa, with ψ per volume of the state without stress.

        The energy that the model minimises is per volume before the step's growth (docs/model.md), so that the stress
        in its equilibrium is smaller by the factor det Fg, by less than 2 % in a step of the reference parameters.
        """
        # a fixed label, since a new one in each process would be compiled again
        Fe = Variable(Fe, Label(0))
        return ufl.diff(self.energy_density(Fe, mu, K), Fe) * Fe.T / ufl.det(Fe)


class NeoHookean(Material):
    """The slightly compressible neo-Hookean material of the paper, with separate energies of shape and volume."""

    name = "neo-hookean"

    @staticmethod
    def energy_of_invariants(I1: Expr, J: Expr, mu: Expr, K: Expr) -> Expr:
        """Return ψ = μ/2 (I₁ J^(−2/3) − 3) + K/2 (J − 1)² in Pa."""
        return mu / 2 * (I1 * J ** (-2 / 3) - 3) + K / 2 * (J - 1) ** 2


class CompressibleNeoHookean(Material):
    """The compressible neo-Hookean material (Bonet and Wood 2008, §6.4.3), with (J − 1)² instead of (ln J)².

    Its energy is not split into those of shape and volume.
    """

    name = "compressible-neo-hookean"

    @staticmethod
    def energy_of_invariants(I1: Expr, J: Expr, mu: Expr, K: Expr) -> Expr:
        """Return ψ = μ/2 (I₁ − 3 − 2 ln J) + λ/2 (J − 1)² in Pa, with λ = K − 2μ/3."""
        return mu / 2 * (I1 - 3 - 2 * ufl.ln(J)) + (K - 2 * mu / 3) / 2 * (J - 1) ** 2


MATERIALS: dict[str, type[Material]] = {law.name: law for law in (NeoHookean, CompressibleNeoHookean)}
"""Material laws by their names in the configuration."""
