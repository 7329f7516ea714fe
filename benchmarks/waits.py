"""Compare what a command takes with two checkouts, step by step, and its metrics.

    git worktree add ../before 45cdf8ba
    ./run python benchmarks/waits.py CONFIG --before ../before --out FOLDER \\
        [--command measure] [--stage STAGE] [--cores 1] [--repeats 5]

CONFIG is a configuration, for example of one brain from labels; of one in this
checkout, each checkout takes its own. `--command` is `measure`, `run`, `check` or
`init`, which needs the folder of the scans instead. Both checkouts run it in new
folders in FOLDER, up to the STAGE or the file of this name if there is one: on one core
each at the same time, so that they have the same load (the faster one runs again
meanwhile, which is not counted), and on several cores in turn.

The first table has, for each kind of step and run, processor time as its steps have
recorded it, with child processes (s; median, smallest and largest of the repeats), and
the largest memory (MiB). Rows `whole` are of the command with all its processes, and
`wall` their time by the clock. `check` and `init` have no steps; they are repeated at
once, as `again`, with what they keep of the files that they have read.

Of the metrics of measured brains the last table has the largest differences, relative
to the value but for metrics that may be negative, and in units of the noise: one
standard deviation of the difference between two measurements of one brain
(`norms/repeatability.yaml`). A study with runs has a table before it: the largest
differences of `COMPARED` between each run's comparisons with the observed brains. A
stage before metrics has no tables. The last line is one JSON object.
"""

import argparse
import os
import resource
import shutil
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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

READING = ("check", "init")
COMMANDS = ("measure", "run", *READING)
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


@dataclass(frozen=True)
class Command:
    """A command for a configuration, or a folder of scans, with arguments of its
    own."""

    name: str
    config: Path
    cores: int
    stages: Sequence[str]

    @property
    def is_reading(self) -> bool:
        """Whether it has no steps, and keeps what it has read."""
        return self.name in READING

    def arguments(self, checkout: Path, folder: Path) -> list[str]:
        """Return the program and its arguments in a checkout, for a study in a
        folder."""
        config = self.config
        if config.is_relative_to(ROOT):
            config = checkout / config.relative_to(ROOT)
        program = ["./run", "gyriflow", self.name, str(config)]
        if self.name == "init":
            return [*program, "--output", str(folder / "gyriflow.yaml"), "--force"]
        stages = [f"--stage={stage}" for stage in self.stages]
        return [*program, "-d", str(folder), "--cores", str(self.cores), *stages]


def start(command: Command, checkout: Path, folder: Path) -> subprocess.Popen:
    """Start a command of a checkout in a folder."""
    environment = dict(os.environ)
    if command.is_reading:
        environment["XDG_CACHE_HOME"] = str(folder / "cache")
    return subprocess.Popen(
        command.arguments(checkout, folder),
        cwd=checkout,
        env=environment,
        stdout=subprocess.DEVNULL if command.is_reading else None,
    )


def wait_for(process: subprocess.Popen) -> float:
    """Wait for a process; return its processor time with that of its children (s);
    CalledProcessError if it fails."""
    _, status, usage = os.wait4(process.pid, 0)
    return time_of(process, status, usage)


def time_of(
    process: subprocess.Popen, status: int, usage: resource.struct_rusage
) -> float:
    """Return the processor time (s) of a process that ended with a status;
    CalledProcessError if it failed."""
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, process.args)
    return usage.ru_utime + usage.ru_stime


def make_anew(folder: Path) -> None:
    """Make an empty folder, in place of one that is there."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)


def take_times(
    command: Command, folders: Mapping[Path, Path]
) -> dict[Path, dict[str, float]]:
    """Run a command with each checkout in its folder; return by checkout processor time
    as `whole`, and time by the clock as `wall` if they run in turn."""
    if command.cores == 1:
        return take_times_together(command, folders)
    times = {}
    for checkout, folder in folders.items():
        started = time.monotonic()
        cpu_s = wait_for(start(command, checkout, folder))
        times[checkout] = {"whole": cpu_s, "wall": time.monotonic() - started}
    return times


def take_times_together(
    command: Command, folders: Mapping[Path, Path]
) -> dict[Path, dict[str, float]]:
    """Run a command with both checkouts at the same time; the one that ends first runs
    again until the other ends, which has the same load to its end then."""
    running = {}
    for checkout, folder in folders.items():
        process = start(command, checkout, folder)
        running[process.pid] = checkout, process
    times: dict[Path, dict[str, float]] = {}
    try:
        while len(times) < len(folders):
            ended, status, usage = os.wait4(-1, 0)
            checkout, process = running.pop(ended)
            seconds = time_of(process, status, usage)
            times.setdefault(checkout, {"whole": seconds})
            if len(times) < len(folders):
                spare = folders[checkout].with_name("load")
                make_anew(spare)
                process = start(command, checkout, spare)
                running[process.pid] = checkout, process
    finally:
        for _, process in running.values():
            process.terminate()
            process.wait()
    return times


def make_studies(
    command: Command, folders: Mapping[Path, Path]
) -> dict[Path, dict[str, float]]:
    """Run a command with each checkout in its folder, made anew, and reading commands
    once more; return the times by checkout and name."""
    for folder in folders.values():
        make_anew(folder)
    times = take_times(command, folders)
    if command.is_reading:
        for checkout, again in take_times(command, folders).items():
            for name, seconds in again.items():
                times[checkout][f"{name}, again"] = seconds
    return times


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
    """Return what the steps of a study took: rule, run, cpu_s and memory_MiB of each
    kind of step and run."""
    used = pd.DataFrame(
        read_usage(folder),
        columns=["rule", "run", "cpu_s", "memory_MiB"],
    )
    steps = used.groupby(["rule", "run"], as_index=False)
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
    parser.add_argument("--command", default="measure", choices=COMMANDS)
    parser.add_argument("--stage", action="append", default=[])
    parser.add_argument("--cores", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=1)
    arguments = parser.parse_args()
    command = Command(
        arguments.command,
        arguments.config.resolve(),
        arguments.cores,
        arguments.stage,
    )
    out = arguments.out.resolve()
    checkouts = {"before": arguments.before.resolve(), "now": ROOT}
    parts = []
    for repeat in range(arguments.repeats):
        folders = {name: out / f"{name}-{repeat}" for name in checkouts}
        studies = {checkouts[name]: folder for name, folder in folders.items()}
        times = make_studies(command, studies)
        for name, folder in folders.items():
            whole = [
                {"rule": kind, "run": "", "cpu_s": seconds}
                for kind, seconds in times[checkouts[name]].items()
            ]
            steps = pd.concat([steps_in(folder), pd.DataFrame(whole)])
            parts.append(steps.assign(checkout=name))
    rows = []
    steps = pd.concat(parts)
    kinds = ["rule", "run", "checkout"]
    for (rule, run, name), taken in steps.groupby(kinds, sort=False):
        seconds = taken["cpu_s"]
        row = {"step": rule, "run": run, "checkout": name, "s": seconds.median()}
        row |= {"smallest": seconds.min(), "largest": seconds.max()}
        memory = taken["memory_MiB"].dropna()
        if len(memory):
            row["memory_MiB"] = memory.max()
        rows.append(row)
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
