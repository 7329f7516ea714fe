"""Compare runs of one simulation: with two checkouts, or with several tolerances or
time steps.

    git worktree add ../before 864ee12
    ./run python benchmarks/pair.py MESH PARAMS --maps MAPS --end-week 22 \\
        --out FOLDER --before ../before
    ./run python benchmarks/pair.py MESH PARAMS --out FOLDER --tolerances 1e-6 1e-4
    ./run python benchmarks/pair.py MESH PARAMS --out FOLDER --steps 0.5 1

MESH, PARAMS and MAPS are `mesh/brain.xdmf` of a brain, and `params.yaml` and
`folding/maps.h5` of a run from it; MAPS is left out if the run has none. Checkouts run
in turn `--repeats` times, and the fastest run of each is reported. The last line is one
JSON object: for each run processor time, iterations, memory and, in mm, the difference
of its final positions from those of the first run (root mean square, mean, 95 %,
largest) and their displacement (root mean square).
"""

import argparse
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
from common import ROOT, print_rows

from gyriflow.io.files import read_json
from gyriflow.io.frames import read_positions
from gyriflow.io.yaml_files import read_yaml, write_yaml

DAY_S = 86_400.0
REPORTED = ("dofs", "steps", "newton", "krylov", "cpu_seconds", "peak_memory_MiB")


def fold(
    checkout: Path, arguments: argparse.Namespace, parameters: dict[str, Any], out: Path
) -> dict[str, Any]:
    """Run the simulation with a checkout and return its summary; CalledProcessError if
    it fails."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    write_yaml(out / "params.yaml", parameters)
    program = [
        "mpiexec",
        "-n",
        str(arguments.ranks),
        "python",
        "-m",
        "gyriflow.folding",
        str(arguments.mesh.resolve()),
    ]
    program += ["--params", str(out / "params.yaml"), "--out", str(out)]
    program += ["--maps", str(arguments.maps.resolve())] if arguments.maps else []
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run(["./run", *program], cwd=checkout, env=environment, check=True)
    return read_json(out / "summary.json")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("mesh", type=Path)
    parser.add_argument("params", type=Path)
    parser.add_argument("--maps", type=Path)
    varied = parser.add_mutually_exclusive_group(required=True)
    varied.add_argument(
        "--before", type=Path, metavar="CHECKOUT", help="the other checkout"
    )
    varied.add_argument(
        "--tolerances",
        type=float,
        nargs="+",
        help="of Newton's method, the smallest first",
    )
    varied.add_argument(
        "--steps",
        type=float,
        nargs="+",
        metavar="DAYS",
        help="time steps, the shortest first",
    )
    parser.add_argument("--end-week", type=float, help="[default: that of the run]")
    parser.add_argument("--ranks", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    values = read_yaml(arguments.params)
    end = arguments.end_week or values["end_week"]
    values |= {
        "end_week": end,
        "output_weeks": [week for week in values["output_weeks"] if week < end] + [end],
    }
    if arguments.before:
        runs = {"before": (arguments.before, values), "now": (ROOT, values)}
    elif arguments.tolerances:
        runs = {
            f"{value:g}": (ROOT, values | {"newton_tolerance": value})
            for value in arguments.tolerances
        }
    else:
        runs = {
            f"{days:g} days": (ROOT, values | {"step_s": days * DAY_S})
            for days in arguments.steps
        }
    fastest: dict[str, dict[str, Any]] = {}
    for name in [*runs] * arguments.repeats:
        summary = fold(
            runs[name][0], arguments, runs[name][1], arguments.out.resolve() / name
        )
        fastest[name] = min(
            fastest.get(name, summary),
            summary,
            key=lambda summary: summary["cpu_seconds"],
        )
    rows = []
    reference = read_positions(arguments.out / next(iter(runs)) / "frames.h5", end)
    for name, summary in fastest.items():
        start, last = (
            read_positions(arguments.out / name / "frames.h5", at)
            for at in (values["start_week"], end)
        )
        gaps = np.linalg.norm(last - reference, axis=1)
        moved = np.linalg.norm(last - start, axis=1)
        row = {"run": name} | {key: summary[key] for key in REPORTED}
        row |= {
            "rms_mm": np.sqrt((gaps**2).mean()),
            "mean_mm": gaps.mean(),
            "p95_mm": np.quantile(gaps, 0.95),
        }
        rows.append(
            row
            | {
                "largest_mm": gaps.max(),
                "displacement_mm": np.sqrt((moved**2).mean()),
            }
        )
    print_rows(rows)


if __name__ == "__main__":
    main()
