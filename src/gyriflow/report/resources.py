"""Time, memory, energy and emissions of the workflow's jobs, as a table.

Energy by the formula of Green Algorithms: Lannelongue, Grealey & Inouye, Advanced Science 2021,
doi:10.1002/advs.202100707.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from math import floor, log10

import numpy as np
import pandas as pd

from .labels import plain
from .tables import html_table

SIMULATE = "simulate"
"""The rule of the simulations, whose jobs are told apart by run and keep several cores busy."""
SECONDS_PER_MINUTE = 60
SECONDS_PER_HOUR = 3600
GB_PER_MIB = 2**20 / 1e9
KWH_PER_WH = 1e-3
MOST_STAGES = 10
"""Stages with rows of their own in the page's table; the others are one row."""

OFTEN_SAMPLED_S, SHORT_GAP_S, LONG_GAP_S = 15.0, 0.5, 30.0
"""Snakemake samples a job's CPU time twice a second for a quarter of a minute, and then twice a minute."""


@dataclass(frozen=True)
class Power:
    """What energy and emissions are estimated with: the keys of `report.energy` in the configuration."""

    core_power_w: float
    memory_w_per_gb: float
    pue: float
    carbon_intensity_g_per_kwh: float


def energy_kwh(wall_s: pd.Series, cpu_s: pd.Series, memory_MiB: pd.Series, power: Power) -> pd.Series:
    """Returns the energy of jobs in kWh: t × (cores × usage × core power + memory × memory power) × PUE.

    Parameters
    ----------
    wall_s, cpu_s
        Wall time t, and t × cores × usage: the time of all busy cores together; in s.
    memory_MiB
        Memory in MiB.
    """
    core_wh = cpu_s / SECONDS_PER_HOUR * power.core_power_w
    memory_wh = wall_s / SECONDS_PER_HOUR * memory_MiB * GB_PER_MIB * power.memory_w_per_gb
    return (core_wh + memory_wh) * power.pue * KWH_PER_WH


def simulation(summary: Mapping[str, float], steps: pd.DataFrame) -> dict[str, float]:
    """Returns what a run's own files say of it, over all its calls where it was interrupted.

    Parameters
    ----------
    summary
        Content of its summary.json; without `cpu_seconds`, its ranks are taken as busy all the time.
    steps
        Its table of steps.

    Returns
    -------
    dict with `wall_s`, `cpu_s` and `memory_MiB` of the last call, `earlier_wall_s` and `earlier_cpu_s` of steps before
    """
    earlier = float(steps["seconds"].iloc[: int(summary["resumed_after_step"])].sum())
    return {
        "wall_s": summary["seconds"],
        "cpu_s": summary.get("cpu_seconds", summary["ranks"] * summary["seconds"]),
        "earlier_wall_s": earlier,
        "earlier_cpu_s": summary["ranks"] * earlier,
        "memory_MiB": summary["peak_memory_MiB"],
    }


def stage_resources(jobs: pd.DataFrame, simulations: Mapping[str, Mapping[str, float]], power: Power) -> pd.DataFrame:
    """Returns what the stages took: a row per simulation, then a row per rule with all its jobs.

    Parameters
    ----------
    jobs : columns rule, run, wall_s, cpu_s, memory_MiB
        What Snakemake has measured; NaN where it could not.
    simulations : {run: what `simulation` returns}
        A row each, whether Snakemake has measured them or not.

    Returns
    -------
    DataFrame with columns stage, run, jobs, unmeasured (jobs without a time, which add nothing), wall_s and cpu_s (sums
    over the jobs; see `busy_seconds`), peak_memory_MiB (of a single job), energy_kWh, co2e_g
    """
    jobs = jobs.astype({"wall_s": float, "cpu_s": float, "memory_MiB": float})
    measured = jobs[jobs["rule"] == SIMULATE].set_index("run")
    others = jobs[jobs["rule"] != SIMULATE].assign(run="")
    others["cpu_s"] = busy_seconds(others["wall_s"], others["cpu_s"])
    jobs = pd.concat([_simulations(pd.DataFrame(simulations).T, measured), others], ignore_index=True)
    jobs["energy_kWh"] = energy_kwh(jobs["wall_s"], jobs["cpu_s"], jobs["memory_MiB"].fillna(0), power)
    groups = jobs.groupby(["rule", "run"], sort=False)
    stages = groups[["wall_s", "cpu_s", "energy_kWh"]].sum(min_count=1)
    stages.insert(0, "jobs", groups.size())
    stages.insert(1, "unmeasured", groups.size() - groups["wall_s"].count())
    stages.insert(4, "peak_memory_MiB", groups["memory_MiB"].max())
    stages["co2e_g"] = stages["energy_kWh"] * power.carbon_intensity_g_per_kwh
    return stages.reset_index().rename(columns={"rule": "stage"})


