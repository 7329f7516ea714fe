"""What growth follows of measured brains: curves of their size, and where and in which directions they grow."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from .settings import Problem, Settings, check, setting
from .varying import Week

SizeCurve = Annotated[
    Annotated[dict[Week, Annotated[float, Field(gt=0)]], Tag("(table)")]
    | Annotated[Literal["measured"], Tag("(word)")],
    Discriminator(lambda value: "(table)" if isinstance(value, dict) else "(word)"),
]
"""A size by gestational week, or the curve through the measured brains."""


OPEN_ONLY = ("regional", "directional", "cortex", "smoothing_gw", "known_until_gw", "rotated", "noise", "ventricles_ml")
"""What changes growth that is measured, and cannot change shapes."""
BEFORE_GW = 1.0
"""How far before the first week of the population that tells of its growth a brain may be."""


class Follow(Settings):
    """Growth that follows a brain: each step's rates of cortex and core are set so that area and volume meet curves.

    A brain that does not start on the curves comes onto them within its first week.
    """

    area_cm2: SizeCurve = setting(
        "measured", "cm²",
        "Pial area of both hemispheres by week, as `{21: 99, 30: 252}`; `measured`: a smooth curve through the brains "
        "of the start's growth series.",
    )  # fmt: skip
    volume_ml: SizeCurve = setting("measured", "mL", "Volume inside the pial surface, likewise.")
    thickness_mm: SizeCurve | None = setting(
        None, "mm", "Mean cortical thickness, likewise; `null`: the run's `thickness_mm`."
    )
    ventricles_ml: SizeCurve | None = setting(
        None, "mL",
        "Volume of the ventricles, likewise, from labels. They then have a growth rate of their own. `null`: they grow "
        "like the core.",
    )  # fmt: skip
    regional: float = setting(
        0.0, "",
        "Part of the measured differences between regions that growth has. They come from registered brains of "
        "successive weeks, or from matched vertices of their surfaces.",
        ge=0, le=2,
    )  # fmt: skip
    smoothing_mm: float = setting(
        6.0, "mm", "Standard deviation of the Gaussian that smooths measured growth in space.", ge=1, le=50
    )
    smoothing_gw: float = setting(
        0.0, "GW", "The same over weeks, of which each has brains of other fetuses.", ge=0, le=20
    )
    cortex: Literal["volume", "area"] = setting(
        "volume", "", "Whether regional growth of the cortex is that of its `volume`, or of the pial `area`."
    )
    directional: float = setting(
        0.0, "",
        "Part of the measured differences between directions that growth has. Cortex and core then grow in all "
        "directions by their rates, and by the measured strain without change of volume.",
        ge=0, le=2,
    )  # fmt: skip
    loop: Literal["open", "closed"] = setting(
        "open", "",
        "`open`: growth is what is measured between brains of successive weeks. `closed`: in each step, what takes the "
        "simulated brain to the shape that it is to have by the next of these weeks; smoothing and mechanics then do "
        "not add up, and curves and amounts of growth have no meaning.",
    )  # fmt: skip
    growth_of: Literal["own", "another"] = setting(
        "own", "",
        "Whose growth that is: of the start's `own` series, or of `another` population, such as an atlas. The brain is "
        "then expected to move as the atlas does and to keep what sets it apart: a prediction.",
    )  # fmt: skip
    known_until_gw: Week | None = setting(
        None, "GW",
        "A prediction: only brains up to this week, and earlier ones than the start, give curves and maps, which are "
        "extrapolated. `null`: all brains.",
    )  # fmt: skip
    rotated: bool = setting(
        False, "", "Null model: maps are rotated over the brain at random, which keeps their smoothness."
    )
    noise: float = setting(
        0.0, "", "Standard deviation of random growth at each vertex, as a part of the mean.", ge=0, le=1
    )
    seed: int = setting(0, "", "Seed of rotation and noise.", ge=0)

    @check
    def _closed_loop_takes_whole_shapes(self) -> Iterator[Problem]:
        if self.growth_of == "another":
            for key in ("thickness_mm", "ventricles_ml"):
                if getattr(self, key) == "measured":
                    text = "is measured on the start's own later brains, which a prediction must not know"
                    yield Problem(text, (key,))
            if self.known_until_gw is not None:
                yield Problem("has no meaning with growth of another population", ("known_until_gw",))
        if self.loop == "open":
            return
        for key in OPEN_ONLY:
            if getattr(self, key) != type(self).model_fields[key].default:
                yield Problem("has no meaning where growth leads to whole shapes: set loop to open", (key,))

    @check
    def _directions_are_not_rotated(self) -> Iterator[Problem]:
        if self.directional > 0 and self.rotated:
            yield Problem("rotates maps of growth, not of its directions: set directional to 0", ("rotated",))
