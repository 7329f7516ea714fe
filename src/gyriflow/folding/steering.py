"""Growth that is steered: rates of cortex and core, set in each step so that pial area and volume meet two curves.

Growth that nothing holds back would give known rates of area and volume. What the body makes of it differs by
mechanics, which is learnt: how far it is off from every step, and how it answers to a change of the two rates from
steps that are done again with other rates.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverError
from ..geometry.tetrahedra import volumes_between
from ..geometry.triangles import TriangleMesh, area_vectors
from ..parameters.folding import FoldingParameters
from ..parameters.varying import value_at
from ..units import CM2_PER_MM2, ML_PER_MM3
from .growth import Growth, GrowthByRates, GrowthInputs, Size, StepStart, increments
from .layers import WEIGHT_REACH, PialSearch, cortical_weight

Floats = NDArray[np.float64]
Response = Floats
"""What growth makes of a body (2, 3): rates of the logarithms of its area and its volume, for a unit of the cortex's
rate, for one of the core's, and without either."""

JOINING_GW = 1.0
"""Time in which a brain that does not start on its curves comes onto them."""
FASTEST_PER_S = 1e-5
"""Largest rate that is set, the bound of the prescribed ones."""
FOLLOWED = 0.005
"""Part of a curve's value within which it counts as followed."""
MET = 0.001
"""Part of a curve's value within which a step has to end, or else is done again with other rates."""
MOST_TRIES = 4
"""How often a step is done at most."""
SAME = 1e-3
"""Part of the rates by which they must change for a step to be done again."""
FIRST_GAIN = 0.1
"""Part of the area's response that a run begins with as its gain from cortex that grows faster than the core."""
LEAST_GAIN = 0.02
"""Gain below which faster growth of the cortex is taken to make no more area, as on a ball."""
MOST_CONTRAST = 5.0
"""Largest difference of the two rates, in multiples of the growth that is asked for."""
STILL = 1e-3
"""Part of the rates by which they must differ between two tries of a step to tell how the body answers."""


class GrowthRates(NamedTuple):
    """Rates of growth in 1/s, and whether they were cut to bounds that keep the body from following its curves.

    `tangential` is that of each of the cortex's directions along the pial surface, or of all three where it grows so;
    `core` is that of each of the core's three directions.
    """

    tangential: float
    core: float
    limited: bool = False


@dataclass(frozen=True, eq=False)
class SteeredStep(GrowthByRates):
    """Growth of a step that is set so that it leads to a size.

    Attributes
    ----------
    before, aim
        The size at the step's start, and that to be reached at its end.
    rates
        The rates that are set.
    free, response
        What unit rates would make of the brain's size if nothing held growth back, and what is expected of them.
    tries
        How often the step has been done, this time included.
    tried
        The rates of the try before, and the rates in 1/s of the logarithms of area and volume that came of it.
    """

    before: Size
    aim: Size
    rates: GrowthRates
    free: Response
    response: Response
    tries: int = 1
    tried: tuple[GrowthRates, Floats] | None = None

    def again(self, after: Size) -> "SteeredStep | None":
        missed = after.area_mm2 / self.aim.area_mm2 - 1, after.volume_mm3 / self.aim.volume_mm3 - 1
        if self.tries >= MOST_TRIES or max(map(abs, missed)) <= MET:
            return None
        response = self._taught(after)
        rates = steered_rates(self._logarithmic(self.aim), response, bounds(self.parameters))
        change = abs(rates.tangential - self.rates.tangential) + abs(rates.core - self.rates.core)
        if change <= SAME * (abs(rates.tangential) + abs(rates.core)):
            return None
        return replace(
            self,
            parameters=with_rates(self.parameters, rates),
            rates=rates,
            response=response,
            tries=self.tries + 1,
            tried=(self.rates, self._logarithmic(after)),
        )

    def learnt(self, after: Size) -> tuple[float, ...]:
        return tuple((self._taught(after) - self.free).ravel().tolist())

    def row(self, after: Size) -> dict[str, Any]:
        row = super().row(after)
        # what the cortex would grow in area if nothing held it
        free = (self.free[0, 0] + self.free[0, 1]) * self.rates.tangential + self.free[0, 2]
        return row | {
            "area_aim_cm2": self.aim.area_mm2 * CM2_PER_MM2,
            "volume_aim_ml": self.aim.volume_mm3 * ML_PER_MM3,
            "growth_rate_per_s": self.rates.tangential,
            "core_growth_rate_per_s": self.rates.core,
            "realised_share": float(self._logarithmic(after)[0] / free) if free else math.nan,
            "growth_limited": int(self.rates.limited),
            "growth_tries": self.tries,
        }

    def _logarithmic(self, after: Size) -> Floats:
        """Returns the (2,) rates in 1/s of the logarithms of area and volume that lead to a size."""
        return logarithmic_rates(self.before, after, self.start.step_s)

    def _taught(self, after: Size) -> Response:
        """Returns the response of the brain as it is known after the step has led to a size."""
        found, response = self._logarithmic(after), self.response
        if self.tried is not None:
            response = corrected(response, self.tried, (self.rates, found))
        return agreeing(response, self.rates, found)


