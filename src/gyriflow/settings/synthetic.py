"""Settings of simple shapes in place of brains."""

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from .base import KeyProblem, Settings

MOST_UNEQUAL_AXES = 2.0
"""Longest over shortest semi-axis of a shape: beyond this the ends are too sharp for even triangles."""
MOST_NOISE = 0.02
"""Largest height of the bumps relative to the shortest semi-axis."""
Length = Annotated[float, Field(ge=5, le=150)]


class ShapeSettings(Settings):
    """An ellipsoid in place of a brain, for teaching and verification, centred on the origin; `{}` is one of 21 GW."""

    semi_axes_mm: tuple[Length, Length, Length] = (21.0, 28.0, 22.0)
    """Semi-axes along X, Y, Z, all the same for a sphere; the longest is at most twice the shortest. [mm]"""
    noise_mm: float = Field(0.05, ge=0, le=0.5)
    """Root mean square height of the smooth bumps that start the folding, at most a fiftieth of the shortest
    semi-axis. [mm]"""
    seed: int = Field(0, ge=0)
    """Seed of the bumps' random pattern."""

    @property
    def kind(self) -> str:
        return "sphere" if len(set(self.semi_axes_mm)) == 1 else "ellipsoid"

    def problems(self) -> Iterator[KeyProblem]:
        shortest, longest = min(self.semi_axes_mm), max(self.semi_axes_mm)
        if longest > MOST_UNEQUAL_AXES * shortest:
            text = f"found {longest:g} as the longest; expected at most {MOST_UNEQUAL_AXES:g} times the shortest"
            yield KeyProblem(text, ("semi_axes_mm",))
        # the default suits the default sizes; only a given value can be wrong
        if self.is_set("noise_mm") and self.noise_mm > MOST_NOISE * shortest:
            text = f"found {self.noise_mm:g}; expected at most {MOST_NOISE * shortest:g}, a fiftieth of the shortest"
            yield KeyProblem(f"{text} semi-axis", ("noise_mm",))
