"""Settings of the metrics, and the brains from which the apparent age is estimated."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Discriminator, Field, Tag

from ..parameters.metrics import (
    CURVATURE_RADIUS_MM,
    SPANGY_MODES,
    SPANGY_PROXY,
    SPANGY_WAVELENGTH,
    ExportNames,
    ModesWord,
    SpangyProxy,
    WeylFormula,
)
from ..parameters.settings import Settings, setting
from .brains import Brain
from .regions import GivenRegions

LEAST_AGE_WEEKS = 5
"""Least number of weeks of reference brains for an age profile."""
Modes = Annotated[
    Annotated[int, Field(ge=2, le=20000), Tag("(number)")] | Annotated[ModesWord, Tag("(word)")],
    Discriminator(lambda value: "(word)" if isinstance(value, str) and not value.isdigit() else "(number)"),
]


class MetricsSettings(Settings):
    """How curvature and the spectral analysis of gyrification (SpAnGy) are measured, on real and simulated brains."""

    curvature_radius_mm: float = setting(
        CURVATURE_RADIUS_MM, "mm",
        "Radius of the neighbourhood in which curvature is fitted, at least two edges of the surfaces; the same for "
        "all brains that are compared.",
        ge=0.5, le=20,
    )  # fmt: skip
    spangy_proxy: SpangyProxy = setting(SPANGY_PROXY, "", "The map whose spectrum is analysed.")
    spangy_modes: Modes = setting(
        SPANGY_MODES, "",
        "Number of eigenmodes: a number from 2 to 20000; the last complete band, `B4`, `B5` or `B6` (each needs four "
        "times as many modes as the one before); `common`: per hemisphere the largest Weyl number (modes needed for "
        "the shortest wavelength) of all measured and simulated brains of the study; `own`: that of each surface.",
    )  # fmt: skip
    spangy_wavelength: WeylFormula = setting(
        SPANGY_WAVELENGTH, "", "Relation between the shortest wavelength WL and λ: `paper` 2π/WL², `textbook` (2π/WL)²."
    )
    age_reference: tuple[str, ...] | None = setting(
        None, "",
        "Ids of the measured brains from which apparent ages are estimated, of at least five weeks. `null`: all that "
        "are not synthetic (of several populations, that of the start brain), or all phantoms if there are no others. "
        "There is no age profile with fewer than five weeks. Those with other hemispheres than the first start brain "
        "are left out.",
    )  # fmt: skip
    norm_reference: tuple[str, ...] | None = setting(
        None, "",
        "Ids of the measured brains that others, and each of themselves, are compared with in tables of centiles. "
        "`null`: chosen as for `age_reference`, of any number of weeks. Those with other hemispheres than the first "
        "start brain are left out.",
    )  # fmt: skip
    regions: dict[str, GivenRegions] = setting(
        {}, "",
        "Regions of the cortex by the id of the brain that they are given on; they are carried to all other brains by "
        "registration, and with the tissue to simulated ones.",
    )  # fmt: skip
    export: ExportNames = setting(
        "plain", "", "Names of the files that the target `export` writes: `plain`, or those of `bids` derivatives."
    )


def age_reference(brains: Sequence[Brain], given: tuple[str, ...] | None, population: str | None = None) -> list[str]:
    """Returns the ids of the brains from which apparent ages are estimated; none if they cover too few weeks.

    Chosen as by `reference_brains`.
    """
    chosen = reference_brains(brains, given, population)
    weeks = {brain.week for brain in brains if brain.id in chosen}
    return chosen if len(weeks) >= LEAST_AGE_WEEKS else []


def reference_brains(
    brains: Sequence[Brain], given: tuple[str, ...] | None, population: str | None = None
) -> list[str]:
    """Returns the ids of the measured brains that others are compared with: the given ones, or else all real ones.

    If none are `given` and the real ones are of several populations, those of `population` are used; phantoms where no
    brain is real.
    """
    real = [brain for brain in brains if not brain.synthetic] or [b for b in brains if b.source == "phantom"]
    if len({brain.population for brain in real}) > 1:
        real = [brain for brain in real if brain.population == population]
    chosen = real if given is None else [brain for brain in brains if brain.id in given]
    return [brain.id for brain in chosen]