@dataclass(frozen=True, eq=False)
class SteeredGrowth:
    """The model of growth that follows curves; `at_start` is the size at the start of the run."""

    parameters: FoldingParameters
    inputs: GrowthInputs
    at_start: Size

    def growth(self, start: StepStart) -> Growth:
        """Returns the growth of a step, as it is tried first."""
        p, week = self.parameters, start.week(self.parameters, 1.0)
        before, aim = self.inputs.size(start.positions_mm), self.aim(week)
        return steered_step(p, start, before, aim, free_growth(p, start.positions_mm, self.inputs, week))

    def aim(self, week: float) -> Size:
        """Returns the size to be reached at a week."""
        p, at_start = self.parameters, self.at_start

        def joining(curve: Any, value: float, unit: float) -> float:
            return joined(curve, value * unit, p.start_week, week) / unit

        return Size(
            joining(p.growth.area_cm2, at_start.area_mm2, CM2_PER_MM2),
            joining(p.growth.volume_ml, at_start.volume_mm3, ML_PER_MM3),
        )


def steered_step(p: FoldingParameters, start: StepStart, before: Size, aim: Size, free: Response) -> SteeredStep:
    """Returns the first try of a step from a size to another, for what free growth makes.

    What was learnt is forgotten where it would have the body shrink by growing.
    """
    response = free if start.learnt is None else free + np.reshape(start.learnt, (2, 3))
    if not _grows(response):
        response = free
    rates = steered_rates(logarithmic_rates(before, aim, start.step_s), response, bounds(p))
    return SteeredStep(with_rates(p, rates), start, before, aim, rates, free, response)


def with_rates(p: FoldingParameters, rates: GrowthRates) -> FoldingParameters:
    """Returns the parameters of a step with rates of growth."""
    return p.model_copy(update={"growth_rate_per_s": rates.tangential, "core_growth_rate_per_s": rates.core})


def bounds(p: FoldingParameters) -> tuple[float, float]:
    """Returns the least and the largest rate in 1/s that growth may be set to."""
    return -FASTEST_PER_S if p.allow_negative_growth else 0.0, FASTEST_PER_S


def logarithmic_rates(before: Size, after: Size, step_s: float) -> Floats:
    """Returns the (2,) rates in 1/s of the logarithms of area and volume from a size to another.

    ValueError where sizes or the step are not positive.
    """
    if min(before.area_mm2, before.volume_mm3, after.area_mm2, after.volume_mm3, step_s) <= 0:
        raise ValueError(f"sizes and duration must be positive: {before}, {after}, {step_s:g} s")
    of_area, of_volume = after.area_mm2 / before.area_mm2, after.volume_mm3 / before.volume_mm3
    return np.array([math.log(of_area) / step_s, math.log(of_volume) / step_s])


