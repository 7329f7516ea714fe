"""The mechanical model, its parameters and its numerics: settings of a study,
parameters of a run."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BeforeValidator,
    Field,
    PlainSerializer,
    ValidationInfo,
    field_validator,
)

from ..errors import InputError
from .base import KeyProblem, Problems, Settings, validated
from .growth import Growth
from .terms import FieldName, MaterialName, Side
from .varying import (
    Maps,
    Varying,
    VaryingNumber,
    bounds_of,
    map_of,
    require_bounds,
    value_range,
    varying,
)
from .weeks import EndWeek, Week


def _memory(value: Any) -> float:
    """Return a time in GW from a number or `infinite`."""
    if value == "infinite":
        return math.inf
    try:
        time = float(value)
    except (TypeError, ValueError):
        time = -1.0
    if not time >= 0 or isinstance(value, bool):
        raise ValueError("should be 0 or more, or 'infinite'")
    return time


Memory = Annotated[
    float,
    Field(allow_inf_nan=True),
    BeforeValidator(
        _memory,
        json_schema_input_type=Annotated[float, Field(ge=0)] | Literal["infinite"],
    ),
    PlainSerializer(
        lambda time: "infinite" if math.isinf(time) else time, when_used="json"
    ),
]
AXES = ("x", "y", "z")
"""Which end the names of the maps of positions."""


class FoldingSettings(Settings):
    """The mechanical model, its parameters and its numerics.

    The defaults are the paper's, except `contact` (`planes` in the paper) and elements
    (linear in the paper: `mesh: {order: 1}`).
    """

    preset: Literal["fetalfoldsim", "measured", "expected"] | None = None
    """Parameters to start from; other keys come on top, for the preset of a run the
    run's own. `fetalfoldsim`: the paper's; `measured`: growth that takes the brain to
    the shapes that its series was measured to have; `expected`: to those that the
    growth of another population, such as an atlas, would give it."""
    end_week: EndWeek
    """Gestational age at which the simulation ends. [GW]"""
    step_s: float = Field(43200.0, gt=0, le=604800)
    """Time step; shortened where an output week comes first. [s]"""
    thickness_mm: VaryingNumber = varying(1.5, gt=0, le=10)
    """Cortical thickness. [mm]"""
    shear_modulus_cortex_pa: VaryingNumber = varying(1500.0, gt=0, le=1e7)
    """Shear modulus of the cortex. [Pa]"""
    shear_modulus_core_pa: VaryingNumber = varying(300.0, gt=0, le=1e7)
    """Shear modulus of the core. [Pa]"""
    material: MaterialName = "neo-hookean"
    """Constitutive law (docs/model.md), as in the paper."""
    poisson_ratio: float = Field(0.45, ge=0, lt=0.5)
    """Poisson's ratio ν."""
    growth_rate_per_s: VaryingNumber = varying(2.0e-7, ge=0, le=1e-5)
    """Tangential growth rate of the cortex. [1/s]"""
    core_growth_rate_per_s: VaryingNumber = varying(0.0, ge=0, le=1e-5)
    """Isotropic growth rate of the core. [1/s]"""
    growth: Growth = Growth()
    """What the brain grows by."""
    stress_memory_gw: Memory = 0.0
    """Relaxation time of elastic stress: after each step 0 forgets it (the paper),
    `infinite` keeps all of it. [GW]"""
    support: Literal["ellipsoid", "free"] = "ellipsoid"
    """What holds the brain, and where it grows. `ellipsoid`: pial facets in the paper's
    ellipsoid (docs/model.md) are clamped, and tissue in it and in the bridge between
    hemispheres does not grow; `free`: all tissue grows, and only rigid motions are
    removed."""
    contact: Literal["global", "planes", "none"] = "global"
    """Contact between folds, and between the two hemispheres. `global`: no part of the
    pial surface crosses another; `planes`: neither hemisphere passes the fissure's
    plane, but folds may cross each other (the paper); `none`: no contact."""
    output_every_gw: float = Field(1.0, ge=0.01, le=10)
    """Interval between output weeks, besides the first and the last, and where some run
    predicts the start's growth (`growth.of: atlas`) those of the brains to compare
    with. [GW]"""
    fields: tuple[FieldName, ...] = ("displacement", "cortex_weight", "growth")
    """Fields for ParaView at each output week."""
    newton_tolerance: float = Field(1e-4, gt=0, lt=1)
    """Residual at which Newton stops, over its value at u = 0."""
    max_halvings: int = Field(6, ge=0, le=30)
    """Halvings of the time step before the run ends."""
    ensemble: int | None = Field(None, ge=3, le=64)
    """With growth by `shapes`, the number of further runs with perturbed inputs, which
    give prediction intervals. They differ in registrations (smoothing; label
    boundaries), and in predictions also in the age of the start brain, the atlas, if
    several atlases cover the run, and the individual differences that persist."""
    ranks: int = Field(2, ge=1, le=4096)
    """MPI ranks of a simulation."""

    def problems(self) -> Problems:
        for key in GROWTH_RATES:
            if key not in self.growth.definition.rates and self.is_set(key):
                yield KeyProblem(
                    f"is not used by the growth model {self.growth.model}; remove it",
                    (key,),
                )

    @field_validator("*")
    @classmethod
    def _hold_bounds(cls, value: Any, info: ValidationInfo) -> Any:
        require_bounds(
            value,
            bounds_of(cls.model_fields[str(info.field_name)]),
        )
        return value


