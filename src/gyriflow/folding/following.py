"""Growth that follows a brain: the rates of a step, set so that the pial area and the volume meet their curves."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.triangles import TriangleMesh, area, signed_volume
from ..mechanics.steering import Aim, GrowthRates, Response, steered_rates
from ..parameters.folding import FoldingParameters
from ..parameters.varying import Varying
from ..units import CM2_PER_MM2, ML_PER_MM3, SECONDS_PER_GW
from .free_growth import Tissue, growth_of_brain, map_at

Floats = NDArray[np.float64]

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


@dataclass(frozen=True)
class Size:
    """The size of a brain.

    Attributes
    ----------
    area_mm2
        Of the surface under which cortex lies.
    volume_mm3
        Of all that the surface encloses.
    ventricles_mm3
        Of the ventricles in it, 0 where they are not known.
    """

    area_mm2: float
    volume_mm3: float
    ventricles_mm3: float = 0.0


@dataclass(frozen=True)
class Ventricles:
    """How the ventricles grow in a step, where they do so by a rate of their own.

    Attributes
    ----------
    before_mm3, aim_mm3
        Their volume at the step's start, and that to be reached at its end.
    rate, at_start
        Their rate in each direction in 1/s over the step, and at its start, as those of the cortex.
    """

    before_mm3: float
    aim_mm3: float
    rate: float
    at_start: float | None


@dataclass(frozen=True)
class Step:
    """A step whose growth is prescribed.

    Attributes
    ----------
    parameters
        Those of the run, with the rates of this step.
    before
        The size at the step's start.
    """

    parameters: FoldingParameters
    before: Size

    def again(self, after: Size) -> "Step | None":
        """Returns how a step that has led to a size is to be done again, None where it need not or cannot be."""
        return None

    def learnt(self, after: Size) -> tuple[float, ...] | None:
        """Returns what a step that has led to a size teaches the next ones, None where that is nothing."""
        return None

    def row(self, after: Size) -> dict[str, Any]:
        """Returns what the step table says of growth after the step has led to a size."""
        return {"area_cm2": after.area_mm2 * CM2_PER_MM2, "volume_ml": after.volume_mm3 * ML_PER_MM3}


@dataclass(frozen=True)
class SteeredStep(Step):
    """A step whose growth is set so that it leads to a size.

    Attributes
    ----------
    aim
        The size to be reached.
    rates
        The rates that are set, as they are over the whole step.
    at_start
        What they are at its start; None where the step takes them as constant.
    free, response
        What unit rates would make of the brain's size if nothing held growth back, and what is expected of them.
    end_week
        When the step ends.
    last
        Row of the step table of the step before, empty where there was none.
    tries
        How often the step has been done, this time included.
    tried
        The rates of the try before, and the rates in 1/s of the logarithms of area and volume that came of it.
    """

    aim: Aim
    rates: GrowthRates
    at_start: GrowthRates | None
    free: Response
    response: Response
    end_week: float
    last: Mapping[str, Any]
    tries: int = 1
    tried: tuple[GrowthRates, tuple[float, float]] | None = None
    ventricles: Ventricles | None = None

    def again(self, after: Size) -> "SteeredStep | None":
        missed = after.area_mm2 / self.aim.next_area - 1, after.volume_mm3 / self.aim.next_volume - 1
        if self.tries >= MOST_TRIES or max(map(abs, missed)) <= MET:
            return None
        response = self._taught(after)
        rates = steered_rates(self.aim, response, bounds(self.parameters))
        change = abs(rates.tangential - self.rates.tangential) + abs(rates.core - self.rates.core)
        if change <= SAME * (abs(rates.tangential) + abs(rates.core)):
            return None
        parameters, at_start = with_rates(self.parameters, rates, self.end_week, self.aim.duration, self.last)
        return replace(
            self,
            parameters=parameters,
            rates=rates,
            at_start=at_start,
            response=response,
            tries=self.tries + 1,
            tried=(self.rates, self._found(after)),
        )

    def learnt(self, after: Size) -> tuple[float, ...]:
        learnt = (self._taught(after) - self.free).values
        if self.ventricles is None:
            return learnt
        grown = math.log(after.ventricles_mm3 / self.ventricles.before_mm3) / self.aim.duration
        return (*learnt, grown - 3 * self.ventricles.rate)

    def row(self, after: Size) -> dict[str, Any]:
        row = super().row(after)
        if self.at_start is not None:
            row |= {
                "growth_rate_at_start_per_s": self.at_start.tangential,
                "core_growth_rate_at_start_per_s": self.at_start.core,
            }
        if self.ventricles is not None:
            row |= {
                "ventricles_ml": after.ventricles_mm3 * ML_PER_MM3,
                "ventricles_aim_ml": self.ventricles.aim_mm3 * ML_PER_MM3,
                "ventricle_growth_rate_per_s": self.ventricles.rate,
            }
            if self.ventricles.at_start is not None:
                row["ventricle_growth_rate_at_start_per_s"] = self.ventricles.at_start
        # what the cortex would grow in area if nothing held it
        free = sum(self.free.area) * self.rates.tangential + self.free.area_else
        return row | {
            "area_aim_cm2": self.aim.next_area * CM2_PER_MM2,
            "volume_aim_ml": self.aim.next_volume * ML_PER_MM3,
            "growth_rate_per_s": self.rates.tangential,
            "core_growth_rate_per_s": self.rates.core,
            "realised_share": self._found(after)[0] / free if free else math.nan,
            "growth_limited": int(self.rates.limited),
            "growth_tries": self.tries,
        }

    def _found(self, after: Size) -> tuple[float, float]:
        """Returns the rates in 1/s of the logarithms of area and volume, after the step has led to a size."""
        return replace(self.aim, next_area=after.area_mm2, next_volume=after.volume_mm3).rates()

    def _taught(self, after: Size) -> Response:
        """Returns the response of the brain as it is known after the step has led to a size."""
        found, response = self._found(after), self.response
        if self.tried is not None:
            response = response.corrected(*self.tried, self.rates, found)
        return response.agreeing(self.rates, found)


def missed_curves(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Returns what to say of curves that are missed by more than `FOLLOWED`; empty where none is.

    Area and volume count where the last step ends; the ventricles, whose rate is not corrected within a step, where
    they were farthest off.

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
            notes.append(f"at GW {row['week']:g} the brain is {' and '.join(parts)}")
    if row.get("ventricles_aim_ml") is not None:
        farthest = max(rows, key=lambda each: abs(_error(each, "ventricles", "ml")))
        error = _error(farthest, "ventricles", "ml")
        if abs(error) > FOLLOWED:
            at_bound = error > 0 and farthest["ventricle_growth_rate_per_s"] == 0
            why = ": at a rate of 0 what grows around them takes them along" if at_bound else ""
            notes.append(f"at GW {farthest['week']:.4g} the ventricles are {100 * error:+.1f} % off their curve{why}")
    return notes


def _error(row: Mapping[str, Any], name: str, unit: str) -> float:
    return float(row[f"{name}_{unit}"] / row[f"{name}_aim_{unit}"] - 1)


def size_of(positions_mm: Floats, tissue: Tissue) -> Size:
    """Returns the size of a brain from the (n, 3) positions of its mesh in mm."""
    zones = tissue.zones
    return Size(
        area(TriangleMesh(positions_mm, zones.measured_facets)),
        signed_volume(TriangleMesh(positions_mm, zones.facets)),
        tissue.ventricles_mm3(positions_mm),
    )


def following_step(
    p: FoldingParameters,
    start: Size,
    positions_mm: Floats,
    tissue: Tissue,
    time_s: float,
    step_s: float,
    last: Mapping[str, Any],
    learnt: Sequence[float] | None,
) -> Step:
    """Returns the growth of a step: the run's own where it is prescribed, else what leads to the curves.

    Parameters
    ----------
    start
        The size at the start of the run.
    positions_mm : (n, 3) float
        Of all vertices at the step's start.
    time_s, step_s
        Time since the start, and the length of the step.
    last
        Row of the step table of the step before, empty where there was none.
    learnt
        What the steps before have taught, None where there was none.
    """
    before = size_of(positions_mm, tissue)
    if p.follow is None:
        return Step(p, before)
    week = p.start_week + (time_s + step_s) / SECONDS_PER_GW
    aim = Aim(
        before.area_mm2,
        before.volume_mm3,
        joined(p.follow.area_cm2, start.area_mm2 * CM2_PER_MM2, p.start_week, week) / CM2_PER_MM2,
        joined(p.follow.volume_ml, start.volume_mm3 * ML_PER_MM3, p.start_week, week) / ML_PER_MM3,
        step_s,
    )
    if p.follow.ventricles_ml is None:
        return steered_step(p, before, aim, growth_of_brain(p, positions_mm, tissue, week), learnt, week, last)
    known = 0.0 if learnt is None else learnt[-1]
    at_end = joined(p.follow.ventricles_ml, start.ventricles_mm3 * ML_PER_MM3, p.start_week, week) / ML_PER_MM3
    rate = (math.log(at_end / before.ventricles_mm3) / step_s - known) / 3
    rate = min(max(rate, bounds(p)[0]), bounds(p)[1])
    at_start = None
    if p.time_scheme == "adams-bashforth":
        at_start = rate_at_start(rate, step_s, last, "ventricle_growth_rate_at_start_per_s")
    ventricles = Ventricles(before.ventricles_mm3, at_end, rate, at_start)
    p = p.model_copy(update={"ventricle_growth_rate_per_s": rate if at_start is None else at_start})
    free = growth_of_brain(p, positions_mm, tissue, week, rate)
    step = steered_step(p, before, aim, free, None if learnt is None else learnt[:-1], week, last)
    return replace(step, ventricles=ventricles)


def steered_step(
    p: FoldingParameters,
    before: Size,
    aim: Aim,
    free: Response,
    learnt: Sequence[float] | None,
    week: float,
    last: Mapping[str, Any],
) -> SteeredStep:
    """Returns the first try of a step that ends at a week, for what free growth makes; others as `following_step`."""
    response = free if learnt is None else free + Response.of(learnt)
    rates = steered_rates(aim, response, bounds(p))
    parameters, at_start = with_rates(p, rates, week, aim.duration, last)
    return SteeredStep(parameters, before, aim, rates, at_start, free, response, week, last)


def with_rates(
    p: FoldingParameters, rates: GrowthRates, week: float, step_s: float, last: Mapping[str, Any]
) -> tuple[FoldingParameters, GrowthRates | None]:
    """Returns the parameters of a step that ends at a week with rates of growth, and these at its start.

    The latter are None where the step takes the rates as constant; other parameters are as of `following_step`.
    """
    at_start = rates_at_start(rates, step_s, last) if p.time_scheme == "adams-bashforth" else None
    given = at_start or rates
    values: dict[str, Any] = {}
    for name, rate, maps_by_week in (
        ("growth_rate_per_s", given.tangential, p.regional_growth_of_cortex or p.regional_growth),
        ("core_growth_rate_per_s", given.core, p.regional_growth),
    ):
        regional = map_at(maps_by_week, week)
        values[name] = rate if regional is None else Varying(weeks={week: rate}, map=regional)
    return p.model_copy(update=values), at_start


def bounds(p: FoldingParameters) -> tuple[float, float]:
    """Returns the least and the largest rate in 1/s that growth may be set to."""
    return -FASTEST_PER_S if p.allow_negative_growth else 0.0, FASTEST_PER_S


def rates_at_start(rates: GrowthRates, step_s: float, last: Mapping[str, Any]) -> GrowthRates:
    """Returns the rates at a step's start with which two-step Adams-Bashforth takes the given ones over the step.

    The scheme goes by (1 + r/2) a − r/2 a_before, r the step's length over that of the one before, and velocities are
    linear in the rates. So a = (wanted + r/2 a_before)/(1 + r/2): between the two, in the bounds of both, and without
    a swing, since a third of an error at most goes on to the next step where steps are equal.

    Parameters
    ----------
    last
        Row of the step table of the step before, empty where there was none.
    """
    tangential = rate_at_start(rates.tangential, step_s, last, "growth_rate_at_start_per_s")
    core = rate_at_start(rates.core, step_s, last, "core_growth_rate_at_start_per_s")
    return GrowthRates(tangential, core, rates.limited)


def rate_at_start(rate: float, step_s: float, last: Mapping[str, Any], column: str) -> float:
    """Returns one such rate at a step's start; the row of the step before has its own in a column."""
    if not last:
        return rate
    part = step_s / last["dt_s"] / 2
    return float((rate + part * last[column]) / (1 + part))


def growing_at_start(p: FoldingParameters, positions_mm: Floats, tissue: Tissue) -> FoldingParameters:
    """Returns the parameters of a run with the growth of its first step, for (n, 3) positions of its start mesh."""
    start = size_of(positions_mm, tissue)
    return following_step(p, start, positions_mm, tissue, 0.0, p.step_s, {}, None).parameters


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
