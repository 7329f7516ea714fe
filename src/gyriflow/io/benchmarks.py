"""The benchmark files that Snakemake leaves of each job: wall time, CPU time and memory."""

import logging
import re
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from .files import AnyPath

COLUMNS = {"s": "wall_s", "cpu_time": "cpu_s", "max_rss": "memory_MiB"}
"""Columns that are read, by their names in the files; Snakemake calls 2²⁰ bytes a megabyte."""


def read_benchmarks(folder: AnyPath, patterns: Mapping[str, str]) -> pd.DataFrame:
    """Returns what Snakemake measured of the jobs whose benchmark files are of a rule.

    Parameters
    ----------
    folder
        What paths are relative to; the files are looked for in folders `benchmarks` of its `results`.
    patterns : {rule: regular expression}
        Paths of a rule's files; groups named `run` and `brain` match the job's run and brain.

    Returns
    -------
    DataFrame with columns rule, run and brain (None where there is none), wall_s, cpu_s, memory_MiB
        In the order of the rules. Values are NaN where Snakemake could not measure ("NA", "-") or the file is torn.
    """
    folder = Path(folder)
    found = sorted(path.relative_to(folder).as_posix() for path in folder.glob("results/**/benchmarks/*.tsv"))
    rows = []
    for rule, pattern in patterns.items():
        for path in found:
            if match := re.fullmatch(pattern, path):
                of = {name: match.groupdict().get(name) for name in ("run", "brain")}
                rows.append({"rule": rule, **of, **_measured(folder / path)})
    return pd.DataFrame(rows, columns=["rule", "run", "brain", *COLUMNS.values()])


def read_stages(folder: AnyPath) -> pd.DataFrame:
    """Returns what the jobs of each stage took, by what their benchmark files are called, in the order of their time.

    Returns
    -------
    DataFrame with columns stage, jobs, wall_s and cpu_s (sums over the jobs), peak_memory_MiB
    """
    found = sorted(Path(folder).glob("results/**/benchmarks/*.tsv"))
    # files of registrations are called by their brains
    names = ["register" if path.parts[-3] == "registration" else path.name.split(".")[0] for path in found]
    table = pd.DataFrame([_measured(path) for path in found], columns=[*COLUMNS.values()]).assign(stage=names)
    groups = table.groupby("stage")
    stages = groups[["wall_s", "cpu_s"]].sum()
    stages.insert(0, "jobs", groups.size())
    stages["peak_memory_MiB"] = groups["memory_MiB"].max()
    return stages.sort_values("cpu_s", ascending=False).reset_index()


def _measured(path: Path) -> dict[str, float]:
    try:
        table = pd.read_csv(path, sep="\t", dtype=str)
    except (OSError, ValueError) as error:
        logging.warning("%s cannot be read: %s", path, error)
        table = pd.DataFrame()
    numbers = table.reindex(columns=list(COLUMNS)).apply(pd.to_numeric, errors="coerce")
    # a job that was told to repeat itself has several lines
    return {
        "wall_s": numbers["s"].sum(min_count=1),
        "cpu_s": numbers["cpu_time"].sum(min_count=1),
        "memory_MiB": numbers["max_rss"].max(),
    }