VARYING = tuple(
    name for name, field in FoldingSettings.model_fields.items() if bounds_of(field)
)
"""Parameters that may vary with week and place."""
GROWTH_RATES = tuple(name for name in VARYING if name.endswith("growth_rate_per_s"))


def mapped_parameters(settings: FoldingSettings) -> dict[str, Varying]:
    """Return the parameters of a run that have a map."""
    mapped = {}
    for name in VARYING:
        value = getattr(settings, name)
        if isinstance(value, Varying) and value.map is not None:
            mapped[name] = value
    return mapped


def plain_settings(settings: FoldingSettings) -> dict[str, Any]:
    """Return the settings of a run as plain values for `params_content`. A map has the
    name of its parameter.

    The number of ranks is left out, since results do not depend on it.
    """
    plain = settings.model_dump(
        mode="json",
        exclude={"ranks", "start", "ensemble"},
    )
    model = settings.growth.definition
    own_keys = {"model", *model.keys, *model.resolved}
    plain["growth"] = settings.growth.model_dump(mode="json", include=own_keys)
    mapped = mapped_parameters(settings)
    for name in VARYING:
        value = getattr(settings, name)
        if isinstance(value, Varying):
            plain[name] = {"weeks": value.weeks} if value.weeks else {}
        if name in mapped:
            plain[name]["map"] = name
    return plain


def output_weeks(
    start_week: float,
    end_week: float,
    every_gw: float,
) -> list[float]:
    """Return the output weeks of a run, to two decimals: the start, then every
    `every_gw` weeks, and the end."""
    steps = int((end_week - start_week) / every_gw + 1e-9)
    weeks = {end_week}
    for step in range(steps + 1):
        weeks.add(round(start_week + step * every_gw, 2))
    return sorted(weeks)


class FoldingParameters(FoldingSettings):
    """The content of a run's `params.yaml`: settings, start, output weeks and fissure.

    A map has the name of its parameter.
    """

    start_week: Week
    """Gestational age at the start. [GW]"""
    output_weeks: tuple[Week, ...]
    """Output weeks, from `start_week` to `end_week`. [GW]"""
    fissure_x_mm: float
    """Position of the interhemispheric fissure. [mm]"""
    side: Side | None = None
    """The only hemisphere that the brain has; `null`: it has both."""
    targets: dict[Week, str] = Field({})
    """With `growth.model: shapes`: by week what the names of the maps of the mesh's
    positions begin with. [GW]"""
    stops: tuple[Week, ...] = ()
    """Weeks of those targets that no brain was observed at: they lie on the way between
    two that were. [GW]"""

    @property
    def varying_maps(self) -> set[str]:
        """The names of the maps of parameters that vary over the brain."""
        names = {map_of(getattr(self, key)) for key in VARYING}
        return {name for name in names if name is not None}

    @property
    def maps(self) -> set[str]:
        """The names of the maps that the parameters need."""
        maps = self.varying_maps
        for name in self.targets.values():
            maps |= {f"{name}_{axis}" for axis in AXES}
        return maps

    def problems(self) -> Problems:
        weeks = list(self.output_weeks)
        ends = [self.start_week, self.end_week]
        if weeks != sorted(set(weeks)) or [*weeks[:1], *weeks[-1:]] != ends:
            yield KeyProblem(
                f"found {weeks}; they should ascend from start_week to end_week",
                ("output_weeks",),
            )
        if (self.growth.definition.measured == "shapes") != bool(self.targets):
            text = "is not used by" if self.targets else "is missing; it is needed by"
            yield KeyProblem(
                f"{text} the growth model {self.growth.model}", ("targets",)
            )
        yield from value_problems(self, self.start_week, {})


