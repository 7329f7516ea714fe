"""Compare what the steps of a study take with two checkouts, and their metrics.

    git worktree add ../before 45cdf8ba
    ./run python benchmarks/waits.py CONFIG --before ../before --out FOLDER \\
        [--command measure] [--stage STAGE] [--repeats 5]

CONFIG is a configuration, for example of one brain from labels. Both checkouts make its
study at the same time, so that they have the same load, on one core each and in new
folders in FOLDER, by `./run gyriflow COMMAND CONFIG --cores 1`, up to the STAGE or the
file of this name if there is one. For each kind of step, and run: processor time as its
steps have recorded it, with child processes (s; median, smallest and largest of the
repeats), and the largest memory (MiB).

Of the metrics of measured brains the last table has the largest differences, relative
to the value but for metrics that may be negative, and in units of the noise: one
standard deviation of the difference between two measurements of one brain
(`norms/repeatability.yaml`). A study with runs has a table before it: the largest
differences of `COMPARED` between each run's comparisons with the observed brains. A
stage before metrics has no tables. The last line is one JSON object.
"""

import argparse
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from common import ROOT, print_rows
from kernels import KEYS

from gyriflow.io.yaml_files import read_keys
from gyriflow.metrics.repeatability import difference_noise
from gyriflow.quantities import METRICS
from gyriflow.shipped import SHIPPED
from gyriflow.step import read_usage

COMPARED = (
    "area_difference",
    "volume_difference",
    "distance_mm",
    "r_shape_index",
    "r_mean_curvature",
)
"""Columns of a run's comparison with an observed brain: parts of its size, mm,
correlations."""
KEYS_OF_RUNS = ["run", "week", "model"]
N_DIFFERENCES = 10
"""Metrics in the table of differences, the largest in units of the noise first."""


def make_studies(
    folders: Mapping[Path, Path], command: str, config: Path, stages: Sequence[str]
) -> None:
    """Make a study with each checkout in its folder up to its stages, all at the same
    time; CalledProcessError if a step fails."""
    further = [f"--stage={stage}" for stage in stages]
    processes = []
    for checkout, folder in folders.items():
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        program = ["./run", "gyriflow", command, str(config), "-d", str(folder)]
        program += ["--cores", "1", *further]
        processes.append(subprocess.Popen(program, cwd=checkout))
    for process in processes:
        if process.wait():
            raise subprocess.CalledProcessError(process.returncode, process.args)


def differences_of_runs(folders: Sequence[Path]) -> list[dict[str, Any]]:
    """Return rows of run and the largest differences of `COMPARED` between two studies;
    none for studies without runs."""
    files = [folder / "results" / "study" / "validation.csv" for folder in folders]
    if not files[0].exists():
        return []
    columns = [*KEYS_OF_RUNS, *COMPARED]
    before, now = (pd.read_csv(file)[columns].set_index(KEYS_OF_RUNS) for file in files)
    by_run = (now - before).abs().groupby("run").max()
    return by_run.reset_index().to_dict("records")


def steps_in(folder: Path) -> pd.DataFrame:
    """Return what the steps of a study took: a row per kind of step and run with cpu_s
    and memory_MiB."""
    steps = pd.DataFrame(read_usage(folder)).groupby(["rule", "run"])
    return steps.agg({"cpu_s": "sum", "memory_MiB": "max"})


def metrics_in(folder: Path) -> pd.Series:
    """Return the metrics of a study by `KEYS`, none where it has no table of them."""
    path = folder / "results" / "study" / "metrics.csv"
    table = (
        pd.read_csv(path) if path.exists() else pd.DataFrame(columns=[*KEYS, "value"])
    )
    return table.set_index(KEYS)["value"]


def differences(before: pd.Series, now: pd.Series) -> list[dict[str, Any]]:
    """Return rows of metric, largest difference and largest ratio to its noise;
    ValueError where they are not of the same brains and metrics."""
    is_same = before.index.equals(now.index)
    if not is_same or not before.isna().equals(now.isna()):
        raise ValueError("the checkouts have measured other brains or metrics")
    noise = read_keys(SHIPPED / "norms" / "repeatability.yaml")
    rows: dict[str, dict[str, Any]] = {}
    for key, value in before.dropna().items():
        metric = key[KEYS.index("metric")]
        difference = abs(now[key] - value)
        sd = difference_noise(metric, value, noise)
        ratio = difference / sd if sd > 0 else 0.0
        is_relative = value and not METRICS[metric].is_signed
        shown = difference / abs(value) if is_relative else difference
        row = rows.setdefault(metric, {"metric": metric, "largest": 0.0, "of_noise": 0})
        row["largest"] = max(row["largest"], shown)
        row["of_noise"] = max(row["of_noise"], ratio)
    return sorted(rows.values(), key=lambda row: -row["of_noise"])[:N_DIFFERENCES]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("config", type=Path)
    parser.add_argument("--before", type=Path, metavar="CHECKOUT", required=True)
    parser.add_argument("--out", type=Path, metavar="FOLDER", required=True)
    parser.add_argument("--command", default="measure", choices=["measure", "run"])
    parser.add_argument("--stage", action="append", default=[])
    parser.add_argument("--repeats", type=int, default=1)
    arguments = parser.parse_args()
    config = arguments.config.resolve()
    out = arguments.out.resolve()
    checkouts = {"before": arguments.before.resolve(), "now": ROOT}
    parts = []
    for repeat in range(arguments.repeats):
        folders = {name: out / f"{name}-{repeat}" for name in checkouts}
        studies = {checkouts[name]: folder for name, folder in folders.items()}
        make_studies(studies, arguments.command, config, arguments.stage)
        for name, folder in folders.items():
            parts.append(steps_in(folder).assign(checkout=name))
    rows = []
    steps = pd.concat(parts).reset_index()
    kinds = ["rule", "run", "checkout"]
    for (rule, run, name), taken in steps.groupby(kinds, sort=False):
        seconds = taken["cpu_s"]
        row = {"step": rule, "run": run, "checkout": name, "cpu_s": seconds.median()}
        row |= {"smallest": seconds.min(), "largest": seconds.max()}
        rows.append(row | {"memory_MiB": taken["memory_MiB"].max()})
    firsts = [out / f"{name}-0" for name in checkouts]
    runs = differences_of_runs(firsts)
    if runs:
        print(pd.DataFrame(runs).to_string(index=False, float_format="%.2g"))
    found = differences(*map(metrics_in, firsts))
    if found:
        print(pd.DataFrame(found).to_string(index=False, float_format="%.2g"))
    print_rows(rows, differences=found, runs=runs)


if __name__ == "__main__":
    main()
