"""Time, memory, energy and emissions of the workflow's jobs, as Snakemake measured them."""

import pandas as pd

from ..parameters.terms import CARBON_INTENSITY_G_PER_KWH, CORE_POWER_W

SECONDS_PER_HOUR = 3600


def resources(jobs: pd.DataFrame) -> pd.DataFrame:
    """Sum up jobs: a row per rule, a row per run of the simulations, the longest first, and the sum of all.

    A job keeps one core busy at least, so its energy is the longer of wall and CPU time times the power of a core.

    Parameters
    ----------
    jobs : columns rule, run, wall_s, cpu_s, memory_MiB
        NaN where Snakemake could not measure; such jobs are counted and add nothing.

    Returns
    -------
    DataFrame with columns stage, run, jobs, hours and core_hours (sums), memory_MiB (of the largest job), energy_Wh,
    co2e_g
    """
    hours = jobs[["wall_s", "cpu_s"]].astype(float) / SECONDS_PER_HOUR
    each = jobs.assign(hours=hours["wall_s"], core_hours=hours.max(axis=1), run=jobs["run"].fillna(""), jobs=1)
    of_all = {"jobs": "sum", "hours": "sum", "core_hours": "sum", "memory_MiB": "max"}
    stages = each.groupby(["rule", "run"], sort=False, as_index=False).agg(of_all)
    stages = stages.rename(columns={"rule": "stage"}).sort_values("core_hours", ascending=False, kind="stable")
    whole = pd.DataFrame([{"stage": "all", "run": "", **stages.agg(of_all)}])
    table = pd.concat([stages, whole], ignore_index=True).astype({"jobs": int})
    table["energy_Wh"] = CORE_POWER_W * table["core_hours"]
    return table.assign(co2e_g=CARBON_INTENSITY_G_PER_KWH / 1000 * table["energy_Wh"])