def value_problems(
    p: FoldingSettings,
    start_week: float,
    maps: Maps,
    start: str = "",
) -> Problems:
    """Yield the inconsistencies between the settings of a run, over all its weeks and
    vertices.

    Parameters whose maps are not among `maps` are left out. `start` is the name of the
    start in messages, such as "the week of the start brain a".
    """
    end = p.end_week
    if end <= start_week:
        called = f"{start_week:g}, {start}" if start else f"start_week, {start_week:g}"
        yield KeyProblem(
            f"found {end:g}; it should be above {called}",
            ("end_week",),
        )
    ranges = {}
    for key in VARYING:
        value = getattr(p, key)
        has_map = isinstance(value, Varying) and value.map is not None
        if not has_map or value.map in maps:
            ranges[key] = value_range(value, maps, start_week, end)
    units = {
        "thickness_mm": "mm",
        "shear_modulus_cortex_pa": "Pa",
        "shear_modulus_core_pa": "Pa",
    }
    for key, unit in units.items():
        if key in ranges and ranges[key][0] <= 0:
            least = ranges[key][0]
            yield KeyProblem(
                f"reaches {least:g} {unit}; it should stay above 0", (key,)
            )
    fastest = 0.0
    for key in GROWTH_RATES:
        if key in ranges:
            least, most = ranges[key]
            fastest += most
            if least < 0:
                yield KeyProblem(f"found {least:g}; it should be 0 or more", (key,))
    growth = p.step_s * fastest
    if growth >= 1:
        yield KeyProblem(
            f"found {p.step_s:g}; tissue would grow by {growth:.3g} in a step,"
            " beyond 1",
            ("step_s",),
        )


def params_content(
    settings: Mapping[str, Any],
    growth: Mapping[str, Any],
    weeks: Sequence[float],
    surface: Mapping[str, Any],
    target_weeks: Sequence[float],
    stops: Sequence[float],
) -> dict[str, Any]:
    """Return the content of the `params.yaml` of a run, `FoldingParameters` as plain
    values.

    `settings` are its `plain_settings`, `growth` is their section with sizes as numbers
    by week, `weeks` its output weeks, `surface` is the report of the start brain's
    surface. `target_weeks` are those of the shapes that it grows towards, `stops` the
    ones of them without an observed brain; both are empty for other growth.
    """
    content = {
        "start_week": weeks[0],
        "output_weeks": list(weeks),
        "fissure_x_mm": surface["fissure_x_mm"],
        "side": surface.get("side"),
        **settings,
    }
    if target_weeks:
        content["targets"] = {week: _target_map(week) for week in target_weeks}
        content["stops"] = list(stops)
    return content | {"growth": growth}


def _target_map(week: float) -> str:
    """Return what the names of the maps of positions that a mesh is to have at a week
    begin with."""
    return f"target_{week:05.2f}"


def target_maps(
    weeks: Iterable[float], positions: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Return the (n,) maps by name of the (w, n, 3) positions that a mesh is to have at
    w weeks."""
    maps = {}
    for week, places in zip(weeks, positions, strict=True):
        for axis, values in zip(AXES, places.T, strict=True):
            maps[f"{_target_map(week)}_{axis}"] = values
    return maps


def parameters_from(values: Any) -> FoldingParameters:
    """Return the parameters from nested mappings as read from YAML; InputError naming
    all problems at once."""
    return validated(FoldingParameters, values, "folding parameters")


def require_maps(
    p: FoldingParameters,
    maps: Maps,
    vertices: int,
) -> None:
    """Raise InputError where a map is missing, does not fit the mesh, or holds
    impossible values."""
    for name in sorted(p.maps):
        if name not in maps:
            raise InputError(
                f"the map {name} is missing",
                expected="a file with it, given with --maps",
            )
        if maps[name].shape != (vertices,):
            raise InputError(
                f"the map {name} does not fit the mesh",
                found=maps[name].shape,
                expected=f"{vertices} values",
            )
        n_bad = np.count_nonzero(~np.isfinite(maps[name]))
        if n_bad:
            raise InputError(
                f"the map {name} has NaN or infinity",
                found=f"{n_bad} of {vertices} values",
            )
    problems = list(value_problems(p, p.start_week, maps))
    if problems:
        raise InputError(f"folding parameters: {'; '.join(map(str, problems))}")
