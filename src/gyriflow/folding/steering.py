"""Growth by sizes: rates of cortex and core, set in each step so that pial area and volume meet two curves.

The volume grows by all that is put in, since stress has no mean in a body that nothing holds. Of the area that growth
along the surface would make, mechanics realises a part; what the last step lacked is corrected in the next one.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import SolverError
from ..geometry.tetrahedra import volumes_between
from ..geometry.triangles import TriangleMesh, area_vectors
from ..settings.folding import FoldingParameters
from ..settings.varying import value_at
from ..units import CM2_PER_MM2, ML_PER_MM3
from .growth import Floats, GrowthByRates, GrowthInputs, Size, StepGrowth, StepStart, increments
from .layers import WEIGHT_REACH, PialSearch, cortical_weight

JOINING_GW = 1.0
"""Time in which a brain that does not start on its curves comes onto them."""
FASTEST_PER_S = 1e-5
"""Largest rate that is set, the bound of the prescribed ones."""
MOST_CONTRAST = 5.0
"""Largest difference between the rates of cortex and all tissue, in multiples of growth: on a ball none adds area."""
FOLLOWED = 0.005
"""Part of a curve's value within which it counts as met."""


@dataclass(frozen=True, eq=False)
class SteeredStep(GrowthByRates):
    """Growth of a step whose rates are set so that it leads from the size `before` to the size `aim`.

    `free` (2,) are the rates of the logarithms of area and volume, in 1/s, that growth would make if nothing held it;
    `limited` says whether bounds of the rates keep the brain from its curves.
    """

    before: Size
    aim: Size
    free: Floats
    limited: bool

    def learnt(self, after: Size) -> tuple[float, ...]:
        return tuple(map(float, self.before.rates_to(after, self.start.step_s) - self.free))

    def row(self, after: Size) -> dict[str, Any]:
        made = self.before.rates_to(after, self.start.step_s)
        return super().row(after) | {
            "area_aim_cm2": self.aim.area_mm2 * CM2_PER_MM2,
            "volume_aim_ml": self.aim.volume_mm3 * ML_PER_MM3,
            "growth_rate_per_s": self.parameters.growth_rate_per_s,
            "core_growth_rate_per_s": self.parameters.core_growth_rate_per_s,
            "realised_share": float(made[0] / self.free[0]) if self.free[0] else np.nan,
            "growth_limited": int(self.limited),
        }


@dataclass(frozen=True, eq=False)
class SteeredGrowth:
    """The model of growth that follows curves; `at_start` is the size at the start of the run."""

    parameters: FoldingParameters
    inputs: GrowthInputs
    at_start: Size

    def growth(self, start: StepStart) -> StepGrowth:
        p, week = self.parameters, start.week(self.parameters, 1.0)
        before, aim = self.inputs.size(start.positions_mm), self.aim(week)
        made, other = free_growth(p, start.positions_mm, self.inputs, week)
        wanted = before.rates_to(aim, start.step_s) - other - (start.learnt or (0.0, 0.0))
        *rates, limited = steered_rates(wanted, made, (0.0, FASTEST_PER_S))
        p = p.model_copy(update={"growth_rate_per_s": rates[0], "core_growth_rate_per_s": rates[1]})
        return SteeredStep(p, start, before, aim, made @ rates + other, bool(limited))

    def aim(self, week: float) -> Size:
        """Return the size to be reached at a week."""
        start, at_start, growth = self.parameters.start_week, self.at_start, self.parameters.growth
        return Size(
            joined(growth.area_cm2, at_start.area_mm2 * CM2_PER_MM2, start, week) / CM2_PER_MM2,
            joined(growth.volume_ml, at_start.volume_mm3 * ML_PER_MM3, start, week) / ML_PER_MM3,
        )


