"""Growth rates of the cortex and the core, set so that the area and the volume of a body follow two curves.

Growth that nothing holds back would give known rates of area and volume. What the body makes of it differs by
mechanics, which is learnt: how far it is off from every step, and how it answers to a change of the two rates from
steps that are done again with other rates.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

FIRST_GAIN = 0.1
"""Part of the area's response that a run begins with as its gain from cortex that grows faster than the core."""

LEAST_GAIN = 0.02
"""Gain below which faster growth of the cortex is taken to make no more area, as on a ball."""

MOST_CONTRAST = 5.0
"""Largest difference of the two rates, in multiples of the growth that is asked for."""

STILL = 1e-3
"""Part of the rates by which they must differ between two tries of a step to tell how the body answers."""


@dataclass(frozen=True)
class Aim:
    """Where a body is and where it is to be one step later; any coherent units.

    Attributes
    ----------
    area, volume
        Of the pial surface and of all that it encloses, now.
    next_area, next_volume
        The same at the end of the step.
    duration
        Length of the step.
    """

    area: float
    volume: float
    next_area: float
    next_volume: float
    duration: float

    def rates(self) -> tuple[float, float]:
        """Returns the rates of the logarithms of area and volume that lead there.

        ValueError where sizes or duration are not positive.
        """
        if min(self.area, self.volume, self.next_area, self.next_volume, self.duration) <= 0:
            raise ValueError(f"sizes and duration must be positive: {self}")
        return (
            math.log(self.next_area / self.area) / self.duration,
            math.log(self.next_volume / self.volume) / self.duration,
        )


@dataclass(frozen=True)
class GrowthRates:
    """Rates of growth in 1/time, and whether they were cut to their bounds.

    Attributes
    ----------
    tangential
        Of each of the cortex's directions along the pial surface, or of all three where it grows so.
    core
        Of each of the core's three directions.
    limited
        True where a bound keeps the body from following the curves.
    """

    tangential: float
    core: float
    limited: bool


@dataclass(frozen=True)
class Response:
    """What two growth rates make of a body: rates of the logarithms of its area and its volume.

    Attributes
    ----------
    area, volume
        For a unit of the cortex's rate, and of the core's.
    area_else, volume_else
        Without either, in 1/time.
    """

    area: tuple[float, float]
    volume: tuple[float, float]
    area_else: float = 0.0
    volume_else: float = 0.0

    @classmethod
    def of(cls, values: Sequence[float]) -> "Response":
        """Returns the response of six `values`."""
        area_cortex, area_core, volume_cortex, volume_core, area_else, volume_else = values
        return cls((area_cortex, area_core), (volume_cortex, volume_core), area_else, volume_else)

    @property
    def values(self) -> tuple[float, ...]:
        """The six numbers that a checkpoint keeps."""
        return (*self.area, *self.volume, self.area_else, self.volume_else)

    def __add__(self, other: "Response") -> "Response":
        return Response.of([a + b for a, b in zip(self.values, other.values, strict=True)])

    def __sub__(self, other: "Response") -> "Response":
        return Response.of([a - b for a, b in zip(self.values, other.values, strict=True)])

    def rates(self, growth: GrowthRates) -> tuple[float, float]:
        """Returns the rates of the logarithms of area and volume that growth makes."""
        area = self.area[0] * growth.tangential + self.area[1] * growth.core + self.area_else
        volume = self.volume[0] * growth.tangential + self.volume[1] * growth.core + self.volume_else
        return area, volume

    def agreeing(self, growth: GrowthRates, found: tuple[float, float]) -> "Response":
        """Returns the response that foretells what was found, by what comes without either rate."""
        area, volume = self.rates(growth)
        return Response(self.area, self.volume, self.area_else + found[0] - area, self.volume_else + found[1] - volume)

    def corrected(
        self,
        first: GrowthRates,
        found_first: tuple[float, float],
        second: GrowthRates,
        found_second: tuple[float, float],
    ) -> "Response":
        """Returns the response that tells two tries of one step apart, with the least change (Broyden 1965).

        It stays as it is where the tries hardly differ, or where the volume would no longer grow with both rates.
        """
        change = second.tangential - first.tangential, second.core - first.core
        size = math.hypot(*change)
        if size <= STILL * math.hypot(second.tangential, second.core):
            return self
        slopes = []
        for slope, before, after in zip((self.area, self.volume), found_first, found_second, strict=True):
            missed = after - before - slope[0] * change[0] - slope[1] * change[1]
            slopes.append((slope[0] + missed * change[0] / size**2, slope[1] + missed * change[1] / size**2))
        if min(slopes[1]) <= 0 or sum(slopes[0]) <= 0:
            return self
        return Response(slopes[0], slopes[1], self.area_else, self.volume_else)


