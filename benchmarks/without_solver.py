"""Measure brains by an installed gyriflow without the solver and in the environment of
./run, and compare all numbers.

    python3 -m venv plain && plain/bin/pip install .
    ./run python benchmarks/without_solver.py plain/bin/gyriflow \\
        --data ../shared/data --out FOLDER [--only BRAIN ...]

`--checkout` is the checkout whose ./run has the solver (default: this one). In
622a1dfd, the last commit with the tree of Debian's dolfinx 0.9, modes are computed by
SLEPc.

DATA holds `spina_bifida_atlas/week{21,34}_labels.nii.gz` and
`hemispheres/fetal.week21.{left,right}.pial.surf.gii`; the surfaces of 34 GW are those
that gyriflow extracts from the labels of 34 GW, which have to be measured before or
in the same call. Each brain is a study of its own,
measured on one core to the report. The last line is one JSON object: for each brain the
CPU seconds of all processes, the memory of the largest one, and the largest relative
difference of the results, as `same_results.py` compares them; `coefficients.csv` is
left out, as the sign of a mode is arbitrary. The exit code is 1 if a difference is
above 1e-6 or a file is missing.
"""

import argparse
import os
import shutil
import sys
from pathlib import Path
from subprocess import Popen
from typing import Any

from common import ROOT, print_rows
from same_results import IGNORED, compare

from gyriflow.io.yaml_files import write_yaml
from gyriflow.settings.terms import SIDES

MAX_DIFFERENCE = 1e-6
OWN_VARIABLES = ("PYTHONPATH", "VIRTUAL_ENV", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Variables of ./run that a shell does not have."""


def brain_entries(data: Path, out: Path) -> dict[str, dict[str, Any]]:
    """Return the entry of the configuration for each brain."""
    brains: dict[str, dict[str, Any]] = {}
    for week in (21, 34):
        labels = str(data / "spina_bifida_atlas" / f"week{week}_labels.nii.gz")
        brains[f"labels-{week}"] = {
            "week": week,
            "labels": labels,
            "scheme": "spina-bifida-atlas",
        }
    given = data / "hemispheres"
    extracted = out / "labels-34/without/study/results/brains/brain/surface"
    brains["surfaces-21"] = surface_entry(
        21, f"{given}/fetal.week21.{{}}.pial.surf.gii"
    )
    brains["surfaces-34"] = surface_entry(34, f"{extracted}/{{}}.pial.surf.gii")
    return brains


def surface_entry(week: int, pattern: str) -> dict[str, Any]:
    """Return the entry of a pair of hemispheres, given a pattern of their files."""
    hemispheres = {side: pattern.format(side) for side in SIDES}
    return {"week": week, "hemispheres": hemispheres}


def measure(
    program: list[str], folder: Path, brain: dict[str, Any]
) -> tuple[float, float]:
    """Measure a brain in a new folder; return the CPU seconds and the memory of the
    largest process in MiB."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    write_yaml(folder / "study.yaml", {"brains": [{"id": "brain", **brain}]})
    environment = {
        name: value for name, value in os.environ.items() if name not in OWN_VARIABLES
    }
    command = [*program, "measure", "study.yaml", "--cores", "1"]
    process = Popen(command, cwd=folder, env=environment, stdout=sys.stderr)
    _, status, usage = os.wait4(process.pid, 0)
    if status or not (folder / "results" / "report" / "report.html").is_file():
        raise RuntimeError(f"{' '.join(command)} failed in {folder}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "program", type=Path, help="gyriflow of a venv without the extra fold"
    )
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--only", nargs="+", metavar="BRAIN")
    parser.add_argument("--checkout", type=Path, default=ROOT)
    arguments = parser.parse_args()
    plain = [str(arguments.program.absolute())]
    checkout = [str(arguments.checkout.resolve() / "run"), "gyriflow"]
    rows = []
    is_equal = True
    out = arguments.out.resolve()
    brains = brain_entries(arguments.data.resolve(), out)
    names = arguments.only or list(brains)
    extracted = Path(brains["surfaces-34"]["hemispheres"]["left"])
    if "surfaces-34" in names and "labels-34" not in names and not extracted.is_file():
        parser.error("surfaces-34 needs labels-34 in the same --out: add it to --only")
    for name in names:
        brain = brains[name]
        without = out / name / "without"
        with_solver = out / name / "with"
        cpu_without, memory_without = measure(plain, without / "study", brain)
        cpu_with, memory_with = measure(checkout, with_solver / "study", brain)
        differences, summary = compare(
            with_solver, without, {}, IGNORED | {"coefficients.csv"}
        )
        print(*differences, sep="\n", file=sys.stderr)
        largest = summary["largest_relative_difference"]
        has_all_files = not summary["only_before"] and not summary["only_after"]
        has_equal_texts = not any(": inf" in line for line in differences)
        is_equal = (
            is_equal and largest <= MAX_DIFFERENCE and has_all_files and has_equal_texts
        )
        row = {"brain": name, "files": summary["files"], "largest_difference": largest}
        row |= {"cpu_s_without": cpu_without, "cpu_s_with": cpu_with}
        row |= {"MiB_without": memory_without, "MiB_with": memory_with}
        rows.append(row)
    print_rows(rows)
    sys.exit(not is_equal)


if __name__ == "__main__":
    main()
