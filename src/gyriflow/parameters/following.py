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


class Follow(Settings):
    """Growth that follows a brain: before each step the rates of cortex and core are set so that both curves are met.

    A brain that does not start on the curves comes onto them within its first week.
    """

    area_cm2: SizeCurve = setting(
        "measured", "cm²",
        "Pial area of both hemispheres by gestational week, as `{21: 99, 30: 252}`; `measured`: a smooth curve through "
        "the brains of the start's growth series.",
    )  # fmt: skip
    volume_ml: SizeCurve = setting(
        "measured", "mL", "Volume inside the pial surface by gestational week, or `measured`; likewise."
    )
    thickness_mm: SizeCurve | None = setting(
        None, "mm",
        "Cortical thickness by gestational week, or `measured`, a curve through the mean thickness of these brains; "
        "`null`: the run's `thickness_mm`.",
    )  # fmt: skip
    ventricles_ml: SizeCurve | None = setting(
        None, "mL",
        "Volume of the ventricles by gestational week, or `measured`, a curve through that of these brains' labels: "
        "they then grow by a rate of their own, and the core around them by what remains. `null`: like the core.",
    )  # fmt: skip
    regional: float = setting(
        0.0, "",
        "How much of the measured differences between regions growth has: 0 none, 1 all; they come from registering "
        "the brains of successive weeks, or from their surfaces' vertices if these are matched.",
        ge=0, le=2,
    )  # fmt: skip
    smoothing_mm: float = setting(
        6.0, "mm", "Standard deviation of the Gaussian that smooths measured local growth.", ge=1, le=50
    )
    smoothing_gw: float = setting(
        0.0, "GW",
        "Standard deviation of the Gaussian over the weeks that smooths measured local growth: brains of successive "
        "weeks are other fetuses.",
        ge=0, le=20,
    )  # fmt: skip
    cortex: Literal["volume", "area"] = setting(
        "volume", "",
        "What the cortex's regional growth is that of: `volume` of the tissue, like the core's, or `area` of the pial "
        "surface.",
    )  # fmt: skip
    directional: float = setting(
        0.0, "",
        "How much of the measured differences between directions growth has: 0 none, 1 all. Cortex and core then grow "
        "by their rates in all directions, and by the measured strain without change of volume.",
        ge=0, le=2,
    )  # fmt: skip
    known_until_gw: Week | None = setting(
        None, "GW",
        "Only brains up to this week give curves and maps, earlier ones than the start's among them, and what comes "
        "after is extrapolated: a prediction. `null`: all brains.",
    )  # fmt: skip
    rotated: bool = setting(
        False, "", "Whether the maps are rotated over the brain at random, which keeps their smoothness: a null model."
    )
    noise: float = setting(
        0.0,
        "",
        "Standard deviation of random differences of growth, as a part of the mean, vertex by vertex.",
        ge=0,
        le=1,
    )
    seed: int = setting(0, "", "Of the rotation and of the noise.", ge=0)

    @check
    def _directions_are_not_rotated(self) -> Iterator[Problem]:
        if self.gives("directional") and self.directional > 0 and self.gives("rotated") and self.rotated:
            yield Problem("rotates maps of growth, not of its directions: set directional to 0", ("rotated",))
