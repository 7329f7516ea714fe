"""What a folding run needs to know: the content of its `params.yaml`."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, get_args, get_origin, get_type_hints

from ..errors import InputError

FIELDS = ("displacement", "distance", "cortex_weight", "growth", "shear_modulus", "normal", "zones")
"""Fields that a run can write for ParaView."""


@dataclass(frozen=True)
class Contact:
    """The hemispheres' contact: `kind` is "planes" or "none"."""

    kind: str = "planes"
    penalty_pa_per_m: float = 5e5
    gap_mm: float = 2.5


@dataclass(frozen=True)
class NoGrowth:
    """The ellipsoid of no growth, in fractions of the brain's extents."""

    shift_y: float = 0.05
    shift_z: float = -0.15
    semi_axes: tuple[float, float, float] = (0.35, 0.40, 0.50)


@dataclass(frozen=True)
class Solver:
    """Tolerances of the solvers and the number of times that a step may be halved."""

    newton_tolerance: float = 1e-6
    krylov_tolerance: float = 1e-3
    max_newton: int = 20
    max_halvings: int = 6


@dataclass(frozen=True)
class FoldingParameters:
    """Parameters of a run; names carry the units, defaults are the paper's reference values.

    `output_weeks` starts with `start_week` and ends with `end_week`.
    """

    start_week: float
    end_week: float
    fissure_x_mm: float
    output_weeks: tuple[float, ...]
    step_s: float = 43_200.0
    thickness_mm: float = 1.5
    shear_modulus_cortex_pa: float = 1500.0
    shear_modulus_core_pa: float = 300.0
    poisson_ratio: float = 0.45
    growth_rate_per_s: float = 2e-7
    radial_growth_rate_per_s: float = 0.0
    allow_negative_growth: bool = False
    contact: Contact = field(default_factory=Contact)
    no_growth: NoGrowth = field(default_factory=NoGrowth)
    output_every_gw: float = 1.0
    fields: tuple[str, ...] = ("displacement", "cortex_weight", "growth")
    solver: Solver = field(default_factory=Solver)
    ranks: int = 1

    def __post_init__(self) -> None:
        growth = (self.growth_rate_per_s, self.radial_growth_rate_per_s)
        axes, solver = self.no_growth.semi_axes, self.solver
        checks = {
            "end_week must come after start_week": self.end_week > self.start_week,
            "step_s must be positive": self.step_s > 0,
            "thickness_mm must be positive": self.thickness_mm > 0,
            "shear moduli must be positive": min(self.shear_modulus_cortex_pa, self.shear_modulus_core_pa) > 0,
            "poisson_ratio must lie in [0, 0.5)": 0 <= self.poisson_ratio < 0.5,
            "growth rates must not be negative unless allow_negative_growth is true": self.allow_negative_growth
            or min(growth) >= 0,
            "a growth rate times step_s must stay below 1": max(map(abs, growth)) * self.step_s < 1,
            "contact.kind must be planes or none": self.contact.kind in ("planes", "none"),
            "contact.penalty_pa_per_m and contact.gap_mm must be positive": min(
                self.contact.penalty_pa_per_m, self.contact.gap_mm
            )
            > 0,
            "no_growth.semi_axes must be three positive numbers": len(axes) == 3 and min(axes) > 0,
            "solver tolerances must lie between 0 and 1": 0 < solver.newton_tolerance < 1
            and 0 < solver.krylov_tolerance < 1,
            "solver.max_newton must be positive, solver.max_halvings not negative": solver.max_newton > 0
            and solver.max_halvings >= 0,
            f"fields must be among {', '.join(FIELDS)}": set(self.fields) <= set(FIELDS),
            "output_weeks must ascend from start_week to end_week": list(self.output_weeks)
            == sorted(set(self.output_weeks))
            and self.output_weeks[:1] == (self.start_week,)
            and self.output_weeks[-1:] == (self.end_week,),
        }
        broken = [text for text, holds in checks.items() if not holds]
        if broken:
            raise InputError("folding parameters: " + "; ".join(broken))


def parameters_from(values: Mapping[str, Any], cls: type = FoldingParameters, where: str = "") -> Any:
    """Returns the parameters from nested mappings as read from YAML; numbers written as 2e-7 are understood.

    Raises
    ------
    InputError
        For unknown or missing keys, and values of a wrong type.
    """
    if not isinstance(values, Mapping):
        raise InputError(f"folding parameters: {where.rstrip('.') or 'the file'} must hold keys and values")
    known = {f.name: f for f in fields(cls)}
    hints = get_type_hints(cls)
    unknown = sorted(set(values) - set(known))
    if unknown:
        raise InputError(f"folding parameters: unknown keys {', '.join(where + key for key in unknown)}")
    read = {key: _converted(value, hints[key], where + key) for key, value in values.items()}
    try:
        return cls(**read)
    except TypeError as error:
        raise InputError(f"folding parameters: {error}") from None


def _converted(value: Any, hint: Any, key: str) -> Any:
    """Returns a value as the type of its field."""
    if isinstance(hint, type) and is_dataclass(hint):
        return parameters_from(value, hint, f"{key}.")
    try:
        if get_origin(hint) is tuple:
            return tuple(_converted(item, get_args(hint)[0], key) for item in value)
        if hint is bool and not isinstance(value, bool):
            raise ValueError
        return hint(value)
    except (TypeError, ValueError):
        raise InputError(f"folding parameters: {key}", found=repr(value), expected=f"a {hint}") from None
