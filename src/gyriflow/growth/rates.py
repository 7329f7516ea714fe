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
    weeks: Sequence[float], areas_mm2: Sequence[float], volumes_mm3: Sequence[float]
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
    order = np.argsort(weeks)
    week, area, volume = (
        np.asarray(column, dtype=float)[order]
        for column in (weeks, areas_mm2, volumes_mm3)
    )
    seconds = np.diff(week) * SECONDS_PER_GW
    area_ratio, volume_ratio = area[1:] / area[:-1], volume[1:] / volume[:-1]
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


def rates_of_series(areas: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """Return the growth rates of named series of brains: tables of `growth_rates` with
    the column `series`.

    `areas` has the columns series, week, area_cm2 and volume_ml; brains of the same
    week and series are averaged. If it also has tissue_ml, ventricles_ml and cortex_ml,
    from labels, the table has tissue_ratio, … and tissue_compound_rate_per_s, …,
    ln(V₂/V₁)/(3Δt), NaN where unknown.
    """
    tables = []
    for name, brains in areas[areas["series"].isin(names)].groupby(
        "series", sort=False
    ):
        weekly = brains.groupby("week")[["area_cm2", "volume_ml"]].mean()
        areas_mm2 = weekly["area_cm2"] / CM2_PER_MM2
        volumes_mm3 = weekly["volume_ml"] / ML_PER_MM3
        rates = growth_rates(
            weekly.index.tolist(), areas_mm2.tolist(), volumes_mm3.tolist()
        )
        rates.insert(0, "series", name)
        seconds = (rates["to_week"] - rates["from_week"]) * SECONDS_PER_GW
        for tissue in TISSUES:
            if f"{tissue}_ml" in brains:
                volumes_ml = (
                    brains.groupby("week")[f"{tissue}_ml"].mean().to_numpy(dtype=float)
                )
                ratio = volumes_ml[1:] / volumes_ml[:-1]
                rates[f"{tissue}_ratio"] = ratio
                rates[f"{tissue}_compound_rate_per_s"] = np.log(ratio) / (3 * seconds)
        tables.append(rates)
    return (
        pd.concat(tables, ignore_index=True)
        if tables
        else growth_rates([], [], []).assign(series=[])
    )


def growth_sd(
    run: Mapping[str, Floats], members: Sequence[Mapping[str, Floats]]
) -> dict[str, Floats]:
    """Return the standard deviation (n − 1) of the growth of area and thickness over
    the members of a run's ensemble.

    All are maps of `growth_per_week`. The result is NaN for fewer than two members.
    """
    names = [name for name in run if not name.startswith("growth_direction")]
    if len(members) < 2:
        return {name: np.full_like(run[name], np.nan) for name in names}
    return {
        name: np.std([maps[name] for maps in members], axis=0, ddof=1) for name in names
    }


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
    # area grows with the square of the mean tangential stretch
    return {
        (before, week): {
            "area_growth_percent_per_gw": (
                100
                * np.expm1(2 * steps * frames[week][1]["tangential_growth_per_step"])
            ),
            "thickness_growth_percent_per_gw": (
                100 * np.expm1(steps * frames[week][1]["radial_growth_per_step"])
            ),
            **{
                f"growth_direction_{axis}": steps * values
                for axis, values in zip(
                    "xyz", frames[week][1]["growth_direction_per_step"].T, strict=True
                )
            },
        }
        for before, week in pairwise(sorted(frames))
    }