def free_response(
    surface: float, cortex: float, core: float, area_else: float = 0.0, volume_else: float = 0.0
) -> Response:
    """Returns the response of a body whose volume grows as if nothing were held back.

    Stress has no mean in a body that nothing holds, so that its volume grows by all that is put in where the bulk
    modulus is uniform. How much of the area is due to the cortex and how much to the core is mechanics: of growth that
    is the same everywhere, shares like those of the volume, and `FIRST_GAIN` more of the cortex.

    Parameters
    ----------
    surface
        Growth of the area where cortex and core grow at the same unit rate, about 2.
    cortex, core
        Growth of the whole volume for unit rates of the cortex and of the core.
    area_else, volume_else
        Growth of area and volume in 1/time by other causes.
    """
    share = cortex / (cortex + core) + FIRST_GAIN
    return Response((surface * share, surface * (1 - share)), (cortex, core), area_else, volume_else)


def steered_rates(aim: Aim, response: Response, bounds: tuple[float, float] = (-math.inf, math.inf)) -> GrowthRates:
    """Returns the rates that take area and volume to the aim, to first order in the step.

    With the volume's response (v_t, v_c), f = v_t/(v_t + v_c), and the area's (s_t, s_c), the rates are
    a_t = a + (1 − f) x and a_c = a − f x: the volume sets the mean rate a, and the difference x of the two, which
    leaves the volume as it is, adds its gain s_t (1 − f) − s_c f to the area. On a ball that gain vanishes; the
    difference is then bounded, and so is it by the rates' own bounds. Where both curves cannot be met, the volume is.

    Parameters
    ----------
    response
        Of the body, as expected for this step.
    bounds
        Least and largest rate that may be set.

    ValueError where sizes, duration or the volume's response are not positive.
    """
    wanted_area, wanted_volume = (
        wanted - other for wanted, other in zip(aim.rates(), (response.area_else, response.volume_else), strict=True)
    )
    if min(response.volume) <= 0 or sum(response.area) <= 0:
        raise ValueError(f"the volume must grow with both rates, and the area with their mean: {response}")
    share = response.volume[0] / sum(response.volume)
    mean = wanted_volume / sum(response.volume)
    surface = sum(response.area)
    gain = max(response.area[0] * (1 - share) - response.area[1] * share, LEAST_GAIN * surface)
    wanted = (wanted_area - surface * mean) / gain
    most = MOST_CONTRAST * (abs(mean) + abs(wanted_area) / surface)
    contrast = min(max(wanted, -most), most)

    def bounded(rate: float) -> float:
        return min(max(rate, bounds[0]), bounds[1])

    tangential = bounded(mean + (1 - share) * contrast)
    core = bounded((wanted_volume - response.volume[0] * tangential) / response.volume[1])
    # what a bound takes from the core, the cortex makes up for, as far as it may
    tangential = bounded((wanted_volume - response.volume[1] * core) / response.volume[0])
    free = mean + (1 - share) * wanted, mean - share * wanted
    near = 1e-9 * (abs(free[0]) + abs(free[1]))
    return GrowthRates(tangential, core, abs(tangential - free[0]) + abs(core - free[1]) > near)
