"""Parameters that vary: a number, a curve over weeks, a map over the brain, a map times a curve, or an estimate."""

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from .base import Settings, setting

Week = Annotated[float, Field(ge=15, le=45)]
TAGS = ("number", "table", "word", "list")
"""Names of the kinds of value, which stand in the place of an error but are no keys."""


class VaryingSettings(Settings):
    """A parameter that varies: a curve over `weeks`, a `map` over the brain, or both, which are multiplied.

    A map is a GIFTI file with one value per vertex of `surface` (or one such file for each hemisphere), or a NIfTI
    volume in world coordinates, without `surface`. Maps move with the tissue.
    """

    weeks: dict[Week, float] | None = setting(
        None, "GW", "Values by gestational week, as `{21: 1.5, 30: 2.0}`: linear in between, constant beyond."
    )
    map: str | tuple[str, str] | None = setting(
        None, "", "File with the values, or the left and the right hemisphere's."
    )
    surface: str | tuple[str, str] | None = setting(
        None, "", "Surface file, or the left and the right one, of the map."
    )

    @field_validator("weeks", mode="before")
    @classmethod
    def _numbers_by_week(cls, value: Any) -> Any:
        if isinstance(value, dict):
            if any(isinstance(number, bool) for number in value.values()):
                raise ValueError("hold numbers, not true or false")
            if len({float(week) for week in value}) < len(value):
                raise ValueError("name each week once")
        return value

    @model_validator(mode="after")
    def _has_something(self) -> "VaryingSettings":
        if not self.weeks and self.map is None:
            raise ValueError("have `weeks` or a `map`")
        if self.surface is not None and self.map is None:
            raise ValueError("have a `map` where it has a `surface`")
        if self.surface is not None and isinstance(self.map, str) != isinstance(self.surface, str):
            raise ValueError("have as many maps as surfaces")
        files = [self.map] if isinstance(self.map, str) else list(self.map or ())
        if self.surface is None and any(path.endswith(".gii") for path in files):
            raise ValueError("name under `surface` the surface whose vertices the map belongs to")
        if self.surface is not None and any(path.endswith((".nii", ".nii.gz")) for path in files):
            raise ValueError("have no `surface` where the map is a volume")
        if isinstance(self.map, tuple) and self.surface is None:
            raise ValueError("name the surfaces of the two maps under `surface`")
        return self


def _kind(value: Any) -> str:
    if isinstance(value, dict | VaryingSettings):
        return "table"
    return "word" if value == "estimated" else "number"


Varying = Annotated[
    Annotated[float, Tag("number")] | Annotated[VaryingSettings, Tag("table")],
    Discriminator(lambda value: "table" if _kind(value) == "table" else "number"),
]
"""A number, or what `VaryingSettings` says."""

VaryingOrEstimated = Annotated[
    Annotated[float, Tag("number")]
    | Annotated[VaryingSettings, Tag("table")]
    | Annotated[Literal["estimated"], Tag("word")],
    Discriminator(_kind),
]
"""Also `estimated`: the curve that the growth stage finds."""


def varying(default: float, unit: str, description: str, **bounds: float) -> Any:
    """Returns a field for a parameter that may vary; `bounds` (gt, ge, le) hold for each number in it."""
    return Field(default, description=description, json_schema_extra={"unit": unit, "bounds": dict(bounds)})


BOUND_TEXTS = {
    "gt": ("greater than", lambda value, bound: value > bound),
    "ge": ("greater than or equal to", lambda value, bound: value >= bound),
    "le": ("less than or equal to", lambda value, bound: value <= bound),
}


def require_bounds(value: float | VaryingSettings | str, bounds: dict[str, float]) -> None:
    """Raises ValueError where a number, or one of a curve without a map, is out of its bounds."""
    if isinstance(value, str):
        return
    if isinstance(value, VaryingSettings):
        numbers = [] if value.map is not None else list((value.weeks or {}).values())
    else:
        numbers = [value]
    for name, bound in bounds.items():
        text, holds = BOUND_TEXTS[name]
        if not all(holds(number, bound) for number in numbers):
            raise ValueError(f"be {text} {bound:g}")
