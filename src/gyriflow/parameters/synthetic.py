"""Settings of simple shapes in place of brains."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from .settings import Problem, Settings

SHAPE_SIZES = {"sphere": "radius_mm", "ellipsoid": "semi_axes_mm"}
"""The key that holds the size of each kind of shape."""
MOST_UNEQUAL_AXES = 2.0
"""Longest over shortest semi-axis of a shape: beyond this the ends are too sharp for even triangles."""
MOST_NOISE = 0.02
"""Largest height of the bumps relative to the smallest size of a shape."""

Length = Annotated[float, Field(ge=5, le=150)]


class ShapeSettings(Settings):
    """A simple geometry in place of a brain, for teaching and verification, centred on the origin."""

    kind: Literal["sphere", "ellipsoid"]
    """`sphere` or `ellipsoid`."""
    radius_mm: float = Field(23.0, ge=5, le=150)
    """Radius of a sphere. [mm]"""
    semi_axes_mm: tuple[Length, Length, Length] = (21.0, 28.0, 22.0)
    """Semi-axes along X, Y, Z of an ellipsoid; the longest is at most twice the shortest. [mm]"""
    noise_mm: float = Field(0.05, ge=0, le=0.5)
    """Root mean square height of the smooth bumps that start the folding, at most a fiftieth of the smallest
    size. [mm]"""
    seed: int = Field(0, ge=0)
    """Seed of the bumps' random pattern."""

    @property
    def size_mm(self) -> tuple[float, float, float]:
        """The three semi-axes."""
        return (self.radius_mm,) * 3 if self.kind == "sphere" else self.semi_axes_mm

    def problems(self) -> Iterator[Problem]:
        own, longest, shortest = SHAPE_SIZES[self.kind], max(self.size_mm), min(self.size_mm)
        for key in SHAPE_SIZES.values():
            if self.gives(key) and key != own:
                yield Problem(f"has no meaning with kind {self.kind}, whose size is {own}", (key,))
        if longest > MOST_UNEQUAL_AXES * shortest:
            expected = f"at most {MOST_UNEQUAL_AXES:g} times the shortest, {shortest:g}"
            yield Problem(f"found {longest:g} as the longest; it should be {expected}", (own,))
        largest = MOST_NOISE * shortest
        # the default suits the default sizes; only a given value can be wrong
        if self.gives("noise_mm") and self.noise_mm > largest:
            expected = f"at most {largest:g}, a fiftieth of the smallest size in {own}"
            yield Problem(f"found {self.noise_mm:g}; it should be {expected}", ("noise_mm",))
