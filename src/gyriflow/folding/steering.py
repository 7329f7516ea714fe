"""Growth by sizes: the rates of cortex and core are set in each step so that pial area
and volume follow two curves.

All of the volume growth is realised, since the mean stress in an unsupported body is
zero. Only a part of tangential growth becomes pial area; the shortfall of a step is
corrected in the next one (feedback control).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import SolverError
from ..geometry.tetrahedra import volumes_between
from ..geometry.triangles import TriangleMesh, face_areas
from ..settings.folding import FoldingParameters
from ..settings.varying import value_at
from ..units import CM2_PER_MM2, ML_PER_MM3
from .growth import Floats, GrowthByRates, GrowthInputs, Size, StepStart, increments
from .layers import PialSearch, cortical_weight

JOINING_GW = 1.0
"""Time within which a brain that does not start on its curves joins them."""
MAX_RATE_PER_S = 1e-5
"""Largest rate that is set, the upper bound of prescribed rates."""
CURVE_TOL = 0.005
"""Relative tolerance within which a curve counts as followed."""


@dataclass(frozen=True, eq=False)
class SteeredStep(GrowthByRates):
    """Growth of a step with rates set so that the size `before` becomes the size
    `target`.

    `free_rates` (2,) are the rates of the logarithms of area and volume, in 1/s, of
    unconstrained growth; `limited` is True if the bounds of the rates prevent the brain
    from following its curves.
    """

    before: Size
    target: Size
    free_rates: Floats
    limited: bool

    def correction(self, after: Size) -> tuple[float, ...]:
        realised = self.before.rates_to(after, self.start.step_s)
        return tuple((realised - self.free_rates).tolist())

    def row(self, after: Size) -> dict[str, Any]:
        realised_area, _ = self.before.rates_to(after, self.start.step_s)
        free_area, _ = self.free_rates
        return super().row(after) | {
            "area_aim_cm2": self.target.area_mm2 * CM2_PER_MM2,
            "volume_aim_ml": self.target.volume_mm3 * ML_PER_MM3,
            "growth_rate_per_s": self.parameters.growth_rate_per_s,
            "core_growth_rate_per_s": self.parameters.core_growth_rate_per_s,
            "realised_share": float(realised_area / free_area) if free_area else np.nan,
            "growth_limited": int(self.limited),
        }


def steered_growth(
    p: FoldingParameters,
    inputs: GrowthInputs,
    at_start: Size,
    start: StepStart,
) -> SteeredStep:
    """Return the growth by sizes of a step of a run with a size `at_start`."""
    week = start.week(p, 1.0)
    area_cm2 = _blended(
        p.growth.area_cm2, at_start.area_mm2 * CM2_PER_MM2, p.start_week, week
    )
    volume_ml = _blended(
        p.growth.volume_ml, at_start.volume_mm3 * ML_PER_MM3, p.start_week, week
    )
    target = Size(area_cm2 / CM2_PER_MM2, volume_ml / ML_PER_MM3)
    before = inputs.size(start.positions_mm)
    by_unit_rates = _free_growth(p, start.positions_mm, inputs, week)
    required = before.rates_to(target, start.step_s)
    if start.correction:
        required -= start.correction
    cortex, core, is_limited = _steered_rates(
        required, by_unit_rates, (0.0, MAX_RATE_PER_S)
    )
    rates = {"growth_rate_per_s": cortex, "core_growth_rate_per_s": core}
    return SteeredStep(
        p.model_copy(update=rates),
        start,
        before,
        target,
        free_rates=by_unit_rates @ [cortex, core],
        limited=bool(is_limited),
    )


def _steered_rates(
    required: Floats,
    by_unit_rates: Floats,
    bounds: tuple[float, float],
) -> tuple[float, float, bool]:
    """Return the rates of cortex and core, and whether bounds prevent the brain from
    following its curves.

    The rate of the cortex is set by the area, then that of the core by the remaining
    volume. If bounds exclude both curves, that of the volume is followed. `required`
    are the (2,) rates of the logarithms of area and volume, `by_unit_rates` (2, 2) what
    unit rates of cortex and core add to them (`_free_growth`). SolverError if cortex or
    core adds no volume.
    """
    area, volume = required
    cortex_area = by_unit_rates[0, 0]
    cortex_volume, core_volume = by_unit_rates[1]
    if min(cortex_volume, core_volume) <= 0:
        raise SolverError(
            "growth by sizes finds no rates",
            found="tissue that does not grow",
            expected="a growing core",
        )
    ideal = area / max(cortex_area, 1e-9)
    # on a ball tangential growth adds no area: feedback raises it until the core no
    # longer grows
    cortex = np.clip(ideal, *bounds)
    core = np.clip(
        (volume - cortex_volume * cortex) / core_volume,
        *bounds,
    )
    # the cortex makes up for a core at its bound
    cortex = np.clip(
        (volume - core_volume * core) / cortex_volume,
        *bounds,
    )
    mean = volume / (cortex_volume + core_volume)
    is_limited = abs(cortex - ideal) > 1e-9 * (abs(mean) + abs(ideal))
    return float(cortex), float(core), is_limited


def _free_growth(
    p: FoldingParameters,
    positions_mm: Floats,
    inputs: GrowthInputs,
    week: float,
) -> Floats:
    """Return the (2, 2) rates of the logarithms of area and volume (rows) of
    unconstrained growth at (n, 3) positions, for unit rates of cortex and core
    (columns)."""
    zones = inputs.zones
    thickness = value_at(p.thickness_mm, week, inputs.maps)
    search = PialSearch(positions_mm, zones.cortex_facets)
    distance, _ = search.nearest(positions_mm)
    weight = cortical_weight(distance, thickness)
    volumes = volumes_between(positions_mm, inputs.pieces)
    volume_rates = []
    for tangential, core in ((1.0, 0.0), (0.0, 1.0)):
        rates = {"growth_rate_per_s": tangential, "core_growth_rate_per_s": core}
        by_rates = p.model_copy(update=rates)
        dg, dr = increments(
            by_rates,
            weight,
            zones.growing,
            {},
            week,
            1.0,
        )
        of_volume = 2 * dg + dr
        of_pieces = of_volume[inputs.pieces].mean(axis=1)
        volume_rates.append(np.average(of_pieces, weights=volumes))
    faces = zones.measured_facets
    areas = face_areas(TriangleMesh(positions_mm, faces))
    growing = zones.growing[faces].mean(axis=1)
    cortex_area = 2 * float(growing @ areas / areas.sum())
    return np.array([[cortex_area, 0.0], volume_rates])


def missed_curves(row: dict[str, Any]) -> str:
    """Return a warning if a row of the step table is more than `CURVE_TOL` off a curve,
    else an empty text."""
    if row.get("area_aim_cm2") is None:
        return ""
    errors = {
        "area": row["area_cm2"] / row["area_aim_cm2"] - 1,
        "volume": row["volume_ml"] / row["volume_aim_ml"] - 1,
    }
    parts = []
    for name, error in errors.items():
        if abs(error) > CURVE_TOL:
            parts.append(f"{name} {100 * error:+.1f} % off its curve")
    if not parts:
        return ""
    text = f"at GW {row['week']:g} the brain is {' and '.join(parts)}"
    if row.get("growth_limited"):
        text += ": no growth rates within their bounds follow both curves"
    return text


def _blended(
    curve: Any,
    at_start: float,
    start_week: float,
    week: float,
) -> float:
    """Return the value at a week of a {week: value} curve, for a brain with another
    value at the start.

    The logarithm is linear between the weeks; the difference at the start decreases
    linearly to 0 in `JOINING_GW`.
    """
    weeks = list(curve)
    logs = np.log(list(curve.values()))
    log_now = np.interp(week, weeks, logs)
    log_first = np.interp(start_week, weeks, logs)
    passed = (week - start_week) / JOINING_GW
    part_left = max(0.0, 1.0 - passed)
    difference = np.log(at_start) - log_first
    return math.exp(log_now + part_left * difference)
