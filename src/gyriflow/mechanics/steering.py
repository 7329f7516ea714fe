"""Growth rates of the cortex and the core, set from what the last steps realised, so that a body follows two curves."""

import math
from dataclasses import dataclass

FIRST_SHARE = 0.6
"""Realised part of tangential growth that a run begins with."""

LEAST_SHARE, MOST_SHARE = 0.2, 1.2
"""Bounds of the realised part."""

MEMORY = 0.7
"""How much of the realised part stays from step to step."""

STILL = 1e-4
"""Tangential growth of area in a step below which it tells nothing of the realised part."""


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


@dataclass(frozen=True)
class GrowthRates:
    """Rates of growth in 1/time, and whether they were cut to their bounds.

    Attributes
    ----------
    tangential
        Of each of the cortex's two directions along the pial surface.
    core
        Of each of the core's three directions.
    limited
        True where a bound keeps the body from following the curves.
    """

    tangential: float
    core: float
    limited: bool


def steered_rates(
    aim: Aim,
    cortex_share: float,
    realised: float,
    *,
    poisson_ratio: float,
    radial: float = 0.0,
    ventricle_share: float = 0.0,
    ventricle: float = 0.0,
    isotropic: bool = False,
    bounds: tuple[float, float] = (-math.inf, math.inf),
) -> GrowthRates:
    """Returns the rates that take area and volume to the aim, to first order in the step.

    The area grows by the realised part g of the tangential rate: a_tan = ln(A*/A)/(2 g Δt). What is held back thickens
    the cortex by Poisson's effect, (1 − g) ν/(1 − ν) of it, so that its volume grows by 2 a_tan c with
    c = g + (1 − g) ν/(1 − ν), and by its radial rate. The rest of the volume is the core's:
    a_core = (ln(V*/V)/Δt − f (2 a_tan c + a_radial) − 3 f_v a_v)/(3 (1 − f − f_v)).

    Parameters
    ----------
    cortex_share
        f, the cortex's part of the volume: A·H/V with the thickness H.
    realised
        g, of `realised_share`; `FIRST_SHARE` at the start.
    poisson_ratio
        ν of the cortex.
    radial
        Growth rate across the cortex.
    ventricle_share, ventricle
        f_v and a_v: part of the volume, and rate of each direction, of ventricles that grow by a curve of their own.
    isotropic
        Whether the cortex grows across itself as along itself, in the place of its radial rate.
    bounds
        Least and largest rate that may be set; the core makes up for a tangential rate that is cut.

    ValueError where sizes, duration or the core's part of the volume are not positive.
    """
    core_share = 1.0 - cortex_share - ventricle_share
    positive = (aim.area, aim.volume, aim.next_area, aim.next_volume, aim.duration, core_share, realised)
    if min(positive) <= 0:
        raise ValueError(f"sizes, duration, shares and the core's part {core_share:.3g} must be positive: {aim}")
    least, most = bounds
    wanted = math.log(aim.next_area / aim.area) / (2 * realised * aim.duration)
    tangential = min(max(wanted, least), most)
    # the deviator that comes along with isotropic growth changes no volume, whatever area it makes
    own = 3 * tangential if isotropic else 2 * tangential * volume_gain(realised, poisson_ratio) + radial
    cortex = cortex_share * own
    whole = math.log(aim.next_volume / aim.volume) / aim.duration
    rest = (whole - cortex - 3 * ventricle_share * ventricle) / (3 * core_share)
    core = min(max(rest, least), most)
    return GrowthRates(tangential, core, limited=(tangential, core) != (wanted, rest))


def volume_gain(realised: float, poisson_ratio: float) -> float:
    """Returns c = g + (1 − g) ν/(1 − ν): growth of the cortex's volume over 2 a_tan, where g of that grows the area.

    Stretched back in its plane by (1 − g) a_tan in both directions, a free layer of an isotropic solid thickens by
    2 ν/(1 − ν) of that.
    """
    return realised + (1 - realised) * poisson_ratio / (1 - poisson_ratio)


def realised_share(realised: float, tangential: float, area: float, area_after: float, duration: float) -> float:
    """Returns the realised part g of tangential growth after a step: 0.7 g + 0.3 ln(A'/A)/(2 a_tan Δt), in bounds.

    Where next to no tangential growth was put in, g stays.
    """
    put_in = 2 * tangential * duration
    if abs(put_in) < STILL:
        return realised
    share = MEMORY * realised + (1 - MEMORY) * math.log(area_after / area) / put_in
    return min(max(share, LEAST_SHARE), MOST_SHARE)
