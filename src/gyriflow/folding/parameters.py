"""What a folding run needs to know: the content of its `params.yaml`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

from ..errors import InputError
from ..mechanics.materials import MATERIALS
from .varying import Maps, Varying

ELEMENT_FIELDS = ("stress", "strain", "volume_ratio")
"""Fields that a run can write for ParaView, with values per element (up to four arrays each)."""
FIELDS = (
    "displacement",
    "distance",
    "cortex_weight",
    "growth",
    "shear_modulus",
    "bulk_modulus",
    "normal",
    "zones",
    "contact_pressure",
    *ELEMENT_FIELDS,
)
"""All fields that a run can write."""
CONTACTS = ("global", "planes", "none")
SUPPORTS = ("ellipsoid", "base", "box", "free")


@dataclass(frozen=True)
class Contact:
    """Contact: `kind` is "global" (the pial surface with itself), "planes" (hemispheres and fissure) or "none".

    `distance_mm` and `stiffness_pa` belong to "global", where None takes them from mesh and material (see `contact`);
    `penalty_pa_per_m` to "planes". `gap_mm` places the zones at the fissure for all kinds but "none".
    """

    kind: str = "global"
    penalty_pa_per_m: float = 5e5
    gap_mm: float = 2.5
    distance_mm: float | None = None
    stiffness_pa: float | None = None


@dataclass(frozen=True)
class NoGrowth:
    """The ellipsoid of no growth, in fractions of the brain's extents; with the kind "none" all tissue grows."""

    kind: str = "ellipsoid"
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

    `output_weeks` starts with `start_week` and ends with `end_week`. `support` is "ellipsoid" (pial facets inside the
    ellipsoid of no growth are clamped), "base" (the flat base is), "box" (so it is, and the upright sides slide), or
    "free". `stress_memory_gw` is the time in GW in which stress relaxes: 0 none is kept, infinity all of it.
    """

    start_week: float
    end_week: float
    fissure_x_mm: float
    output_weeks: tuple[float, ...]
    step_s: float = 43_200.0
    thickness_mm: Varying = field(default=Varying.constant(1.5))
    thickness_growth_mm_per_gw: float = 0.0
    shear_modulus_cortex_pa: Varying = field(default=Varying.constant(1500.0))
    shear_modulus_core_pa: Varying = field(default=Varying.constant(300.0))
    material: str = "neo-hookean"
    poisson_ratio: float = 0.45
    growth_rate_per_s: Varying = field(default=Varying.constant(2e-7))
    radial_growth_rate_per_s: Varying = field(default=Varying.constant(0.0))
    core_growth_rate_per_s: Varying = field(default=Varying.constant(0.0))
    allow_negative_growth: bool = False
    stress_memory_gw: float = 0.0
    support: str = "ellipsoid"
    contact: Contact = field(default_factory=Contact)
    no_growth: NoGrowth = field(default_factory=NoGrowth)
    output_every_gw: float = 1.0
    fields: tuple[str, ...] = ("displacement", "cortex_weight", "growth")
    solver: Solver = field(default_factory=Solver)
    ranks: int = 1

    def __post_init__(self) -> None:
        axes, solver, contact = self.no_growth.semi_axes, self.solver, self.contact
        checks = {
            "end_week must come after start_week": self.end_week > self.start_week,
            "step_s must be positive": self.step_s > 0,
            "poisson_ratio must lie in [0, 0.5)": 0 <= self.poisson_ratio < 0.5,
            f"material must be among {', '.join(MATERIALS)}": self.material in MATERIALS,
            "stress_memory_gw must not be negative": self.stress_memory_gw >= 0,
            f"support must be among {', '.join(SUPPORTS)}": self.support in SUPPORTS,
            "no_growth.kind must be ellipsoid or none": self.no_growth.kind in ("ellipsoid", "none"),
            f"contact.kind must be among {', '.join(CONTACTS)}": contact.kind in CONTACTS,
            "contact.penalty_pa_per_m, gap_mm, distance_mm and stiffness_pa must be positive": min(
                contact.penalty_pa_per_m, contact.gap_mm, contact.distance_mm or 1.0, contact.stiffness_pa or 1.0
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
        if not self.maps:
            broken += value_problems(self, {})
        if broken:
            raise InputError("folding parameters: " + "; ".join(broken))

    @property
    def maps(self) -> set[str]:
        """The names of the maps that the parameters need."""
        return {name for name in (getattr(self, key).map for key in VARYING) if name is not None}

    def thickness_at(self, week: float, maps: Maps) -> float | np.ndarray:
        """Returns the cortical thickness in mm at a week, H = H₀ + β·t, at all vertices where it has a map."""
        return self.thickness_mm.at(week, maps) + self.thickness_growth_mm_per_gw * (week - self.start_week)


VARYING = tuple(name for name, hint in get_type_hints(FoldingParameters).items() if hint is Varying)
"""Parameters that may vary with week and place."""
GROWTH_RATES = tuple(name for name in VARYING if name.endswith("growth_rate_per_s"))


def value_problems(p: FoldingParameters, maps: Maps) -> list[str]:
    """Returns what is wrong with the values of parameters that may vary, over all weeks and places."""
    ranges = {name: getattr(p, name).range(maps, p.start_week, p.end_week) for name in VARYING}
    smallest = {name: least for name, (least, _) in ranges.items()}
    largest = [max(map(abs, ranges[name])) for name in GROWTH_RATES]
    weeks = p.thickness_mm.weeks_within(p.start_week, p.end_week)
    thinnest = min(float(np.min(p.thickness_at(week, maps))) for week in weeks)
    checks = {
        "thickness_mm must be positive in all weeks": thinnest > 0,
        "shear moduli must be positive": min(smallest["shear_modulus_cortex_pa"], smallest["shear_modulus_core_pa"])
        > 0,
        "growth rates must not be negative unless allow_negative_growth is true": p.allow_negative_growth
        or min(smallest[name] for name in GROWTH_RATES) >= 0,
        "a growth rate times step_s must stay below 1": sum(largest) * p.step_s < 1,
    }
    return [text for text, holds in checks.items() if not holds]


def require_maps(p: FoldingParameters, maps: Maps, vertices: int) -> None:
    """Raises InputError where a map is missing, does not fit the mesh, or holds values that cannot be."""
    for name in sorted(p.maps):
        if name not in maps:
            raise InputError(f"the map {name} is missing", expected="a file with it, given with --maps")
        found = maps[name].shape
        if found != (vertices,):
            raise InputError(f"the map {name} does not fit the mesh", found=found, expected=f"{vertices} values")
    problems = value_problems(p, maps)
    if problems:
        raise InputError("folding parameters: " + "; ".join(problems))


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
    if hint is Varying:
        return Varying.read(value, key)
    if isinstance(hint, type) and is_dataclass(hint):
        return parameters_from(value, hint, f"{key}.")
    if key == "stress_memory_gw" and value == "infinite":
        return math.inf
    if hint == float | None:
        return None if value is None else _converted(value, float, key)
    try:
        if get_origin(hint) is tuple:
            return tuple(_converted(item, get_args(hint)[0], key) for item in value)
        if hint is bool and not isinstance(value, bool):
            raise ValueError
        return hint(value)
    except (TypeError, ValueError):
        raise InputError(f"folding parameters: {key}", found=repr(value), expected=f"a {hint}") from None