def _simulations(own: pd.DataFrame, measured: pd.DataFrame) -> pd.DataFrame:
    """Returns a job per run: what it says of itself, or what Snakemake measured where that is more.

    Snakemake sees the start of the program, too, but no ranks on other machines.
    """
    measured = measured.reindex(own.index)
    values = {name: np.fmax(own[name], measured[name]) for name in ("wall_s", "cpu_s", "memory_MiB")}
    values["wall_s"] += own["earlier_wall_s"]
    values["cpu_s"] += own["earlier_cpu_s"]
    return pd.DataFrame({"rule": SIMULATE, "run": own.index, **values})


def busy_seconds(wall_s: pd.Series, sampled_cpu_s: pd.Series) -> pd.Series:
    """Returns the CPU time in s of jobs with one core each: what was sampled, and the time since the last sample.

    That is at most the wall time, unless more was sampled, and just that where nothing was.
    """
    gap = np.where(wall_s < OFTEN_SAMPLED_S, SHORT_GAP_S, LONG_GAP_S)
    return np.fmax(sampled_cpu_s, np.fmin(wall_s, sampled_cpu_s + gap))


def resources_table(stages: pd.DataFrame) -> pd.DataFrame:
    """Returns `stage_resources` with headings and units for print: what took longest, the rest, and all jobs."""
    stages = stages.sort_values("cpu_s", ascending=False, kind="stable")
    shown, rest = stages.iloc[:MOST_STAGES], stages.iloc[MOST_STAGES:]
    last = [_summed(rest, f"{len(rest)} others")] if len(rest) else []
    rows = pd.concat([shown, pd.DataFrame([*last, _summed(stages, "all")])], ignore_index=True)
    return pd.DataFrame(
        {
            "stage": rows["stage"].map(plain),
            "run": rows["run"],
            "jobs": rows["jobs"].astype(int),
            "wall time (min)": (rows["wall_s"] / SECONDS_PER_MINUTE).map(_three_digits),
            "CPU time (min)": (rows["cpu_s"] / SECONDS_PER_MINUTE).map(_three_digits),
            "peak memory (MiB)": rows["peak_memory_MiB"].map(_three_digits),
            "energy (kWh)": rows["energy_kWh"].map(_three_digits),
            "emissions (g CO₂e)": rows["co2e_g"].map(_three_digits),
        }
    )


def _summed(stages: pd.DataFrame, name: str) -> dict[str, object]:
    total = stages[["jobs", "wall_s", "cpu_s", "energy_kWh", "co2e_g"]].sum()
    return {"stage": name, "run": "", **total, "peak_memory_MiB": stages["peak_memory_MiB"].max()}


def _three_digits(value: float) -> float:
    """Returns a number rounded to three significant digits, or to a whole number where it has more before the point."""
    return value if np.isnan(value) or value == 0 else round(value, max(0, 2 - floor(log10(abs(value)))))


def resources_html(stages: pd.DataFrame, power: Power, *, caption: str) -> str:
    """Returns the table as HTML, with the assumptions of the estimate under it."""
    notes = [
        "Energy: wall time × (cores × usage × core power + memory × memory power) × PUE (Green Algorithms: "
        "Lannelongue, Grealey & Inouye 2021, doi:10.1002/advs.202100707).",
        f"Assumed: {power.core_power_w:g} W per core, {power.memory_w_per_gb:g} W per GB, PUE {power.pue:g}, "
        f"{power.carbon_intensity_g_per_kwh:g} g CO₂e per kWh (report.energy in the configuration).",
        "Times are summed over the jobs of a stage, which may have run side by side. CPU time: of a "
        "simulation, that of its ranks; of other jobs, what Snakemake sampled and the time since its last sample. "
        "Memory: the most that a single job took.",
    ]
    unmeasured = int(stages["unmeasured"].sum())
    if unmeasured:
        notes.append(f"Jobs without a time on record, which add nothing: {unmeasured} of {int(stages['jobs'].sum())}.")
    lines = "<br>\n".join(map(escape, notes))
    return f"{html_table(resources_table(stages), caption=caption, digits=6)}\n<p>{lines}</p>"