def expected(response: Response, rates: GrowthRates) -> Floats:
    """Returns the (2,) rates of the logarithms of area and volume that growth makes."""
    return np.asarray(response[:, 0] * rates.tangential + response[:, 1] * rates.core + response[:, 2])


def agreeing(response: Response, rates: GrowthRates, found: Floats) -> Response:
    """Returns the response that predicts what was found; what differs is put down to neither of the rates."""
    return np.column_stack([response[:, :2], response[:, 2] + found - expected(response, rates)])


def corrected(response: Response, first: tuple[GrowthRates, Floats], second: tuple[GrowthRates, Floats]) -> Response:
    """Returns the response that tells two tries of one step apart, with the least change (Broyden 1965).

    A try is its rates and what was found. The response stays as it is where the tries hardly differ, or where the
    volume would no longer grow with both rates, or the area with their mean.
    """
    change = np.subtract(second[0][:2], first[0][:2])
    size = math.hypot(*change)
    if size <= STILL * math.hypot(*second[0][:2]):
        return response
    missed = second[1] - first[1] - response[:, :2] @ change
    changed = response.copy()
    changed[:, :2] += np.outer(missed, change) / size**2
    return changed if _grows(changed) else response


def _grows(response: Response) -> bool:
    """Returns whether the volume grows with both rates, and the area with their mean."""
    return bool(response[1, :2].min() > 0 and response[0, :2].sum() > 0)


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
        Growth of area and volume in 1/s by other causes.
    """
    share = cortex / (cortex + core) + FIRST_GAIN
    return np.array([[surface * share, surface * (1 - share), area_else], [cortex, core, volume_else]])


def steered_rates(
    wanted: Sequence[float] | Floats, response: Response, bounds: tuple[float, float] = (-math.inf, math.inf)
) -> GrowthRates:
    """Returns the rates that make area and volume grow as wanted, to first order in the step.

    With the volume's response (v_t, v_c), f = v_t/(v_t + v_c), and the area's (s_t, s_c), the rates are
    a_t = a + (1 − f) x and a_c = a − f x: the volume sets the mean rate a, and the difference x of the two, which
    leaves the volume as it is, adds its gain s_t (1 − f) − s_c f to the area. On a ball that gain vanishes; the
    difference is then bounded, and so is it by the rates' own bounds. Where both curves cannot be met, the volume is:
    so too where growth would make the area smaller, as where its maps are negative on most of the surface. Both rates
    are then the mean.

    Parameters
    ----------
    wanted : (2,) float
        Rates of the logarithms of area and volume.
    response
        Of the body, as expected for this step.
    bounds
        Least and largest rate that may be set.

    SolverError where the volume would not grow with both rates.
    """
    area_t, area_c, area_else, volume_t, volume_c, volume_else = map(float, response.ravel())
    wanted_area, wanted_volume = float(wanted[0]) - area_else, float(wanted[1]) - volume_else
    if min(volume_t, volume_c) <= 0:
        raise SolverError(
            "growth that follows curves finds no rates: its maps are such that growth makes the brain smaller",
            found=f"volume growing by {volume_t:.3g} with a unit of the cortex's rate, {volume_c:.3g} with the core's",
            expected="positive numbers",
            remedy="Give a map of growth rates that is less negative.",
        )
    share = volume_t / (volume_t + volume_c)
    mean = wanted_volume / (volume_t + volume_c)
    surface = area_t + area_c
    if surface > 0:
        gain = max(area_t * (1 - share) - area_c * share, LEAST_GAIN * surface)
        contrast_wanted = (wanted_area - surface * mean) / gain
        most = MOST_CONTRAST * (abs(mean) + abs(wanted_area) / surface)
        contrast = min(max(contrast_wanted, -most), most)
    else:
        contrast_wanted = contrast = 0.0

    def bounded(rate: float) -> float:
        return min(max(rate, bounds[0]), bounds[1])

    tangential = bounded(mean + (1 - share) * contrast)
    core = bounded((wanted_volume - volume_t * tangential) / volume_c)
    # what a bound takes from the core, the cortex makes up for, as far as it may
    tangential = bounded((wanted_volume - volume_c * core) / volume_t)
    ideal = mean + (1 - share) * contrast_wanted, mean - share * contrast_wanted
    near = 1e-9 * (abs(ideal[0]) + abs(ideal[1]))
    limited = abs(tangential - ideal[0]) + abs(core - ideal[1]) > near
    return GrowthRates(tangential, core, limited or surface <= 0)


def free_growth(p: FoldingParameters, positions_mm: Floats, inputs: GrowthInputs, week: float) -> Response:
    """Returns what free growth would make of the brain's sizes, in 1/s for unit rates of cortex and core.

    Volume is that of all tissue; area is as growth along the surface makes it.

    Parameters
    ----------
    positions_mm : (n, 3) float
        Of all vertices.
    week
        Whose thickness and maps hold.
    """
    zones, maps = inputs.zones, inputs.maps
    thickness = p.thickness_at(week, maps)
    reach = WEIGHT_REACH * float(np.max(thickness))
    distance = PialSearch(positions_mm, zones.cortex_facets).distance(positions_mm, reach)
    w = cortical_weight(distance, thickness)
    volumes = volumes_between(positions_mm, inputs.pieces)
    whole = volumes.sum()

    def of_volume(tangential: float, radial: float | Floats, core: float) -> float:
        dg, dr = increments(w, zones.growth, tangential, radial, core, 1.0)
        return float((2 * dg + dr)[inputs.pieces].mean(axis=1) @ volumes / whole)

    faces = zones.measured_facets
    areas = np.linalg.norm(area_vectors(TriangleMesh(positions_mm, faces)), axis=1)
    surface = 2 * float(zones.growth[faces].mean(axis=1) @ areas / areas.sum())
    radial = value_at(p.radial_growth_rate_per_s, week, maps)
    core = of_volume(0.0, 0.0, 1.0)
    return free_response(surface, of_volume(1.0, 0.0, 0.0), core, volume_else=of_volume(0.0, radial, 0.0))


def missed_curves(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Returns what to say of curves that are missed by more than `FOLLOWED`; empty where none is.

    They count where the last step ends.

    Parameters
    ----------
    rows
        Of the step table, from an output week to the next.
    """
    row, notes = rows[-1], []
    if row.get("area_aim_cm2") is not None:
        errors = {name: _error(row, name, unit) for name, unit in (("area", "cm2"), ("volume", "ml"))}
        parts = [
            f"{name} {100 * error:+.1f} % off its curve" for name, error in errors.items() if abs(error) > FOLLOWED
        ]
        if parts:
            why = ": no rates within their bounds lead to both on this shape" if row.get("growth_limited") else ""
            notes.append(f"at GW {row['week']:g} the brain is {' and '.join(parts)}{why}")
    return notes


def _error(row: Mapping[str, Any], name: str, unit: str) -> float:
    return float(row[f"{name}_{unit}"] / row[f"{name}_aim_{unit}"] - 1)


def joined(curve: Any, at_start: float, start_week: float, week: float) -> float:
    """Returns a curve's value at a week, for a brain that had another value at the start.

    Its logarithm is off the curve by as much as at the start, and by nothing once `JOINING_GW` have passed.
    """
    left = max(0.0, 1.0 - (week - start_week) / JOINING_GW)
    offset = math.log(at_start / value_on(curve, start_week))
    return value_on(curve, week) * math.exp(left * offset)


def value_on(curve: Any, week: float) -> float:
    """Returns the value of a {week: value} curve: its logarithm is linear in between and goes on beyond the ends."""
    weeks, logs = np.array(list(curve)), np.log(list(curve.values()))
    if weeks[0] <= week <= weeks[-1] or len(weeks) == 1:
        return float(np.exp(np.interp(week, weeks, logs)))
    i, j = (0, 1) if week < weeks[0] else (-1, -2)
    return float(np.exp(logs[i] + (logs[i] - logs[j]) / (weeks[i] - weeks[j]) * (week - weeks[i])))
