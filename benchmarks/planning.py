"""Measure how long a study of many brains takes to plan: its tables, a dry run, the
start of one of its jobs, a run of which everything is up to date, and with `--check`
its first and its second check.

    ./run python benchmarks/planning.py [--brains 10 100 1000] [--check] [--out FOLDER]

Each brain is a link to one shipped label volume, each a subject of its own that is
measured. The first check reads the volumes. The results that are up to date are empty
files with their manifests. Times are CPU seconds of all processes. The last line is one
JSON object.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from common import ROOT

from gyriflow.io.yaml_files import write_yaml

LABELS = (
    ROOT / "atlases/spina-bifida/fetal_SB_atlas_GA21_notoperated/parcellation.nii.gz"
)
WEEKS = (20.5, 21.0, 21.5)
PLAN = """
from pathlib import Path
from gyriflow.io.yaml_files import read_keys
from gyriflow.study import resolve
from gyriflow.study.loading import load
from gyriflow.study.study import write_plan
write_plan(resolve(load(read_keys("study.yaml"))), Path("results", "plan"))
"""
MADE = """
import sys
from pathlib import Path
from gyriflow.running.launch import main
from gyriflow.running.manifest import write_manifest

def make(plan):
    for job in plan.jobs:
        for file in job.outputs:
            Path(file).parent.mkdir(parents=True, exist_ok=True)
            Path(file).touch()
    for job in plan.jobs:
        write_manifest(job, plan.found)

main([*sys.argv[1:], "--dry-run"], make, is_shown=False)
"""


def main() -> None:
    """Measure studies of the given sizes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--brains", type=int, nargs="+", default=[10, 100, 1000])
    parser.add_argument("--check", action="store_true", help="also measure `check`")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    with TemporaryDirectory() as scratch:
        out = arguments.out or Path(scratch)
        rows = {}
        for number in arguments.brains:
            folder = out / str(number)
            write_study(folder, number)
            rows[str(number)] = planning_seconds(folder, has_check=arguments.check)
            print(number, rows[str(number)], flush=True)
    print(json.dumps(rows))


def write_study(folder: Path, number: int) -> None:
    """Write a study of a number of brains."""
    folder.mkdir(parents=True, exist_ok=True)
    brains: list[dict[str, Any]] = []
    for index in range(number):
        scan = folder / f"scan-{index:04}.nii.gz"
        if not scan.is_symlink():
            scan.symlink_to(LABELS)
        brain = {
            "id": f"b{index:04}",
            "subject": f"s{index:04}",
            "week": WEEKS[index % len(WEEKS)],
            "labels": scan.name,
            "scheme": "spina-bifida-atlas",
        }
        brains.append(brain)
    write_yaml(folder / "study.yaml", {"brains": brains})


def planning_seconds(folder: Path, *, has_check: bool) -> dict[str, float]:
    """Return the CPU seconds of each way to plan a study."""
    python = [sys.executable, "-P"]
    snakefile = ["--snakefile", str(ROOT / "Snakefile")]
    study = ["--configfile", "study.yaml"]
    launch = [*python, "-m", "gyriflow.running.launch", *study, "--cores", "1"]
    job = [*python, "-m", "snakemake", *snakefile, "--mode", "subprocess"]
    seconds = {
        "plan": cpu_seconds([*python, "-c", PLAN], folder),
        "dry_run": cpu_seconds([*launch, "--dry-run", "--quiet", "all"], folder),
        "job_start": cpu_seconds([*job, "--list-rules"], folder),
    }
    cpu_seconds([*python, "-c", MADE, *launch[4:]], folder)
    # the first one records the contents of the results
    cpu_seconds(launch, folder)
    seconds["up_to_date"] = cpu_seconds(launch, folder)
    if has_check:
        check = [*python, "-m", "gyriflow.cli", "check", "study.yaml"]
        seconds["check"] = cpu_seconds(check, folder)
        seconds["check_again"] = cpu_seconds(check, folder)
    return seconds


def cpu_seconds(command: list[str], folder: Path) -> float:
    """Run a command in a folder; return the CPU seconds of its processes."""
    # nothing that an earlier call has kept
    own = {"PYTHONPATH": str(ROOT / "src"), "XDG_CACHE_HOME": str(folder / "cache")}
    environment = os.environ | own
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        command, cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return round(used, 1)


if __name__ == "__main__":
    main()