def steered_rates(wanted: Floats, made: Floats, bounds: tuple[float, float]) -> tuple[float, float, bool]:
    """Return the rates of cortex and core, and whether bounds keep the brain from its curves.

    The cortex grows as the area is to, the core by what the volume then lacks. Where bounds leave no room for both
    curves, the volume's is met. `wanted` are the (2,) rates of the logarithms of area and volume, `made` (2, 2) is what
    unit rates of cortex and core make of them (`free_growth`). SolverError where either makes the volume no larger.
    """
    of_cortex, of_core = made[1]
    if min(of_cortex, of_core) <= 0:
        raise SolverError(
            "growth by sizes finds no rates", found="tissue that does not grow", expected="a growing core"
        )
    mean, ideal = wanted[1] / (of_cortex + of_core), wanted[0] / max(made[0, 0], 1e-9)
    most = MOST_CONTRAST * (abs(mean) + abs(ideal))
    cortex = np.clip(np.clip(ideal, mean - most, mean + most), *bounds)
    core = np.clip((wanted[1] - of_cortex * cortex) / of_core, *bounds)
    # what a bound takes from the core, the cortex makes up for
    cortex = np.clip((wanted[1] - of_core * core) / of_cortex, *bounds)
    return float(cortex), float(core), abs(cortex - ideal) > 1e-9 * (abs(mean) + abs(ideal))


def free_growth(p: FoldingParameters, positions_mm: Floats, inputs: GrowthInputs, week: float) -> tuple[Floats, Floats]:
    """Return what growth would make of the logarithms of area and volume at (n, 3) positions if nothing held it.

    A (2, 2) array for unit rates of cortex and core, and the (2,) rates in 1/s without either.
    """
    zones, thickness = inputs.zones, value_at(p.thickness_mm, week, inputs.maps)
    distance = PialSearch(positions_mm, zones.cortex_facets).distance(positions_mm, WEIGHT_REACH * np.max(thickness))
    weight, volumes = cortical_weight(distance, thickness), volumes_between(positions_mm, inputs.pieces)

    def of_volume(tangential: float, radial: float | Floats, core: float) -> float:
        dg, dr = increments(weight, zones.growth, tangential, radial, core, 1.0)
        return float((2 * dg + dr)[inputs.pieces].mean(axis=1) @ volumes / volumes.sum())

    faces = zones.measured_facets
    areas = np.linalg.norm(area_vectors(TriangleMesh(positions_mm, faces)), axis=1)
    surface = 2 * float(zones.growth[faces].mean(axis=1) @ areas / areas.sum())
    radial = of_volume(0.0, value_at(p.radial_growth_rate_per_s, week, inputs.maps), 0.0)
    return np.array([[surface, 0.0], [of_volume(1.0, 0.0, 0.0), of_volume(0.0, 0.0, 1.0)]]), np.array([0.0, radial])


def missed_curves(row: dict[str, Any]) -> str:
    """Return what to say of a step of the table that ends more than `FOLLOWED` off a curve; empty where none does."""
    if row.get("area_aim_cm2") is None:
        return ""
    errors = {"area": row["area_cm2"] / row["area_aim_cm2"] - 1, "volume": row["volume_ml"] / row["volume_aim_ml"] - 1}
    parts = [f"{name} {100 * error:+.1f} % off its curve" for name, error in errors.items() if abs(error) > FOLLOWED]
    why = ": no rates within their bounds lead to both on this shape" if row.get("growth_limited") else ""
    return f"at GW {row['week']:g} the brain is {' and '.join(parts)}{why}" if parts else ""


def joined(curve: Any, at_start: float, start_week: float, week: float) -> float:
    """Return a {week: value} curve's value at a week, for a brain that had another value at the start.

    The logarithm is linear between the weeks, and off the curve by as much as at the start until `JOINING_GW` ago.
    """
    left = max(0.0, 1.0 - (week - start_week) / JOINING_GW)
    value, first = np.interp([week, start_week], list(curve), np.log(list(curve.values())))
    return float(np.exp(value + left * (np.log(at_start) - first)))
