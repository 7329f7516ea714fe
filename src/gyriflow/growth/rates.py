"""Growth rates of cortex and core between gestational weeks, and maps of the growth
that a simulation has found."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from ..geometry.triangles import Floats, TriangleMesh
from ..units import CM2_PER_MM2, ML_PER_MM3, SECONDS_PER_GW

TISSUES = ("tissue", "ventricles", "cortex")
"""Parts of the volume inside the pial surface that labels distinguish; the volume
includes the ventricles."""


def growth_rates(
    weeks: Sequence[float],
    areas_mm2: Sequence[float],
    volumes_mm3: Sequence[float],
) -> pd.DataFrame:
    """Return the growth rates between successive weeks, given sizes at two or more
    weeks in any order.

    The cortex grows in area: α = (θ^(1/2) − 1)/Δt with the growth multiplier θ = A₂/A₁
    (the paper's equation, dim = 2), the core in volume: ((V₂/V₁)^(1/3) − 1)/Δt (dim =
    3), with Δt the true time between the two weeks. These rates refer to the size at
    the start of the interval. The folding model grows by (1 + rate·dt) in every step:
    rates for it, which reproduce the ratios as long as steps are short, are ln(θ)/(2Δt)
    and ln(V₂/V₁)/(3Δt).

    Columns from_week, to_week, area_ratio (θ), rate_per_s, compound_rate_per_s,
    volume_ratio, core_rate_per_s, core_compound_rate_per_s, by ascending week.
    """
    columns = {"week": weeks, "area": areas_mm2, "volume": volumes_mm3}
    sizes = pd.DataFrame(columns, dtype=float).sort_values("week", kind="stable")
    week = sizes["week"].to_numpy()
    seconds = np.diff(week) * SECONDS_PER_GW
    area_ratio = _ratios(sizes["area"])
    volume_ratio = _ratios(sizes["volume"])
    return pd.DataFrame(
        {
            "from_week": week[:-1],
            "to_week": week[1:],
            "area_ratio": area_ratio,
            "rate_per_s": (area_ratio ** (1 / 2) - 1) / seconds,
            "compound_rate_per_s": np.log(area_ratio) / (2 * seconds),
            "volume_ratio": volume_ratio,
            "core_rate_per_s": (volume_ratio ** (1 / 3) - 1) / seconds,
            "core_compound_rate_per_s": np.log(volume_ratio) / (3 * seconds),
        }
    )


def _ratios(sizes: pd.Series) -> Floats:
    """Return the ratios of each but the first size to the one before."""
    values = sizes.to_numpy(dtype=float)
    return values[1:] / values[:-1]


def rates_of_series(areas: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """Return the growth rates of named series of brains: tables of `growth_rates` with
    the column `series`.

    `areas` has the columns series, week, area_cm2 and volume_ml; brains of the same
    week and series are averaged. If it also has tissue_ml, ventricles_ml and cortex_ml,
    from labels, the table has tissue_ratio, … and tissue_compound_rate_per_s, …,
    ln(V₂/V₁)/(3Δt), NaN where unknown.
    """
    tables = []
    chosen = areas[areas["series"].isin(names)]
    for name, brains in chosen.groupby("series", sort=False):
        sizes = brains.filter(regex="^week$|_cm2$|_ml$").astype(float)
        weekly = sizes.groupby("week").mean()
        rates = growth_rates(
            weekly.index.tolist(),
            (weekly["area_cm2"] / CM2_PER_MM2).tolist(),
            (weekly["volume_ml"] / ML_PER_MM3).tolist(),
        )
        rates.insert(0, "series", name)
        seconds = (rates["to_week"] - rates["from_week"]) * SECONDS_PER_GW
        for tissue in TISSUES:
            if f"{tissue}_ml" in weekly:
                ratio = _ratios(weekly[f"{tissue}_ml"])
                rates[f"{tissue}_ratio"] = ratio
                rates[f"{tissue}_compound_rate_per_s"] = np.log(ratio) / (3 * seconds)
        tables.append(rates)
    if not tables:
        # the columns of a table without rows
        return growth_rates([], [], []).assign(series=[])
    return pd.concat(tables, ignore_index=True)


def growth_sd(
    run: Mapping[str, Floats], members: Sequence[Mapping[str, Floats]]
) -> dict[str, Floats]:
    """Return the standard deviation (n − 1) of the growth of area and thickness over
    the members of a run's ensemble.

    All are maps of `growth_per_week`. The result is NaN for fewer than two members.
    """
    deviations = {}
    for name, values in run.items():
        if name.startswith("growth_direction"):
            continue
        if len(members) < 2:
            deviations[name] = np.full_like(values, np.nan)
        else:
            of_members = [maps[name] for maps in members]
            deviations[name] = np.std(
                of_members,
                axis=0,
                ddof=1,
            )
    return deviations


def growth_per_week(
    frames: Mapping[float, tuple[TriangleMesh, Mapping[str, Floats]]], step_s: float
) -> dict[tuple[float, float], dict[str, Floats]]:
    """Return maps of the mean growth between output weeks, by interval, at the vertices
    of the surface at its end.

    `frames` are by week the surface and its fields, of log growth per step averaged
    since the previous output week: `tangential_growth_per_step` and
    `radial_growth_per_step` (n,), and `growth_direction_per_step` (n, 3), the
    tangential direction of largest growth, as long as the difference of the two
    principal tangential log growths. `step_s` is the length of that step in s.

    Returns area_growth_percent_per_gw and thickness_growth_percent_per_gw (n,), and
    growth_direction_x, _y, _z, the vectors of the frames as logarithms per week.
    """
    steps = SECONDS_PER_GW / step_s
    maps = {}
    for before, week in pairwise(sorted(frames)):
        _, fields = frames[week]
        tangential = fields["tangential_growth_per_step"]
        radial = fields["radial_growth_per_step"]
        x, y, z = steps * fields["growth_direction_per_step"].T
        maps[before, week] = {
            # area grows with the square of the mean tangential stretch
            "area_growth_percent_per_gw": 100 * np.expm1(2 * steps * tangential),
            "thickness_growth_percent_per_gw": 100 * np.expm1(steps * radial),
            "growth_direction_x": x,
            "growth_direction_y": y,
            "growth_direction_z": z,
        }
    return maps
