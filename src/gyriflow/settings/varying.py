"""Parameters that may vary in time and space: a number, a curve over weeks, a map over
the brain, or both."""

import operator
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator
from pydantic.fields import FieldInfo

from ..formats import format_of, is_volume
from .base import FirstIf, InputFile, KeyProblem, Problems, Settings
from .weeks import AnyWeek, week_of

Maps = Mapping[str, NDArray[np.float64]]
"""Values at the mesh vertices, by parameter name. They move with the tissue."""
FileOrPair = Annotated[tuple[InputFile, InputFile] | InputFile, FirstIf(list | tuple)]


class Varying(Settings):
    """A parameter that varies: a curve over `weeks`, a `map` over the brain, or their
    product.

    A map is a GIFTI file with a value per vertex of `surface` (or one for each
    hemisphere), or a NIfTI volume in world coordinates. Maps move with the tissue.
    """

    weeks: dict[AnyWeek, float] | None = None
    """Values by week, such as `{21: 1.5, 30: 2.0}`: linear in between, constant
    outside. [GW]"""
    map: FileOrPair | None = None
    """File with the values, or a list of the left and the right one."""
    surface: FileOrPair | None = None
    """Surface file of the map, or the left and the right one."""

    @field_validator("weeks", mode="before")
    @classmethod
    def _numbers_by_week(cls, value: Any) -> Any:
        if isinstance(value, dict):
            if any(isinstance(number, bool) for number in value.values()):
                raise ValueError("should contain numbers, not true or false")
            if len({week_of(week) for week in value}) < len(value):
                raise ValueError("should contain each week only once")
        return value

    @field_validator("weeks")
    @classmethod
    def _by_week(cls, value: dict[float, float] | None) -> dict[float, float] | None:
        return None if value is None else dict(sorted(value.items()))

    def problems(self) -> Problems:
        if not self.weeks and self.map is None:
            yield KeyProblem("found no values; expected a number, `weeks` or a `map`")
        maps, surfaces = files_of(self.map), files_of(self.surface)
        if surfaces and not maps:
            yield KeyProblem("has a `surface` but no `map`", ("surface",))
        elif surfaces and len(maps) != len(surfaces):
            yield KeyProblem("should have as many files as `map`", ("surface",))
        elif surfaces and any(map(is_volume, maps)):
            yield KeyProblem(
                "is not used if the map is a volume; remove it", ("surface",)
            )
        elif not surfaces and (
            len(maps) > 1 or any(format_of(path, "surface") for path in maps)
        ):
            yield KeyProblem(
                "is missing; it is the surface that the values of the map belong to",
                ("surface",),
            )


def files_of(files: str | tuple[str, str] | None) -> list[str]:
    """Return the files of a map or of its surface as a list."""
    return [files] if isinstance(files, str) else list(files or ())


VaryingNumber = Annotated[Varying | float, FirstIf(dict | Varying)]
"""A number, a curve or a map."""


BOUND_TEXTS = {
    "gt": ("exclusiveMinimum", "greater than", operator.gt),
    "ge": ("minimum", "greater than or equal to", operator.ge),
    "le": ("maximum", "less than or equal to", operator.le),
}
"""Bounds of varying parameters: their names in JSON schemas, in messages, and their
operators."""


def varying(default: float, **bounds: float) -> Any:
    """Return a field for a parameter that may vary; `bounds` (gt, ge, le) apply to each
    number in it."""
    extra: dict[str, Any] = {}
    for name, bound in bounds.items():
        key, *_ = BOUND_TEXTS[name]
        extra[key] = bound
    return Field(default, json_schema_extra=extra)


def bounds_of(field: FieldInfo) -> dict[str, float]:
    """Return the bounds (gt, ge, le) of a parameter that may vary; empty for other
    keys."""
    extra: Any = field.json_schema_extra or {}
    return {name: extra[key] for name, (key, *_) in BOUND_TEXTS.items() if key in extra}


def require_bounds(value: float | Varying, bounds: Mapping[str, float]) -> None:
    """Raise ValueError if a number, or one of a curve without a map, is out of
    bounds."""
    if not isinstance(value, Varying):
        numbers = [value]
    elif value.map is None:
        numbers = list(_weeks_of(value).values())
    else:
        numbers = []
    for name, bound in bounds.items():
        _, text, holds = BOUND_TEXTS[name]
        if not all(holds(number, bound) for number in numbers):
            raise ValueError(f"should be {text} {bound:g}")


def map_of(value: float | Varying) -> str | None:
    """Return the name of the map of a parameter in a run's parameters, or None."""
    if isinstance(value, Varying) and isinstance(value.map, str):
        return value.map
    return None


def _weeks_of(value: float | Varying) -> dict[float, float]:
    """Return the curve of a parameter, {week: value} in ascending order; empty if it
    has none."""
    return (value.weeks or {}) if isinstance(value, Varying) else {}


def curve_at(value: float | Varying, week: float) -> float:
    """Return the number, or the curve's value at a week: linear in between, constant
    outside, 1 without a curve."""
    if not isinstance(value, Varying):
        return value
    curve = _weeks_of(value)
    if not curve:
        return 1.0
    return float(
        np.interp(
            week,
            list(curve),
            list(curve.values()),
        )
    )


def mean_of_curve(value: float | Varying) -> float:
    """Return the mean of a parameter's curve over its weeks, 1 without a curve: about
    what its map is multiplied by."""
    curve = _weeks_of(value)
    if not curve:
        return 1.0
    return float(np.mean([*curve.values()]))


def value_at(
    value: float | Varying,
    week: float,
    maps: Maps,
) -> float | NDArray[np.float64]:
    """Return a parameter's value at a week: a number, or (n,) values if it has a
    map."""
    factor = curve_at(value, week)
    name = map_of(value)
    return factor if name is None else factor * maps[name]


def value_range(
    value: float | Varying,
    maps: Maps,
    start: float,
    end: float,
) -> tuple[float, float]:
    """Return the smallest and the largest value of a parameter between two weeks, over
    all vertices."""
    name = map_of(value)
    places = np.ones(1) if name is None else maps[name]
    # the extremes of a curve lie at its weeks, or at the ends
    weeks = [start, end]
    for week in _weeks_of(value):
        if start < week < end:
            weeks.append(week)
    curve = [curve_at(value, week) for week in weeks]
    extremes = [places.min(), places.max()]
    products = np.outer(curve, extremes)
    return float(products.min()), float(products.max())
