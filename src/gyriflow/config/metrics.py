"""Settings of the metrics, and the brains that ages are told from."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import Field

from .base import Settings, setting
from .brains import Brain

LEAST_AGE_WEEKS = 5
"""Weeks of reference brains that an age profile needs."""


class MetricsSettings(Settings):
    """How curvature and the spectral analysis of gyrification (SpAnGy) are measured, on real and simulated brains."""

    curvature_radius_mm: float = setting(
        3.0, "mm",
        "Radius of the neighbourhood in which curvature is fitted, at least two edges of the surfaces; the same for "
        "all brains that are compared.",
        ge=0.5, le=20,
    )  # fmt: skip
    spangy_proxy: Literal["shape_index", "mean_curvature"] = setting(
        "shape_index", "", "The map whose spectrum is analysed."
    )
    spangy_modes: Annotated[int, Field(ge=2, le=20000)] | Literal["B4", "B5", "B6", "common", "own"] = setting(
        "B5", "",
        "Number of eigenmodes, from 2 to 20000, or the last band, all modes up to whose end are computed: `B4`, `B5` "
        "or `B6`, each four times as many as before; `common`: per hemisphere the largest Weyl number (modes that the "
        "shortest wavelength needs) of all measured and simulated brains of the study; `own`: that of the surface "
        "itself.",
    )  # fmt: skip
    spangy_wavelength: Literal["paper", "textbook"] = setting(
        "paper", "", "Relation of the shortest wavelength to λ: `paper` 2π/WL², `textbook` (2π/WL)²."
    )
    age_reference: tuple[str, ...] | None = setting(
        None, "",
        "Ids of the measured brains that gestational ages are told from, of five weeks or more. `null`: all that are "
        "not synthetic (of several populations, that of the start brain), or all phantoms where there are no others; "
        "no age profile with fewer than five weeks.",
    )  # fmt: skip


def age_reference(brains: Sequence[Brain], given: tuple[str, ...] | None, population: str | None = None) -> list[str]:
    """Returns the ids of the brains that ages are told from; none where they are of too few weeks.

    Where none are `given` and the real ones are of several populations, those of `population` are taken.
    """
    real = [brain for brain in brains if not brain.synthetic] or [b for b in brains if b.source == "phantom"]
    if len({brain.population for brain in real}) > 1:
        real = [brain for brain in real if brain.population == population]
    chosen = real if given is None else [brain for brain in brains if brain.id in given]
    return [brain.id for brain in chosen] if len({brain.week for brain in chosen}) >= LEAST_AGE_WEEKS else []


def age_reference_problems(brains: Sequence[Any], metrics: Any) -> list[str]:
    """Returns what is wrong with the brains that ages are told from, of all brains and settings as given (raw)."""
    entries = [entry for entry in brains if isinstance(entry, dict) and isinstance(entry.get("id"), str)]
    weeks = {entry["id"]: entry.get("week") for entry in entries}
    given = metrics.get("age_reference") if isinstance(metrics, dict) else None
    if not isinstance(given, list) or not all(isinstance(name, str) for name in given):
        return []
    if unknown := [name for name in given if name not in weeks]:
        return [f"metrics.age_reference: found {', '.join(unknown)}; expected ids of brains: {', '.join(weeks)}"]
    found = len({str(weeks[name]) for name in given})
    if found >= LEAST_AGE_WEEKS:
        return []
    plural = "" if found == 1 else "s"
    return [f"metrics.age_reference: found brains of {found} week{plural}; it should have {LEAST_AGE_WEEKS} or more"]
