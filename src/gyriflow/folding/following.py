"""Growth that follows a brain: the rates of a step, set so that the pial area and the volume meet their curves."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.triangles import TriangleMesh, area, signed_volume
from ..mechanics.steering import FIRST_SHARE, Aim, GrowthRates, realised_share, steered_rates
from ..parameters.folding import STRAIN, FoldingParameters
from ..parameters.varying import Maps, Varying
from ..units import CM2_PER_MM2, ML_PER_MM3, SECONDS_PER_GW
from .memory import unpacked
from .zones import Zones

Floats = NDArray[np.float64]

JOINING_GW = 1.0
"""Time in which a brain that does not start on its curves comes onto them."""
FASTEST_PER_S = 1e-5
"""Largest rate that is set, the bound of the prescribed ones."""
FOLLOWED = 0.005
"""Part of a curve's value within which it counts as followed."""
MOST_CORTEX = 0.8
"""Part of the volume that at most counts as cortex, so that the core has something to grow."""


@dataclass(frozen=True)
class Size:
    """The size of a brain.

    Attributes
    ----------
    area_mm2
        Of the surface under which cortex lies.
    volume_mm3
        Of all that the surface encloses.
    """

    area_mm2: float
    volume_mm3: float


@dataclass(frozen=True)
class Step:
    """What growth that follows does in a step.

    Attributes
    ----------
    parameters
        Those of the run with the rates of this step.
    before, aim
        The size at the step's start and that to be reached at its end, None where growth is prescribed.
    rates
        The rates that were set, as they are over the whole step.
    at_start
        What they are at its start; None where the step takes them as constant.
    realised
        Part of tangential growth that turns into area, as taken for this step.
    """

    parameters: FoldingParameters
    before: Size
    aim: Size | None = None
    rates: GrowthRates | None = None
    at_start: GrowthRates | None = None
    realised: float = FIRST_SHARE

    def row(self, after: Size, step_s: float) -> dict[str, Any]:
        """Returns what the step table says of growth after the step has led to a size."""
        sizes = {"area_cm2": after.area_mm2 * CM2_PER_MM2, "volume_ml": after.volume_mm3 * ML_PER_MM3}
        if self.aim is None or self.rates is None:
            return sizes
        share = realised_share(self.realised, self.rates.tangential, self.before.area_mm2, after.area_mm2, step_s)
        if self.at_start is not None:
            sizes |= {
                "growth_rate_at_start_per_s": self.at_start.tangential,
                "core_growth_rate_at_start_per_s": self.at_start.core,
            }
        return sizes | {
            "area_aim_cm2": self.aim.area_mm2 * CM2_PER_MM2,
            "volume_aim_ml": self.aim.volume_mm3 * ML_PER_MM3,
            "growth_rate_per_s": self.rates.tangential,
            "core_growth_rate_per_s": self.rates.core,
            "realised_share": share,
            "growth_limited": int(self.rates.limited),
        }


def missed_curves(row: Mapping[str, Any]) -> str:
    """Returns what to say of a step that is more than `FOLLOWED` off a curve; empty where it is not."""
    parts = []
    for name, unit in (("area", "cm2"), ("volume", "ml")):
        if (aim := row.get(f"{name}_aim_{unit}")) is not None:
            error = row[f"{name}_{unit}"] / aim - 1
            if abs(error) > FOLLOWED:
                parts.append(f"{name} {100 * error:+.1f} % off its curve")
    return f"at GW {row['week']:g} the brain is {' and '.join(parts)}" if parts else ""


def size_of(positions_mm: Floats, zones: Zones) -> Size:
    """Returns the size of a brain from the (n, 3) positions of its mesh in mm."""
    return Size(
        area(TriangleMesh(positions_mm, zones.measured_facets)), signed_volume(TriangleMesh(positions_mm, zones.facets))
    )


def following_step(
    p: FoldingParameters, start: Size, before: Size, time_s: float, step_s: float, last: Mapping[str, Any], maps: Maps
) -> Step:
    """Returns the growth of a step: the run's own where it is prescribed, else what leads to the curves.

    Parameters
    ----------
    start, before
        The size at the start of the run, and now.
    time_s, step_s
        Time since the start, and the length of the step.
    last
        Row of the step table of the step before, empty where there was none.
    maps
        The maps of the run, at all vertices.
    """
    if p.follow is None:
        return Step(p, before)
    end_week = p.start_week + (time_s + step_s) / SECONDS_PER_GW
    aim = Size(
        joined(p.follow.area_cm2, start.area_mm2 * CM2_PER_MM2, p.start_week, end_week) / CM2_PER_MM2,
        joined(p.follow.volume_ml, start.volume_mm3 * ML_PER_MM3, p.start_week, end_week) / ML_PER_MM3,
    )
    thickness = float(np.mean(p.thickness_at(end_week, maps)))
    realised = float(last.get("realised_share", FIRST_SHARE))
    rates = steered_rates(
        Aim(before.area_mm2, before.volume_mm3, aim.area_mm2, aim.volume_mm3, step_s),
        min(before.area_mm2 * thickness / before.volume_mm3, MOST_CORTEX),
        realised,
        poisson_ratio=p.poisson_ratio,
        isotropic=bool(p.regional_strain),
        bounds=(-FASTEST_PER_S if p.allow_negative_growth else 0.0, FASTEST_PER_S),
    )
    at_start = rates_at_start(rates, step_s, last) if p.time_scheme == "adams-bashforth" else None
    given = at_start or rates
    values: dict[str, Any] = {}
    for name, rate, maps_by_week in (
        ("growth_rate_per_s", given.tangential, p.regional_growth_of_cortex or p.regional_growth),
        ("core_growth_rate_per_s", given.core, p.regional_growth),
    ):
        regional = map_at(maps_by_week, end_week)
        values[name] = rate if regional is None else Varying(weeks={end_week: rate}, map=regional)
    return Step(p.model_copy(update=values), before, aim, rates, at_start, realised)


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
    if not last:
        return rates
    part = step_s / last["dt_s"] / 2
    tangential = (rates.tangential + part * last["growth_rate_at_start_per_s"]) / (1 + part)
    core = (rates.core + part * last["core_growth_rate_at_start_per_s"]) / (1 + part)
    return GrowthRates(tangential, core, rates.limited)


def growing_at_start(p: FoldingParameters, positions_mm: Floats, zones: Zones, maps: Maps) -> FoldingParameters:
    """Returns the parameters of a run with the growth of its first step, for (n, 3) positions of its start mesh."""
    start = size_of(positions_mm, zones)
    return following_step(p, start, start, 0.0, p.step_s, {}, maps).parameters


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


def strain_at(p: FoldingParameters, maps: Maps, week: float) -> Floats | None:
    """Returns the (6, n) measured strain per week that holds at a week, None where growth has no directions."""
    name = map_at(p.regional_strain, week)
    return None if name is None else np.stack([maps[f"{name}_{part}"] for part in STRAIN])


def undone(strain: Floats) -> Floats:
    """Returns the (..., 3, 3) inverse of growth by small (..., 6) strains, which leaves volumes as they are."""
    inverse = np.linalg.inv(np.eye(3) + unpacked(strain))
    return np.asarray(inverse / np.cbrt(np.linalg.det(inverse))[..., None, None])


def map_at(maps: Mapping[float, str], week: float) -> str | None:
    """Returns the name of the map that holds at a week: that of the last week before it, or else the first."""
    before = [start for start in maps if start < week]
    return maps[max(before)] if before else next(iter(maps.values()), None)
