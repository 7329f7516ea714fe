"""Settings of simple shapes that take the place of brains."""

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from .base import KeyProblem, Settings

MAX_AXIS_RATIO = 2.0
"""Limit of longest over shortest semi-axis; the ends of longer shapes are too sharp for even triangles."""
MAX_NOISE = 0.02
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
        if longest > MAX_AXIS_RATIO * shortest:
            text = f"found {longest:g} as the longest; expected at most {MAX_AXIS_RATIO:g} times the shortest"
            yield KeyProblem(text, ("semi_axes_mm",))
        # the default suits the default sizes; only a given value can be wrong
        if self.is_set("noise_mm") and self.noise_mm > MAX_NOISE * shortest:
            text = f"found {self.noise_mm:g}; expected at most {MAX_NOISE * shortest:g}, a fiftieth of the shortest"
            yield KeyProblem(f"{text} semi-axis", ("noise_mm",))
