"""Parameters that vary: a number, a curve over weeks, a map over the brain, or a map times a curve."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

Floats = NDArray[np.float64]
Maps = Mapping[str, Floats]
"""Values at the mesh's vertices by parameter name; they move with the tissue."""


@dataclass(frozen=True)
class Varying:
    """A parameter over time and place.

    Attributes
    ----------
    weeks : tuple of float
        Weeks of the curve, ascending; empty for a constant.
    values : tuple of float
        Values at these weeks, linear in between, constant beyond; a single one for a constant.
    map : str or None
        Name of the map that the curve is multiplied with.
    """

    weeks: tuple[float, ...]
    values: tuple[float, ...]
    map: str | None = None

    @classmethod
    def constant(cls, value: float) -> "Varying":
        """Returns a parameter that is the same always and everywhere."""
        return cls((), (float(value),))

    @classmethod
    def read(cls, value: Any, key: str) -> "Varying":
        """Returns the parameter from a number, or from a mapping with `weeks` (week: value), `map` (its name), or both.

        InputError where it is neither.
        """
        wrong = InputError(f"folding parameters: {key}", found=repr(value), expected="a number, or weeks or a map")
        if isinstance(value, bool):
            raise wrong
        try:
            if not isinstance(value, Mapping):
                return cls.constant(value)
            table = value.get("weeks") or {}
            points = sorted((float(week), float(number)) for week, number in table.items())
        except (TypeError, ValueError, AttributeError):
            raise wrong from None
        name = value.get("map")
        if (not points and name is None) or set(value) - {"weeks", "map", "surface"}:
            raise wrong
        if not points:
            return cls((), (1.0,), name)
        return cls(tuple(week for week, _ in points), tuple(number for _, number in points), name)

    def factor(self, week: float) -> float:
        """Returns the curve's value at a week, 1 for a map without a curve."""
        if len(self.values) == 1:
            return self.values[0]
        return float(np.interp(week, self.weeks, self.values))

    def at(self, week: float, maps: Maps) -> float | Floats:
        """Returns the value at a week: a number, or (n,) values where there is a map."""
        return self.factor(week) if self.map is None else self.factor(week) * maps[self.map]

    def weeks_within(self, start: float, end: float) -> list[float]:
        """Returns start, end, and the weeks of the curve between them: where its extremes lie."""
        return [start, *(week for week in self.weeks if start < week < end), end]

    def range(self, maps: Maps, start: float, end: float) -> tuple[float, float]:
        """Returns the smallest and the largest value from a week to a week, over all places."""
        places = np.ones(1) if self.map is None else maps[self.map]
        curve = [self.factor(week) for week in self.weeks_within(start, end)]
        products = np.outer(curve, [places.min(), places.max()])
        return float(products.min()), float(products.max())
