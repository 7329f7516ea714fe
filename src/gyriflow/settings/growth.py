"""The section `folding.growth`, and the registry of growth models for all parts of
gyriflow but the solver."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from .base import FirstIf, KeyProblem, Problems, Settings
from .weeks import AnyWeek

SizeCurve = Annotated[
    dict[AnyWeek, Annotated[float, Field(gt=0)]] | Literal["measured"], FirstIf(dict)
]
"""A size by gestational week, or the curve through the measured brains."""
SIZES = ("area_cm2", "volume_ml")
"""Keys of the sizes that growth can follow."""
ModelName = Literal["rates", "sizes", "shapes"]
Origin = Literal["self", "atlas"]
"""Source of a run's growth: the start brain's own series, or another population."""


@dataclass(frozen=True)
class GrowthModel:
    """Properties of a growth model for configuration, planning, figures and methods
    text.

    Attributes
    ----------
    keys
        Keys of `folding.growth` that a configuration may give for it, besides `model`.
    resolved
        Further keys of `folding.growth` that only the program gives, in a run's
        `params.yaml`.
    rates
        Growth rates of `folding` that it uses.
    measured
        What it follows of measured brains; a run that follows the observed brains
        themselves is `explained`, all others are `predicted`.
    sentence
        Returns its sentence of the methods text for a run (with `parameters` and
        `growth_of`), given how numbers are written.
    has_layers
        Whether cortex and core grow at rates of their own, so that folds depend on the
        elements through the cortex.
    """

    keys: tuple[str, ...]
    rates: tuple[str, ...]
    measured: Literal["sizes", "shapes"] | None
    sentence: Callable[[Mapping[str, Any], Callable[[Any], str]], str]
    resolved: tuple[str, ...] = ()
    has_layers: bool = True


def _rates_sentence(run: Mapping[str, Any], number: Callable[[Any], str]) -> str:
    parameters = run["parameters"]
    cortex = number(parameters["growth_rate_per_s"])
    core = number(parameters["core_growth_rate_per_s"])
    return f"The cortex grew tangentially at {cortex} per second, the core at {core}."


def _sizes_sentence(run: Mapping[str, Any], number: Callable[[Any], str]) -> str:
    source = ""
    if _is_from_population(run):
        source = f" through brains of several subjects ({run['growth_of']}), {NOT_OWN}"
    return (
        "Growth rates of cortex and core were set in each step so that area and volume"
        f" followed curves{source}."
    )


def _shapes_sentence(run: Mapping[str, Any], number: Callable[[Any], str]) -> str:
    if _is_from_population(run):
        target = (
            f"that given by the growth of several subjects ({run['growth_of']}),"
            f" {NOT_OWN}"
        )
    elif run["parameters"]["growth"]["of"] == "atlas":
        target = "that given by the growth of an atlas"
    else:
        target = "its own later shape"
    return (
        "In each step the brain grew towards a target shape for the next known week:"
        f" {target}."
    )


NOT_OWN = "a population's growth and not the subject's own"


def _is_from_population(run: Mapping[str, Any]) -> bool:
    return run["growth_of"].startswith("population")


GROWTH_MODELS: dict[ModelName, GrowthModel] = {
    "rates": GrowthModel(
        keys=(),
        rates=("growth_rate_per_s", "core_growth_rate_per_s"),
        measured=None,
        sentence=_rates_sentence,
    ),
    "sizes": GrowthModel(
        keys=SIZES,
        rates=(),
        measured="sizes",
        sentence=_sizes_sentence,
    ),
    "shapes": GrowthModel(
        keys=("of",),
        rates=(),
        measured="shapes",
        sentence=_shapes_sentence,
        resolved=SIZES,
        has_layers=False,
    ),
}
BEFORE_GW = 1.0
"""How far before the first week of an atlas a brain may be that is to grow as the atlas
does."""


class Growth(Settings):
    """The model that the brain grows by; its name alone will do, as in `growth:
    shapes`."""

    model_config = ConfigDict(json_schema_extra={"type": ["object", "string", "null"]})
    short_key = ("model", str)

    model: ModelName = "rates"
    """`rates`: those of the keys that end with `growth_rate_per_s`; `sizes`: in each
    step the rates of cortex and core that lead to curves of area and volume, which a
    brain off its curves joins within a week; `shapes`: in each step what takes the
    brain to the shape that it is to have by the next known week."""
    of: Origin = "self"
    """With `shapes`, whose these are: of the start's own later brains (`self`), or what
    the growth of another population, such as an `atlas`, would make of the start: a
    prediction."""
    area_cm2: SizeCurve = "measured"
    """With `sizes`, pial area of both hemispheres by week, as `{21: 99, 30: 252}`;
    `measured`: a smooth curve through the brains of the start's growth series. [cm²]"""
    volume_ml: SizeCurve = "measured"
    """With `sizes`, volume inside the pial surface, likewise. [mL]"""

    @property
    def definition(self) -> GrowthModel:
        """The growth model."""
        return GROWTH_MODELS[self.model]

    @property
    def shapes(self) -> Origin | None:
        """The source of the shapes that the brain grows towards; None for growth by
        rates or sizes."""
        return self.of if self.definition.measured == "shapes" else None

    @property
    def follows_sizes(self) -> bool:
        """True if it follows curves of measured area or volume."""
        return self.definition.measured == "sizes" and "measured" in (
            self.area_cm2,
            self.volume_ml,
        )

    def unused_keys(self, used: Collection[str]) -> Problems:
        """Yield a problem for each key that differs from its default but is not among
        those used."""
        for key, field in type(self).model_fields.items():
            if key in ("model", *used) or getattr(self, key) == field.default:
                continue
            users = [name for name, model in GROWTH_MODELS.items() if key in model.keys]
            yield KeyProblem(
                f"is not used by the growth model {self.model}; remove it, or use the"
                f" model {' or '.join(users)}",
                (key,),
            )

    def problems(self) -> Problems:
        yield from self.unused_keys((*self.definition.keys, *self.definition.resolved))
