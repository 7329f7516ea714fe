"""The section `folding.growth`: by which of three models the brain grows."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Discriminator, Field, Tag, model_validator

from .base import KeyProblem, Settings
from .varying import AnyWeek

SizeCurve = Annotated[
    Annotated[dict[AnyWeek, Annotated[float, Field(gt=0)]], Tag("(table)")]
    | Annotated[Literal["measured"], Tag("(word)")],
    Discriminator(lambda value: "(table)" if isinstance(value, dict) else "(word)"),
]
"""A size by gestational week, or the curve through the measured brains."""
SIZES = ("area_cm2", "volume_ml")
"""Keys of the sizes that growth can follow."""
MODELS_OF_KEY = {
    "of": ("shapes",),
    "thickness_mm": ("sizes", "shapes"),
    **dict.fromkeys(SIZES, ("sizes", "shapes")),
}
BEFORE_GW = 1.0
"""How far before the first week of an atlas a brain may be that is to grow as the atlas does."""


class Growth(Settings):
    """The model that the brain grows by; its name alone will do, as in `growth: shapes`."""

    model_config = ConfigDict(json_schema_extra={"type": ["object", "string", "null"]})

    model: Literal["rates", "sizes", "shapes"] = "rates"
    """`rates`: those of the keys that end with `growth_rate_per_s`; `sizes`: in each step the rates of cortex and
    core that lead to curves of area and volume, which a brain off its curves joins within a week; `shapes`: in each
    step what takes the brain to the shape that it is to have by the next known week."""
    of: Literal["self", "atlas"] = "self"
    """With `shapes`, whose these are: of the start's own later brains (`self`), or what the growth of another
    population, such as an `atlas`, would make of the start: a prediction."""
    area_cm2: SizeCurve = "measured"
    """With `sizes`, pial area of both hemispheres by week, as `{21: 99, 30: 252}`; `measured`: a smooth curve through
    the brains of the start's growth series. [cm²]"""
    volume_ml: SizeCurve = "measured"
    """With `sizes`, volume inside the pial surface, likewise. [mL]"""
    thickness_mm: SizeCurve | None = None
    """With `sizes` and `shapes`, mean cortical thickness, likewise; `null`: the run's `thickness_mm`. [mm]"""

    @model_validator(mode="before")
    @classmethod
    def _model_alone(cls, raw: Any) -> Any:
        return {"model": raw} if isinstance(raw, str) else raw

    def own_keys(self) -> dict[str, Any]:
        """Return the model and the keys that mean something with it, as they are written in a file."""
        values = self.model_dump(mode="json")
        return {key: value for key, value in values.items() if self.model in MODELS_OF_KEY.get(key, (self.model,))}

    def problems(self) -> Iterator[KeyProblem]:
        for key, models in MODELS_OF_KEY.items():
            if self.model not in models and getattr(self, key) != type(self).model_fields[key].default:
                yield KeyProblem(f"has no meaning with the model {self.model}; expected {' or '.join(models)}", (key,))
        if self.of == "atlas" and self.thickness_mm == "measured":
            yield KeyProblem("is measured on the start's own later brains, unknown to a prediction", ("thickness_mm",))
