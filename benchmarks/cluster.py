"""Forecast what a cohort takes on a cluster, as `gyriflow check` does: scans that are
measured only, and scans that are also folded.

    ./run python benchmarks/cluster.py FOLDER [--measured 100] [--folded 20]
        [--cores 200]

The scans of FOLDER/measured are links to the shipped label volumes, in turn, from 21 to
34 GW; those of FOLDER/folded are of 21 to 25 GW, each folded for five weeks by the
paper's model. Nothing is run, and unlike `check` this opens no scan. Below the
forecasts are those of a job of each stage, for the youngest and the oldest scan (CPU
seconds). The last line is one JSON object.
"""

import argparse
import json
import re
from contextlib import chdir
from pathlib import Path
from typing import Any

from common import ROOT

from gyriflow.cli.check import work_of
from gyriflow.io.yaml_files import read_keys, write_yaml
from gyriflow.running.cost import job_seconds, simulation_needs
from gyriflow.settings.base import folder_of
from gyriflow.study import resolve
from gyriflow.study.loading import load
from gyriflow.study.study import Study

ATLAS = ROOT / "atlases/spina-bifida"
LAST_START_GW, FOLDED_WEEKS = 25, 5
MEASURING = ("pial_with_thickness", "measure", "brain_figures")
FOLDING = ("tetrahedralise", "simulate", "measure_simulated")
RUN = "reference"


def volumes() -> list[tuple[int, Path]]:
    """Return the shipped label volumes with their weeks, the youngest first."""
    found = []
    for path in ATLAS.glob("*/parcellation.nii.gz"):
        week = int(re.findall(r"GA(\d+)", path.parent.name)[0])
        found.append((week, path))
    return sorted(found)


def write_study(folder: Path, number: int, *, is_folded: bool) -> Path:
    """Write a study of so many scans; return the path of its configuration."""
    folder.mkdir(parents=True, exist_ok=True)
    scans = volumes()
    if is_folded:
        scans = [scan for scan in scans if scan[0] <= LAST_START_GW]
    brains: list[dict[str, Any]] = []
    runs = {}
    for index in range(number):
        week, volume = scans[index % len(scans)]
        scan = folder / f"scan{index:03}.nii.gz"
        if not scan.is_symlink():
            scan.symlink_to(volume)
        name = f"scan{index:03}"
        labels = {"labels": scan.name, "scheme": "spina-bifida-atlas"}
        brains.append({"id": name, "subject": name, "week": week, **labels})
        runs[f"{RUN}-{week}"] = {
            "preset": "fetalfoldsim",
            "end_week": week + FOLDED_WEEKS,
        }
    study: dict[str, Any] = {"brains": brains}
    if is_folded:
        for run, settings in runs.items():
            week = int(run.removeprefix(f"{RUN}-"))
            settings["start"] = [
                brain["id"] for brain in brains if brain["week"] == week
            ]
        end = LAST_START_GW + FOLDED_WEEKS
        study |= {"start": "all", "folding": {"end_week": end}, "runs": runs}
    path = folder / "study.yaml"
    write_yaml(path, study)
    return path


def forecast(config: Path, study: Study, n_cores: int) -> dict[str, str]:
    """Return the last lines of `gyriflow check`, by the word that they begin with."""
    cores = ["--cores", str(n_cores)]
    lines = {}
    for line, _ in work_of(config, config.parent, n_cores, cores, study):
        word, _, rest = line.partition(" ")
        if word in ("to", "time", "work", "memory", "disk"):
            lines[word] = rest.strip()
    return lines


def stages(study: Study, rules: tuple[str, ...]) -> dict[str, list[float]]:
    """Return the forecast of a job of each stage for the first and the last brain (CPU
    s)."""
    names = list(study.brains)
    by_week = sorted(names, key=lambda name: study.brains[name].week)
    run_of = {brain: run for run, brain in study.simulations}
    seconds = {}
    for rule in rules:
        row = []
        for brain in (by_week[0], by_week[-1]):
            wildcards = {"brain": brain, "run": run_of.get(brain, "")}
            row.append(round(job_seconds(study, rule, wildcards), 1))
        seconds[rule] = row
    return seconds


def main() -> None:
    """Write both studies and print their forecasts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--measured", type=int, default=100)
    parser.add_argument("--folded", type=int, default=20)
    parser.add_argument("--cores", type=int, default=200)
    arguments = parser.parse_args()
    # each study is loaded from its own folder
    folder = arguments.folder.resolve()
    rows: dict[str, Any] = {}
    for name, number in (
        ("measured", arguments.measured),
        ("folded", arguments.folded),
    ):
        is_folded = name == "folded"
        path = write_study(folder / name, number, is_folded=is_folded)
        with chdir(path.parent):
            study = resolve(load(read_keys(path), folder_of(path)))
        rows[name] = {
            "scans": number,
            "check": forecast(path, study, arguments.cores),
            "stages": stages(study, MEASURING + (FOLDING if is_folded else ())),
        }
        if is_folded:
            rows[name]["simulation_MiB"] = sorted(
                round(simulation_needs(run, study.config.mesh).memory_mib)
                for run in study.run_simulations
            )
        print(f"{number} scans, {name}")
        for word, text in rows[name]["check"].items():
            print(f"  {word:7s} {text}")
        for rule, seconds in rows[name]["stages"].items():
            print(f"  {rule}: {seconds[0]} to {seconds[1]} s")
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
